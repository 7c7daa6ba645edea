// What is known of a running graph, as the page shows it. A plain data structure: no DDS, no
// threads.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "graph/description.hpp"
#include "graph/observer.hpp"
#include "graph/traffic.hpp"
#include "tools/monitor/frame_index.hpp"
#include "tools/monitor/topics.hpp"

namespace cosegraph::monitor {

enum class RunState {
  waiting,  // nothing has been heard yet
  running,
  finished,  // the source has no more frames
  silent,    // nothing is heard any more
  ended,     // the run is over and gone
  file,      // it was never a run: a file is looked at
};

class GraphState {
 public:
  static constexpr std::size_t kMaxFailures = 200;
  using Time = std::chrono::steady_clock::time_point;

  // `infos`: of the stages, in their order, for their parameters; may be empty.
  GraphState(graph::GraphDescription graph, std::vector<Topic> topics,
             std::vector<graph::StageInfo> infos = {});

  // The graph after a stage of it was swapped: the same stages and ports.
  void change(graph::GraphDescription graph, std::vector<graph::StageInfo> infos);
  // The newest of every process, and failures that are new.
  void hear(graph::Look processes, const std::vector<graph::ObservedFailure>& failures);
  // Agents are there, who can swap stages.
  void set_agents(bool any) { agents_ = any; }
  // What people should know: the swap that goes on, what a file lacks.
  void set_note(std::string text) { note_ = std::move(text); }
  // Of a file: what there is to see, and which frame first.
  void set_frames(FrameIndex frames, std::size_t first) {
    frames_ = std::move(frames);
    first_ = first;
  }
  void end(RunState how = RunState::ended) { end_ = how; }

  const graph::GraphDescription& graph() const { return graph_; }
  std::size_t failure_count() const { return failure_count_; }

  RunState state(Time now) const;
  // Everything: see docs/monitor.md. `wall` is now too, in ns since 1970.
  std::string to_json(Time now, std::uint64_t wall) const;

 private:
  graph::GraphDescription graph_;
  const std::vector<Topic> topics_;
  std::vector<graph::StageInfo> infos_;
  RunState end_ = RunState::waiting;  // waiting: it has not
  bool agents_ = false;
  std::string note_;
  std::optional<FrameIndex> frames_;
  std::size_t first_ = 0;
  graph::Look processes_;
  std::deque<graph::ObservedFailure> failures_;  // newest last
  std::size_t failure_count_ = 0;
};

}  // namespace cosegraph::monitor

template <>
cosegraph::Names<cosegraph::monitor::RunState> cosegraph::names<cosegraph::monitor::RunState>();
