#include "graph/observer.hpp"

#include "graph/control.hpp"

namespace cosegraph::graph {

Observer::Observer(const GraphDescription& graph) : participant_(graph, graph.graph + "/observer") {
  const auto read = [&](const char* what, const char* type, int depth, auto take) {
    readers_.push_back(participant_.reader(
        control_topic(graph, what), type, {.depth = depth}, [this, take](const Sample& sample) {
          try {
            const idl::FrameHeader header = idl::decode_header(*sample);
            const std::scoped_lock lock(mutex_);
            take(header, *sample);
            fresh_ = true;
          } catch (const Error&) {
            return;  // a stranger's message
          }
          news_.notify_all();
        }));
  };
  read("stage_status", "StageStatus", 1,
       [this](const idl::FrameHeader& header, const idl::Bytes& bytes) {
         Observed& seen = stages_[header.stage];
         if (header.generation < seen.header.generation) return;
         seen = {header, idl::decode<idl::StageStatus>(bytes)};
       });
  read("frame_failure", "FrameFailure", 2 * graph.window + 2,
       [this](const idl::FrameHeader& header, const idl::Bytes& bytes) {
         failures_.push_back({.stage = header.stage,
                              .frame = header.name,
                              .sequence = header.sequence,
                              .reason = idl::decode<idl::FrameFailure>(bytes).reason});
       });
}

std::map<std::string, Observed> Observer::stages() const {
  const std::scoped_lock lock(mutex_);
  return stages_;
}

std::vector<ObservedFailure> Observer::failures() const {
  const std::scoped_lock lock(mutex_);
  return failures_;
}

void Observer::wait(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  news_.wait_for(lock, patience, [this] { return fresh_; });
  fresh_ = false;
}

}  // namespace cosegraph::graph
