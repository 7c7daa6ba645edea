// Exact nearest neighbours in a fixed 3-D point set (k-d tree).
//
// Results are ordered by distance, ties by index, so they do not depend on the tree.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace cosegraph {

class NearestNeighbours {
 public:
  struct Neighbour {
    std::int32_t index;
    float squared_distance;
  };

  // Numbers, of points and of queries, lie within +-kFarthest: their squared distances are finite.
  // InputError is thrown for others, NaN among them.
  static constexpr float kFarthest = 1e18F;
  static bool takes(float x) { return std::abs(x) <= kFarthest; }

  // `xyz` holds 3N numbers; it is copied. N may be 0: every query is then empty.
  explicit NearestNeighbours(std::span<const float> xyz);
  ~NearestNeighbours();
  NearestNeighbours(NearestNeighbours&&) noexcept;
  NearestNeighbours& operator=(NearestNeighbours&&) noexcept;

  std::size_t size() const;

  // The min(k, N) nearest points to `query` (3 numbers), a point of the set itself included.
  std::vector<Neighbour> nearest(const float* query, std::size_t k) const;
  // Index of the nearest point; N must not be 0.
  std::int32_t nearest_index(const float* query) const;
  // All points within `radius` (squared_distance <= radius * radius); none if it is negative.
  std::vector<Neighbour> within(const float* query, float radius) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace cosegraph
