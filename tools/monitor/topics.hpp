// Which topics a graph has, as channels, and how they hang together.
#pragma once

#include <string>
#include <vector>

#include "graph/dds.hpp"
#include "graph/description.hpp"

namespace cosegraph::monitor {

struct Topic {
  std::string name;
  std::string type;   // of idl::type_names()
  std::string stage;  // who publishes it; empty: every stage
  std::string port;
  bool latched = false;
};

// What stages publish in the file's order, then the control topics.
std::vector<Topic> topics_of(const graph::GraphDescription& graph, const graph::Catalog& catalog);

// Names of the topics of type Cloud that `stage`'s results can be about, nearest first: those that
// its inputs, or the inputs of the stages before it, take.
std::vector<std::string> clouds_of(const graph::GraphDescription& graph,
                                   const std::vector<Topic>& topics, const std::string& stage);

// The stages that take `topic`.
std::vector<std::string> readers_of(const graph::GraphDescription& graph, const Topic& topic);

// For looking on without any influence on the graph: nothing is repeated for a reader that is too
// slow. What is published only once is asked for reliably.
graph::EndpointQos qos_of(const Topic& topic, const graph::GraphDescription& graph);

}  // namespace cosegraph::monitor
