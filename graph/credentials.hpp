// Looks at a participant's keys before DDS does, which would only say that it cannot start.
#pragma once

#include "graph/description.hpp"
#include "graph/security.hpp"

namespace cosegraph::graph {

// Throws GraphError, at dds.security, with what is wrong: key_faults(), a certificate that is not
// valid now, is another one's or of another authority, a key that does not belong to it, documents
// that the authority has not signed. Does nothing for a graph without security.
void require_keys(const GraphDescription& graph, const Identity& identity);

}  // namespace cosegraph::graph
