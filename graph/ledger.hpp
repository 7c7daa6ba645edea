// A source's account of its frames: admitted = labelled + consumed + failed + in flight.
//
// A frame ends when every leaf has reported on it; it has failed if any leaf says so, and is
// labelled rather than consumed if any leaf labelled it. Holds no thread, clock or DDS.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "graph/stage.hpp"

namespace cosegraph::graph {

using Clock = std::chrono::steady_clock;

class Ledger {
 public:
  Ledger(std::vector<std::string> leaves, int window);

  // Takes over the figures of a predecessor.
  void restore(const idl::Account& account) { account_ = account; }

  bool has_room() const { return open_.size() < window_; }
  std::size_t in_flight() const { return open_.size(); }
  std::size_t window() const { return window_; }
  const idl::Account& account() const { return account_; }
  // Sequences of the frames in flight, in order.
  std::vector<std::uint64_t> open() const;
  // All frames before this one are over; `next` is the next to be admitted.
  std::uint64_t settled(std::uint64_t next) const {
    return open_.empty() ? next : open_.begin()->first;
  }

  void admit(const idl::FrameHeader& header, Clock::time_point now);
  void drop(std::uint64_t frames) { account_.dropped += frames; }
  // A leaf's report on a frame; reports that come twice or too late are ignored. One that comes too
  // early, because a stranger's message has claimed a frame before its time, holds for that frame.
  void done(const std::string& leaf, const idl::FrameHeader& header, const idl::FrameDone& done);

  // Frames admitted before `limit` that are still open and have not been returned before.
  std::vector<idl::FrameHeader> overdue(Clock::time_point limit);
  // Ends a frame as failed without the leaves that have not reported.
  void abandon(const idl::FrameHeader& header);

  // All frames are over and every leaf has said that the stream is worked off.
  bool ended() const { return open_.empty() && ended_.size() == leaves_.size(); }
  const std::string& end_failure() const { return end_failure_; }

 private:
  struct Open {
    idl::FrameHeader header;
    Clock::time_point admitted;
    std::set<std::string> reported;
    bool labelled = false;
    bool failed = false;
    bool overdue = false;
  };
  void close(std::uint64_t sequence);

  std::vector<std::string> leaves_;
  std::size_t window_;
  std::map<std::uint64_t, Open> open_;
  std::uint64_t next_ = 0;  // behind the frame that was admitted last
  std::map<std::pair<std::uint64_t, std::string>, idl::FrameDone> early_;  // within a window
  std::set<std::string> ended_;
  std::string end_failure_;
  idl::Account account_;
};

}  // namespace cosegraph::graph
