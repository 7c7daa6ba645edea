// Points grouped by the cubic cell they lie in.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace cosegraph::source {

struct Cells {
  std::vector<std::int32_t> of_point;  // N, 0 .. count-1
  std::size_t count = 0;
  double size = 0.0;  // edge
};

// Cells have edge `size` (> 0) and start at the lower corner of the bounding box of `xyz` (3N
// finite numbers); they are numbered in the order of their first point. Throws InputError if the
// box is wider than 2^21 cells.
Cells group_by_cell(std::span<const float> xyz, double size);

// The same with the smallest tried size, from `size` upwards, that gives at most `limit` cells.
Cells group_by_cell(std::span<const float> xyz, double size, std::size_t limit);

// The mean of each cell's points. `values` holds `dimension` numbers per point, the result per
// cell.
std::vector<float> cell_means(std::span<const float> values, const Cells& cells,
                              std::size_t dimension = 3);

}  // namespace cosegraph::source
