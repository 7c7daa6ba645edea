// What the monitor's server offers: channels of encoded messages, as in the Foxglove WebSocket
// protocol, and whoever feeds them.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/codec.hpp"

namespace cosegraph::monitor {

using Payload = std::shared_ptr<const idl::Bytes>;

struct Channel {
  std::string topic;
  std::string encoding;     // of messages: "cdr" or "json"
  std::string schema_name;  // as "cosegraph::msg::Cloud"
  std::string schema;
  std::string schema_encoding;  // "omgidl" or "jsonschema"
  // Who publishes and who reads the topic: stages of the graph.
  std::vector<std::string> publishers;
  std::vector<std::string> subscribers;

  bool operator==(const Channel&) const = default;
};

struct Message {
  std::uint64_t time = 0;  // ns since 1970, when it came in
  Payload payload;
  // Not dropped when a client is slow. For what comes once; a feed keeps the sum of it small.
  bool keep = false;
};

// Takes a message of the channel at that place. May be called from any thread; never blocks.
using Deliver = std::function<void(std::size_t channel, Message message)>;

// Something that clients may ask for, with JSON texts as request and response.
struct Service {
  std::string name;
  std::string request_schema;  // JSON schemas
  std::string response_schema;

  bool operator==(const Service&) const = default;
};

// The response, or why there is none.
struct Answer {
  bool done = false;
  std::string text;
};
using Reply = std::function<void(Answer)>;

// A source of messages. Channels are numbered by their place in channels(), which never changes.
// All calls come from one thread.
class Feed {
 public:
  virtual ~Feed() = default;

  virtual std::string name() const = 0;
  virtual const std::vector<Channel>& channels() const = 0;
  // Before anything else; `deliver` outlives the feed.
  virtual void open(Deliver deliver) = 0;
  // Somebody wants the channel's messages, for the first time or again. What a late reader needs is
  // returned: messages that are not going to be repeated. `part`: only those of that part of the
  // frames, below parts().
  virtual std::vector<Message> subscribe(std::size_t channel, std::optional<std::size_t> part) = 0;
  // The last reader has gone.
  virtual void unsubscribe(std::size_t channel) = 0;

  // In how many parts its frames can be had; 0: it goes on, and has none.
  virtual std::size_t parts() const { return 0; }

  // Numbered by their place, which never changes.
  virtual const std::vector<Service>& services() const {
    static const std::vector<Service> kNone;
    return kNone;
  }
  // `reply` is called once, now or later, from any thread, but not after the feed is gone.
  virtual void call(std::size_t, const std::string&, Reply reply) { reply({}); }
};

}  // namespace cosegraph::monitor
