// How the topics of a graph hang together, and how they are looked at.
#pragma once

#include <string>
#include <vector>

#include "graph/dds.hpp"
#include "graph/description.hpp"
#include "tools/recording/topics.hpp"

namespace cosegraph::monitor {

using recording::Topic;

// Names of the topics of type Cloud that `stage`'s results can be about, nearest first: those that
// its inputs, or the inputs of the stages before it, take.
std::vector<std::string> clouds_of(const graph::GraphDescription& graph,
                                   const std::vector<Topic>& topics, const std::string& stage);

// The stages that publish `topic`, and that take it.
std::vector<std::string> publishers_of(const graph::GraphDescription& graph, const Topic& topic);
std::vector<std::string> readers_of(const graph::GraphDescription& graph, const Topic& topic);

// For looking on without any influence on the graph: nothing is repeated for a reader that is too
// slow. What is published only once is asked for reliably.
graph::EndpointQos onlooker_qos(const Topic& topic, const graph::GraphDescription& graph);

}  // namespace cosegraph::monitor
