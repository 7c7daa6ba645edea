#include "graph/topics.hpp"

#include <algorithm>
#include <utility>

template <>
cosegraph::Names<cosegraph::graph::Role> cosegraph::names<cosegraph::graph::Role>() {
  using cosegraph::graph::Role;
  static constexpr std::pair<Role, std::string_view> table[] = {
      {Role::stage, "stage"}, {Role::observer, "observer"}, {Role::agent, "agent"}};
  return table;
}

namespace cosegraph::graph {
namespace {

// What a participant is to the topics that carry no frames; several may hold at once.
enum Party : unsigned {
  kSource = 1U << 0U,
  kFollower = 1U << 1U,  // every stage but the source
  kLeaf = 1U << 2U,
  kObserver = 1U << 3U,
  kAgent = 1U << 4U,
  kStages = kSource | kFollower,
  kOnlookers = kObserver | kAgent,
};

struct ControlTopic {
  std::string_view name;
  std::string_view type;
  unsigned writers;
  unsigned readers;
};

constexpr ControlTopic kControlTopics[] = {
    {"stage_status", "StageStatus", kStages | kAgent, kStages | kOnlookers},
    {"frame_done", "FrameDone", kLeaf, kSource | kOnlookers},
    {"frame_failure", "FrameFailure", kStages, kFollower | kOnlookers},
    {"stream_end", "StreamEnd", kSource, kFollower | kOnlookers},
    {"command", "Command", kOnlookers, kStages | kOnlookers},
    {"reply", "Reply", kAgent, kOnlookers},
    {"agent_status", "AgentStatus", kAgent, kOnlookers},
    {"log", "LogLines", kAgent, kOnlookers},
};

unsigned parties_of(const GraphDescription& graph, const Catalog& catalog,
                    const Identity& identity) {
  if (identity.role == Role::observer) return kObserver;
  if (identity.role == Role::agent) return kAgent;
  const std::vector<std::string> leaves = leaves_of(graph, catalog);
  const bool is_leaf = std::ranges::find(leaves, identity.stage) != leaves.end();
  const bool is_source = identity.stage == source_of(graph, catalog).name;
  return (is_source ? kSource : kFollower) | (is_leaf ? kLeaf : 0U);
}

void add_frames(const GraphDescription& graph, const Catalog& catalog, const std::string& stage,
                TopicRights& rights) {
  const StageNode* node = graph.stage(stage);
  if (node == nullptr) throw Error("graph '" + graph.graph + "' has no stage '" + stage + "'");
  for (const auto& port : info_of(*node, catalog).outputs)
    rights.writes.push_back(topic_name(graph, stage, port.name));
  for (const auto& input : node->inputs)
    rights.reads.push_back(topic_name(graph, input.from_stage, input.from_port));
}

void sort_out(std::vector<std::string>& topics) {
  std::ranges::sort(topics);
  topics.erase(std::unique(topics.begin(), topics.end()), topics.end());
}

}  // namespace

std::string to_text(const Identity& identity) {
  if (identity.role == Role::stage) return "stage '" + identity.stage + "'";
  return std::string(to_name(identity.role));
}

std::vector<Identity> identities_of(const GraphDescription& graph) {
  std::vector<Identity> result;
  for (const auto& stage : graph.stages) result.push_back(Identity::of_stage(stage.name));
  result.push_back(Identity::observer());
  result.push_back(Identity::agent());
  return result;
}

std::vector<TypedTopic> control_topics(const GraphDescription& graph) {
  std::vector<TypedTopic> result;
  for (const auto& topic : kControlTopics)
    result.push_back({graph.graph + "/" + std::string(topic.name), std::string(topic.type)});
  return result;
}

TopicRights rights_of(const GraphDescription& graph, const Catalog& catalog,
                      const Identity& identity) {
  TopicRights rights;
  if (identity.role == Role::stage) add_frames(graph, catalog, identity.stage, rights);
  const unsigned parties = parties_of(graph, catalog, identity);
  for (const auto& topic : kControlTopics) {
    const std::string name = graph.graph + "/" + std::string(topic.name);
    if ((topic.writers & parties) != 0) rights.writes.push_back(name);
    if ((topic.readers & parties) != 0) rights.reads.push_back(name);
  }
  if (identity.role == Role::observer) rights.reads = {graph.graph + "/*"};
  sort_out(rights.writes);
  sort_out(rights.reads);
  return rights;
}

}  // namespace cosegraph::graph
