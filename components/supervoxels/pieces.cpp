#include "supervoxels/pieces.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "core/nearest.hpp"

namespace cosegraph::supervoxels {
namespace {

using Ids = std::vector<std::int32_t>;

constexpr std::int32_t kSmallPiece = 3;

// Per supervoxel the smallest id of its connected piece.
Ids pieces_of(const Supervoxels& supervoxels) {
  Ids parent(supervoxels.count());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&parent](std::int32_t id) {
    while (parent[id] != id) id = parent[id] = parent[parent[id]];
    return id;
  };
  for (const auto& [a, b] : supervoxels.adjacency) {
    const auto [low, high] = std::minmax({root(a), root(b)});
    parent[high] = low;
  }
  Ids piece(parent.size());
  for (std::size_t i = 0; i < piece.size(); ++i) piece[i] = root(static_cast<std::int32_t>(i));
  return piece;
}

struct Link {
  float squared_distance = std::numeric_limits<float>::max();
  std::array<std::int32_t, 2> supervoxels{};
};

}  // namespace

void link_small_pieces(const Cloud& dense, float reach, Supervoxels& supervoxels) {
  const Ids piece = pieces_of(supervoxels);
  Ids size(piece.size(), 0);
  for (const std::int32_t id : piece) ++size[id];
  const auto small = [&](std::int32_t id) { return size[piece[id]] < kSmallPiece; };
  if (std::ranges::none_of(piece, small)) return;

  const NearestNeighbours tree(dense.xyz);
  std::vector<Link> shortest(piece.size());  // at the piece's smallest id
  for (std::size_t i = 0; i < supervoxels.of_point.size(); ++i) {
    const std::int32_t from = supervoxels.of_point[i];
    if (!small(from)) continue;
    Link& link = shortest[piece[from]];
    for (const auto& near : tree.within(&dense.xyz[3 * i], reach)) {
      const std::int32_t to = supervoxels.of_point[near.index];
      if (piece[to] == piece[from]) continue;
      if (near.squared_distance < link.squared_distance)
        link = {near.squared_distance, {std::min(from, to), std::max(from, to)}};
      break;
    }
  }
  for (const Link& link : shortest)
    if (link.supervoxels[0] != link.supervoxels[1])
      supervoxels.adjacency.push_back(link.supervoxels);
}

}  // namespace cosegraph::supervoxels
