// The topics of a graph that carry no frames, and who may write and read which topics: the rights
// that keys give (see security.hpp).
#pragma once

#include <string>
#include <vector>

#include "graph/description.hpp"

namespace cosegraph::graph {

enum class Role {
  stage,     // one of the graph's; its replicas and successors are the same to others
  observer,  // looks at everything and gives orders: commands, recorders, monitors
  agent,     // runs the stages of a host
};

// What a participant of a graph is to the others.
struct Identity {
  Role role = Role::observer;
  std::string stage;  // of the role `stage`

  static Identity of_stage(std::string name) { return {Role::stage, std::move(name)}; }
  static Identity observer() { return {Role::observer, ""}; }
  static Identity agent() { return {Role::agent, ""}; }
};

// "stage 'cpc'", "observer", "agent".
std::string to_text(const Identity& identity);

// Every identity of a graph: its stages in their order, then observer and agent.
std::vector<Identity> identities_of(const GraphDescription& graph);

struct TypedTopic {
  std::string name;  // with the graph's
  std::string type;  // of idl/
};

// Those that carry no frames.
std::vector<TypedTopic> control_topics(const GraphDescription& graph);

// Names of topics, sorted; "*" stands for any characters.
struct TopicRights {
  std::vector<std::string> writes;
  std::vector<std::string> reads;
};

// Expects a graph without faults. Throws Error for a stage that the graph does not have.
TopicRights rights_of(const GraphDescription& graph, const Catalog& catalog,
                      const Identity& identity);

}  // namespace cosegraph::graph

template <>
cosegraph::Names<cosegraph::graph::Role> cosegraph::names<cosegraph::graph::Role>();
