// Whether a mesh is the closed surface that the benchmark's shapes are. Internal to evaluation.
#pragma once

#include <string>

#include "core/cloud.hpp"

namespace cosegraph::evaluation {

// What is wrong with a mesh: holes, edges with more than two faces, vertices that join surfaces in
// one point only, vertices without a face. Empty if nothing is. Vertices at one position count as
// one, faces without area as none. `mesh` must pass check_sizes().
std::string flaws_of(const Mesh& mesh);

}  // namespace cosegraph::evaluation
