// Replaces one stage of a running graph without losing or doubling a frame.
//
// The newcomer is started beside the old one, finds its peers, gets its model and keeps what
// arrives. The old one is told to finish the frame in work and to hold; it says which frame comes
// next, and the newcomer begins with that one. The old one stays until the frames that it has
// given out are over, so that nothing of its is missed, and goes on if the newcomer fails.
// If the old one dies meanwhile, the newcomer works off all that is not over; the joins behind
// drop what comes twice. Whether a swap is complete is read from the graph's own counters.
//
// This is the order of events alone: what is known goes in, orders come out. No DDS, no threads.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "graph/control.hpp"
#include "graph/description.hpp"
#include "idl/codec.hpp"

namespace cosegraph::graph {

// One process: stage, replica, generation.
using ProcessKey = std::tuple<std::string, std::uint32_t, std::uint32_t>;

// What is known about the graph at one moment.
struct GraphView {
  std::chrono::steady_clock::time_point now;
  std::map<ProcessKey, std::pair<idl::FrameHeader, idl::StageStatus>> statuses;
  std::map<ProcessKey, idl::AgentProcess> processes;  // of all agents
  std::map<ProcessKey, std::string> hosts;            // of the processes
  std::string source;                                 // stage that admits frames
};

// A frame that a leaf has reported on, in the order of arrival.
struct FrameReport {
  std::string leaf;
  std::uint64_t epoch = 0;
  std::uint64_t sequence = 0;
  bool failed = false;
  std::chrono::steady_clock::time_point time;
};

struct SwapRequest {
  GraphDescription graph;  // as it is to be
  std::string stage;
  std::uint32_t old_generation = 0;
  std::uint32_t new_generation = 0;
  std::vector<std::string> old_hosts;  // per replica, as new_hosts
  std::vector<std::string> new_hosts;
  bool dry_run = false;  // ends when the newcomer is ready
};

struct SwapReport {
  bool done = false;
  std::string text;            // why not
  std::uint64_t admitted = 0;  // frames, while it went on
  std::uint64_t finished = 0;  // of these, by all leaves
  std::uint64_t failed = 0;    // of these, with a reason that was told
  std::uint64_t lost = 0;      // over, but not reported by every leaf
  std::uint64_t doubled = 0;   // reported twice by a leaf
  double pause_ms = 0.0;       // longest interval between frames at a leaf around it
  double usual_ms = 0.0;       // median before
  double took_ms = 0.0;
};

class Swap {
 public:
  Swap(SwapRequest request, std::chrono::steady_clock::time_point now);

  // What is to be done next; to be called again and again until finished().
  std::vector<idl::Command> step(const GraphView& view);
  bool finished() const { return phase_ == Phase::done || phase_ == Phase::failed; }
  bool succeeded() const { return phase_ == Phase::done; }
  // In words, for people who wait.
  std::string activity() const;

  const SwapRequest& request() const { return request_; }
  SwapReport report(const std::deque<FrameReport>& frames) const;

 private:
  using Clock = std::chrono::steady_clock;
  enum class Phase { launching, draining, activating, settling, done, failed };

  std::string newcomer_fault(const GraphView& view) const;
  std::uint32_t replicas() const { return static_cast<std::uint32_t>(request_.new_hosts.size()); }
  void enter(Phase phase, Clock::time_point now);
  void give_up(const std::string& why, Clock::time_point now);
  ProcessKey newcomer(std::uint32_t replica) const;
  void order(std::string_view verb, std::vector<std::string> words = {},
             const std::string& host = "");
  void order_agents(const std::vector<std::string>& hosts, std::string_view verb);

  void await_readiness(const GraphView& view);
  void await_drain(const GraphView& view);
  void await_activation(const GraphView& view);
  void await_settlement(const GraphView& view);

  SwapRequest request_;
  Phase phase_ = Phase::launching;
  Clock::time_point began_;
  Clock::time_point entered_;
  Clock::time_point drained_at_{};
  Clock::time_point ended_{};
  std::vector<idl::Command> orders_;
  StreamPosition first_{};  // admission, when it began
  StreamPosition last_{};   // and when the newcomer was at work
  std::string why_;
};

// What the agent of `host` is to do about `stage` where a swap has been left unfinished: nobody
// leads it any more. Has a newcomer taken its place, it replaces what was before it; otherwise it
// goes, unless nothing else is left of the stage. Empty if all is as it should be.
std::vector<idl::Command> end_leftover_swap(const GraphView& view, const std::string& stage,
                                            const std::string& host);

// Orders to agents; `generation` is that of the newcomer, as for stages (see control.hpp).
namespace verb {
constexpr std::string_view kRetire = "retire";    // do not start its predecessors again
constexpr std::string_view kLaunch = "launch";    // words: graph as YAML, then replicas
constexpr std::string_view kReplace = "replace";  // it stays, its predecessors go
constexpr std::string_view kDismiss = "dismiss";  // it goes
constexpr std::string_view kKeep = "keep";        // after kRetire: start its predecessors again
constexpr std::string_view kGraph = "graph";      // words: the graph as it is now, as YAML
constexpr std::string_view kStart = "start";      // people's orders, as the following
constexpr std::string_view kStop = "stop";
constexpr std::string_view kRestart = "restart";
constexpr std::string_view kDown = "down";
constexpr std::string_view kSwap = "swap";    // words: options, see agent.cpp
constexpr std::string_view kClock = "clock";  // the reply is the time, ns since 1970
}  // namespace verb

}  // namespace cosegraph::graph
