#include "tools/recording/topics.hpp"

#include <algorithm>
#include <set>
#include <sstream>

#include "graph/control.hpp"
#include "graph/topics.hpp"

namespace cosegraph::recording {
namespace {

constexpr std::string_view kWirePrefix = "cosegraph::msg::";

bool is_taken(const graph::GraphDescription& graph, const std::string& stage,
              const std::string& port) {
  return std::ranges::any_of(graph.stages, [&](const graph::StageNode& node) {
    return std::ranges::any_of(node.inputs, [&](const graph::Connection& input) {
      return input.from_stage == stage && input.from_port == port;
    });
  });
}

}  // namespace

std::vector<Topic> topics_of(const graph::GraphDescription& graph, const graph::Catalog& catalog) {
  std::vector<Topic> topics;
  for (const auto& node : graph.stages) {
    const auto upstream = graph::upstream_of(graph, node.name);
    for (const auto& port : graph::info_of(node, catalog).outputs)
      topics.push_back({.name = graph::topic_name(graph, node.name, port.name),
                        .type = port.type,
                        .stage = node.name,
                        .latched = port.latched,
                        .taken = is_taken(graph, node.name, port.name),
                        .upstream = {upstream.begin(), upstream.end()}});
  }
  for (auto& topic : graph::control_topics(graph))
    topics.push_back({.name = std::move(topic.name), .type = std::move(topic.type)});
  return topics;
}

std::vector<Topic> choose(std::vector<Topic> topics, const std::vector<std::string>& wanted) {
  const auto has = [](const Topic& topic, const std::string& word) {
    return topic.name.find(word) != std::string::npos;
  };
  for (const auto& word : wanted)
    if (std::ranges::none_of(topics, [&](const Topic& topic) { return has(topic, word); })) {
      std::vector<std::string> names;
      for (const auto& topic : topics) names.push_back(topic.name);
      throw ParameterError("--topics: no topic's name contains '" + word + "'" +
                           did_you_mean(word, names));
    }
  if (!wanted.empty())
    std::erase_if(topics, [&](const Topic& topic) {
      return !topic.is_control() && std::ranges::none_of(wanted, [&](const std::string& word) {
        return has(topic, word);
      });
    });
  return topics;
}

graph::EndpointQos qos_of(const Topic& topic, const graph::GraphDescription& graph) {
  constexpr int kModelsKept = 2;
  if (topic.latched) return {.depth = kModelsKept};
  if (topic.type == "StreamEnd") return {.depth = 1};
  if (topic.type == "StageStatus" || topic.type == "AgentStatus") return graph::kOverheard;
  const bool is_of_frames = topic.has_frames() || topic.type.starts_with("Frame");
  return {.depth = is_of_frames ? graph::frame_history(graph) : graph::kStatusDepth};
}

Texts to_metadata(const Topic& topic) {
  std::string upstream;
  for (const auto& stage : topic.upstream) upstream += (upstream.empty() ? "" : " ") + stage;
  return {{"stage", topic.stage},
          {"latched", topic.latched ? "true" : "false"},
          {"taken", topic.taken ? "true" : "false"},
          {"upstream", upstream}};
}

Topic topic_of(const Channel& channel, const Schema& schema) {
  const auto value = [&](const char* key) {
    const auto found = channel.metadata.find(key);
    if (found == channel.metadata.end())
      throw InputError("channel " + channel.topic + " was not recorded by cosegraph: it has no '" +
                       key + "'");
    return found->second;
  };
  Topic topic{.name = channel.topic,
              .stage = value("stage"),
              .latched = value("latched") == "true",
              .taken = value("taken") == "true"};
  if (!schema.name.starts_with(kWirePrefix))
    throw InputError("channel " + channel.topic + " has the unknown type " + schema.name);
  topic.type = schema.name.substr(kWirePrefix.size());
  std::istringstream upstream(value("upstream"));
  for (std::string stage; upstream >> stage;) topic.upstream.push_back(stage);
  return topic;
}

}  // namespace cosegraph::recording
