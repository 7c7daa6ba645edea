// Publishes what was recorded: to whoever reads the graph's topics, or to one stage.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "graph/description.hpp"
#include "graph/stage.hpp"
#include "tools/recording/mcap_reader.hpp"

namespace cosegraph::recording {

struct ReplayOptions {
  std::uint64_t from = 0;  // log time, inclusive
  std::uint64_t to = std::numeric_limits<std::uint64_t>::max();
  double speed = 1.0;                       // replay() only: times the recorded speed, positive
  bool loop = false;                        // replay() only: begins anew until it is stopped
  std::vector<std::string> topics;          // replay() only: parts of names; empty: all
  bool wait = false;                        // replay() only: until the topics are read
  const std::atomic<bool>* stop = nullptr;  // set by a signal handler
};

struct ReplayReport {
  std::uint64_t messages = 0;
  std::uint64_t rounds = 0;  // that came to their end
};

// `graph` names the topics and the run (its instance) that they belong to. Models that were
// recorded before `from` are published first. Nobody holds the replay up: who is slower than it
// loses messages. Every round has epochs of its own, as a source that starts anew.
ReplayReport replay(const McapReader& reader, const graph::GraphDescription& graph,
                    const ReplayOptions& options);

struct IntoReport {
  std::uint64_t frames = 0;   // that the stage was given
  std::uint64_t failed = 0;   // of these, at the stage
  std::uint64_t skipped = 0;  // failed before the stage, or not recorded in full
  idl::StageStatus status;    // of the stage, at the end
  bool interrupted = false;
};

// Runs `stage` (its parameters set) in this process in the place of the recorded graph's stage of
// that name, as fast as it takes the recorded frames. What it publishes can be looked at as in any
// run. Throws Error if it refuses to start, gives up, or does not finish a frame by the graph's
// deadline.
IntoReport replay_into(const McapReader& reader, const graph::GraphDescription& graph,
                       const std::string& name, std::unique_ptr<graph::Stage> stage,
                       const ReplayOptions& options);

}  // namespace cosegraph::recording
