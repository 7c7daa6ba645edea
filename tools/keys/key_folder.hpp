// Makes and renews the keys of a graph (the layout is told in graph/security.hpp).
//
// Private keys are written with mode 0600 into folders of mode 0700. What is there is whole: a
// folder is made beside the place where it belongs, and moved there in one step.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "graph/security.hpp"

namespace cosegraph::keys {

// From an hour ago, so that hosts whose clocks differ a little agree, for `days`. Throws
// ParameterError unless there are 1 to 3650.
graph::Validity from_now(int days);

// Makes `folder` with two authorities and the keys of every stage, of observer and agent. The
// authorities live for ten years, or as long as the longest-lived of their certificates. Throws
// InputError if the folder exists and is not empty.
void init(const graph::GraphDescription& graph, const graph::Catalog& catalog,
          const std::filesystem::path& folder, const graph::Validity& validity);

// Makes new keys and permissions in place of what participants have, and the governance anew.
// `names`: stages, "observer", "agent"; empty: all. Returns the names. Throws ParameterError for an
// unknown name, InputError if the folder has no authorities.
std::vector<std::string> issue(const graph::GraphDescription& graph, const graph::Catalog& catalog,
                               const std::filesystem::path& folder,
                               const std::vector<std::string>& names,
                               const graph::Validity& validity);

}  // namespace cosegraph::keys
