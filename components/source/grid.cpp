#include "source/grid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "core/error.hpp"

namespace cosegraph::source {
namespace {

constexpr int kBitsPerAxis = 21;

// Numbers keys in the order of their first appearance (open addressing, linear probing).
class Numbering {
 public:
  Numbering() : slots_(1024) {}

  std::int32_t number_of(std::uint64_t key) {
    if (2 * count_ >= slots_.size()) grow();
    Slot& slot = find(slots_, key);
    if (slot.number < 0) slot = {key, static_cast<std::int32_t>(count_++)};
    return slot.number;
  }
  std::size_t count() const { return count_; }

 private:
  struct Slot {
    std::uint64_t key = 0;
    std::int32_t number = -1;
  };

  static Slot& find(std::vector<Slot>& slots, std::uint64_t key) {
    std::size_t at = ((key * 0x9e3779b97f4a7c15ULL) >> 20) & (slots.size() - 1);
    while (slots[at].number >= 0 && slots[at].key != key) at = (at + 1) & (slots.size() - 1);
    return slots[at];
  }
  void grow() {
    std::vector<Slot> larger(4 * slots_.size());
    for (const Slot& slot : slots_)
      if (slot.number >= 0) find(larger, slot.key) = slot;
    slots_ = std::move(larger);
  }

  std::vector<Slot> slots_;  // a power of two, at most half full
  std::size_t count_ = 0;
};

}  // namespace

Cells group_by_cell(std::span<const float> xyz, double size) {
  std::array<float, 3> low;
  std::array<float, 3> high;
  low.fill(std::numeric_limits<float>::max());
  high.fill(std::numeric_limits<float>::lowest());
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    low[i % 3] = std::min(low[i % 3], xyz[i]);
    high[i % 3] = std::max(high[i % 3], xyz[i]);
  }
  for (int axis = 0; axis < 3 && !xyz.empty(); ++axis)
    if ((static_cast<double>(high[axis]) - low[axis]) / size >= std::exp2(kBitsPerAxis))
      throw InputError("the points spread over more than 2000000 cells of " + std::to_string(size) +
                       ": are there far outliers in the cloud?");

  Cells cells;
  cells.size = size;
  cells.of_point.reserve(xyz.size() / 3);
  Numbering numbering;
  for (std::size_t i = 0; i < xyz.size(); i += 3) {
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis)
      key = key << kBitsPerAxis |
            static_cast<std::uint64_t>((static_cast<double>(xyz[i + axis]) - low[axis]) / size);
    cells.of_point.push_back(numbering.number_of(key));
  }
  cells.count = numbering.count();
  return cells;
}

Cells group_by_cell(std::span<const float> xyz, double size, std::size_t limit) {
  for (;;) {
    Cells cells = group_by_cell(xyz, size);
    if (cells.count <= limit) return cells;
    // A surface fills a number of cells that falls with the square of their size.
    const double ratio = static_cast<double>(cells.count) / static_cast<double>(limit);
    size *= std::max(1.02, std::sqrt(ratio));
  }
}

std::vector<float> cell_means(std::span<const float> values, const Cells& cells,
                              std::size_t dimension) {
  std::vector<double> sum(dimension * cells.count);
  std::vector<std::int32_t> points(cells.count);
  for (std::size_t i = 0; i < cells.of_point.size(); ++i) {
    const std::size_t cell = cells.of_point[i];
    for (std::size_t d = 0; d < dimension; ++d)
      sum[dimension * cell + d] += values[dimension * i + d];
    ++points[cell];
  }
  std::vector<float> means(sum.size());
  for (std::size_t i = 0; i < means.size(); ++i)
    means[i] = static_cast<float>(sum[i] / points[i / dimension]);
  return means;
}

}  // namespace cosegraph::source
