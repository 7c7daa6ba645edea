// Which host of a graph this machine is.
#pragma once

#include <string>

#include "graph/description.hpp"

namespace cosegraph::tools {

// The host that is meant by `wanted`; if that is empty the one whose address this machine has, and
// nothing for a graph without hosts. Throws ParameterError if it is not clear, or if a stage names
// no host.
std::string host_here(const graph::GraphDescription& graph, const std::string& wanted);

}  // namespace cosegraph::tools
