#include "tools/monitor/topics.hpp"

#include <algorithm>
#include <deque>
#include <set>

#include "graph/runtime.hpp"

namespace cosegraph::monitor {

std::vector<Topic> topics_of(const graph::GraphDescription& graph, const graph::Catalog& catalog) {
  std::vector<Topic> topics;
  for (const auto& node : graph.stages)
    for (const auto& port : graph::info_of(node, catalog).outputs)
      topics.push_back({.name = graph::topic_name(graph, node.name, port.name),
                        .type = port.type,
                        .stage = node.name,
                        .port = port.name,
                        .latched = port.latched});
  for (const auto& [what, type] :
       {std::pair{"stage_status", "StageStatus"}, std::pair{"frame_failure", "FrameFailure"},
        std::pair{"frame_done", "FrameDone"}, std::pair{"stream_end", "StreamEnd"}})
    topics.push_back({.name = graph::control_topic(graph, what), .type = type});
  return topics;
}

std::vector<std::string> clouds_of(const graph::GraphDescription& graph,
                                   const std::vector<Topic>& topics, const std::string& stage) {
  std::vector<std::string> result;
  std::set<std::string> seen{stage};
  std::deque<std::string> open{stage};
  for (; !open.empty(); open.pop_front()) {
    const graph::StageNode* node = graph.stage(open.front());
    if (node == nullptr) continue;
    for (const auto& input : node->inputs) {
      const auto topic = std::ranges::find(
          topics, graph::topic_name(graph, input.from_stage, input.from_port), &Topic::name);
      const bool is_new_cloud = topic != topics.end() && topic->type == "Cloud" &&
                                std::ranges::find(result, topic->name) == result.end();
      if (is_new_cloud) result.push_back(topic->name);
      if (seen.insert(input.from_stage).second) open.push_back(input.from_stage);
    }
  }
  return result;
}

std::vector<std::string> readers_of(const graph::GraphDescription& graph, const Topic& topic) {
  std::vector<std::string> result;
  for (const auto& node : graph.stages)
    for (const auto& input : node.inputs)
      if (!topic.stage.empty() && input.from_stage == topic.stage && input.from_port == topic.port)
        result.push_back(node.name);
  return result;
}

graph::EndpointQos qos_of(const Topic& topic, const graph::GraphDescription& graph) {
  if (topic.latched) return {.depth = 2};
  if (topic.type == "StageStatus" || topic.type == "StreamEnd") return {.depth = 1};
  return {.depth = 2 * graph.window + 2, .keep_for_late = false, .reliable = false};
}

}  // namespace cosegraph::monitor
