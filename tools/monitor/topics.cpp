#include "tools/monitor/topics.hpp"

#include <algorithm>
#include <deque>
#include <set>

namespace cosegraph::monitor {

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

std::vector<std::string> publishers_of(const graph::GraphDescription& graph, const Topic& topic) {
  if (!topic.is_control()) return {topic.stage};
  std::vector<std::string> all;
  for (const auto& node : graph.stages) all.push_back(node.name);
  return all;
}

std::vector<std::string> readers_of(const graph::GraphDescription& graph, const Topic& topic) {
  std::vector<std::string> result;
  for (const auto& node : graph.stages)
    for (const auto& input : node.inputs)
      if (!topic.is_control() && input.from_stage == topic.stage && input.from_port == topic.port())
        result.push_back(node.name);
  return result;
}

graph::EndpointQos onlooker_qos(const Topic& topic, const graph::GraphDescription& graph) {
  graph::EndpointQos qos = recording::qos_of(topic, graph);
  const bool is_repeated = topic.has_frames() || topic.type.starts_with("Frame");
  if (is_repeated) qos.keep_for_late = qos.reliable = false;
  return qos;
}

}  // namespace cosegraph::monitor
