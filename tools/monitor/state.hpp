// What is known of a running graph: the newest status of every stage, the newest failures. A plain
// data structure: no DDS, no threads.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "graph/description.hpp"
#include "idl/codec.hpp"
#include "tools/monitor/topics.hpp"

namespace cosegraph::monitor {

enum class RunState {
  waiting,  // nothing has been heard yet
  running,
  finished,  // the source has no more frames
  silent,    // nothing is heard any more
  ended,     // the run is over and gone
};

class GraphState {
 public:
  static constexpr std::size_t kMaxFailures = 200;

  GraphState(graph::GraphDescription graph, std::vector<Topic> topics);

  // `now` in ns since 1970. Messages of older generations of a stage are ignored.
  void add_status(const idl::FrameHeader& header, const idl::StageStatus& status,
                  std::uint64_t now);
  void add_failure(const idl::FrameHeader& header, const idl::FrameFailure& failure,
                   std::uint64_t now);
  void end() { ended_ = true; }

  RunState state(std::uint64_t now) const;
  // Everything, as the monitor's page reads it: see docs/monitor.md.
  std::string to_json(std::uint64_t now) const;

 private:
  struct Seen {
    idl::FrameHeader header;
    idl::StageStatus status;
    std::uint64_t time = 0;
  };
  struct Failure {
    std::string stage;
    std::string frame;
    std::uint64_t sequence = 0;
    std::string reason;
    std::uint64_t time = 0;
  };

  const graph::GraphDescription graph_;
  const std::vector<Topic> topics_;
  bool ended_ = false;
  std::uint64_t heard_ = 0;  // when a status last came
  std::map<std::string, Seen> stages_;
  std::deque<Failure> failures_;  // newest last
  std::uint64_t failure_count_ = 0;
};

}  // namespace cosegraph::monitor

template <>
cosegraph::Names<cosegraph::monitor::RunState> cosegraph::names<cosegraph::monitor::RunState>();
