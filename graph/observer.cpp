#include "graph/observer.hpp"

#include <algorithm>

#include "graph/control.hpp"
#include "graph/figures.hpp"

namespace cosegraph::graph {

namespace {

// After so much silence a lower generation is believed: whoever was there is gone.
constexpr auto kForgotten = std::chrono::seconds(2);

}  // namespace

Observer::Observer(const GraphDescription& graph, const std::string& name)
    : graph_(graph), participant_(graph, graph.graph + "/" + name) {
  const auto read = [&](const char* what, const char* type, EndpointQos qos, auto take) {
    readers_.push_back(participant_.reader(
        control_topic(graph, what), type, qos, [this, take](const Sample& sample) {
          try {
            const idl::FrameHeader header = idl::decode_header(*sample);
            const std::scoped_lock lock(mutex_);
            take(header, *sample);
            fresh_ = true;
          } catch (const std::exception&) {
            return;  // a stranger's message
          }
          news_.notify_all();
        }));
  };
  read("stage_status", "StageStatus", kOverheard,
       [this](const idl::FrameHeader& header, const idl::Bytes& bytes) {
         const StageNode* node = graph_.stage(header.stage);
         auto status = idl::decode<idl::StageStatus>(bytes);
         if (node == nullptr || status.candidate || status.replica >= hosts_of(*node).size())
           return;
         const auto now = std::chrono::steady_clock::now();
         Observed& seen = stages_[process_name(*node, status.replica)];
         if (header.generation < seen.header.generation && now - seen.heard < kForgotten) return;
         seen = {header, std::move(status), now};
       });
  read("agent_status", "AgentStatus", kOverheard,
       [this](const idl::FrameHeader&, const idl::Bytes& bytes) {
         auto status = idl::decode<idl::AgentStatus>(bytes);
         const std::string host = status.host;
         agents_[host] = {std::move(status), std::chrono::steady_clock::now()};
       });
  read("frame_failure", "FrameFailure", {.depth = frame_history(graph)},
       [this](const idl::FrameHeader& header, const idl::Bytes& bytes) {
         if (graph_.stage(header.stage) == nullptr) return;
         failures_.push_back({.stage = header.stage,
                              .frame = header.name,
                              .sequence = header.sequence,
                              .reason = idl::decode<idl::FrameFailure>(bytes).reason,
                              .heard = wall_nanoseconds()});
       });
}

std::map<std::string, Observed> Observer::stages() const {
  const std::scoped_lock lock(mutex_);
  return stages_;
}

std::map<std::string, ObservedAgent> Observer::agents() const {
  const std::scoped_lock lock(mutex_);
  return agents_;
}

std::vector<ObservedFailure> Observer::failures(std::size_t known) const {
  const std::scoped_lock lock(mutex_);
  return {failures_.begin() + static_cast<std::ptrdiff_t>(std::min(known, failures_.size())),
          failures_.end()};
}

void Observer::wait(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  news_.wait_for(lock, patience, [this] { return fresh_; });
  fresh_ = false;
}

}  // namespace cosegraph::graph
