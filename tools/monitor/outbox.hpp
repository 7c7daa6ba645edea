// What waits to be sent to one client. A plain data structure: no sockets, no threads.
//
// A slow client must cost neither the graph nor the server anything, so the queue is bounded by
// bytes: when a message does not fit, the oldest ones go, and are counted.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>

#include "tools/monitor/protocol.hpp"

namespace cosegraph::monitor {

class Outbox {
 public:
  struct Item {
    std::string text;  // if there is no payload
    bool is_binary = false;
    MessageHead head{};
    Payload payload;
    std::uint32_t subscription = 0;
    bool keep = false;

    std::size_t size() const {
      return payload == nullptr ? text.size() : head.size() + payload->size();
    }
  };

  // At least one message is held, whatever its size.
  explicit Outbox(std::size_t max_bytes) : max_bytes_(max_bytes) {}

  // Answers and news about channels; never dropped.
  void push(std::string text, bool is_binary = false);
  void push(std::uint32_t subscription, const Message& message);

  std::optional<Item> pop();
  bool empty() const { return items_.empty(); }
  std::size_t bytes() const { return bytes_; }

  // A client that does not read makes even what is never dropped pile up; it must be given up.
  bool is_hopeless() const { return kept_bytes_ > kHopeless * max_bytes_; }

  // Forgets what waits for a subscription that is over.
  void forget(std::uint32_t subscription);

  // Messages dropped since the client came, by subscription.
  const std::map<std::uint32_t, std::uint64_t>& dropped() const { return dropped_; }

 private:
  static constexpr std::size_t kHopeless = 16;

  void make_room(std::size_t bytes);
  std::deque<Item>::iterator remove(std::deque<Item>::iterator item);

  const std::size_t max_bytes_;
  std::deque<Item> items_;
  std::size_t bytes_ = 0;
  std::size_t kept_bytes_ = 0;  // of those that are not dropped
  std::map<std::uint32_t, std::uint64_t> dropped_;
};

}  // namespace cosegraph::monitor
