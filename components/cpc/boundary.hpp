// Where two segments touch.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/values.hpp"

namespace cosegraph::cpc {

struct Boundary {
  std::int32_t a = 0;  // segment ids, a < b
  std::int32_t b = 0;
  int edges = 0;  // between supervoxels of a and of b
  int concave = 0;

  // The concavity score of section 3.2.
  double score() const { return static_cast<double>(concave) / edges; }
};

// All boundaries between different segments, sorted by (a, b).
std::vector<Boundary> boundaries_of(const Supervoxels& supervoxels,
                                    std::span<const std::int32_t> segment);

}  // namespace cosegraph::cpc
