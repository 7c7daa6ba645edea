#include "core/nearest.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <tuple>

namespace cosegraph {
namespace {

struct Points {
  std::vector<float> xyz;

  std::size_t kdtree_get_point_count() const { return xyz.size() / 3; }
  float kdtree_get_pt(std::size_t index, std::size_t axis) const { return xyz[3 * index + axis]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Points>,
                                                   Points, 3, std::uint32_t>;
using Neighbour = NearestNeighbours::Neighbour;

bool closer(const Neighbour& a, const Neighbour& b) {
  return std::tie(a.squared_distance, a.index) < std::tie(b.squared_distance, b.index);
}

// Keeps the k nearest of what the tree offers, with ties at the k-th distance resolved by index.
class NearestSet {
 public:
  using DistanceType = float;

  explicit NearestSet(std::size_t k) : capacity_(k) { heap_.reserve(k + 1); }

  bool addPoint(float squared_distance, std::uint32_t index) {
    heap_.push_back({static_cast<std::int32_t>(index), squared_distance});
    std::ranges::push_heap(heap_, closer);
    if (heap_.size() > capacity_) {
      std::ranges::pop_heap(heap_, closer);
      heap_.pop_back();
    }
    return true;
  }
  // Slightly beyond the k-th distance, so that a tie is still offered.
  float worstDist() const {
    if (heap_.size() < capacity_) return std::numeric_limits<float>::max();
    return std::nextafter(heap_.front().squared_distance, std::numeric_limits<float>::max());
  }
  bool full() const { return heap_.size() == capacity_; }
  std::size_t size() const { return heap_.size(); }

  std::vector<Neighbour> sorted() && {
    std::ranges::sort_heap(heap_, closer);
    return std::move(heap_);
  }

 private:
  std::size_t capacity_;
  std::vector<Neighbour> heap_;
};

}  // namespace

struct NearestNeighbours::Tree {
  Points points;
  KdTree tree;

  explicit Tree(std::span<const float> xyz)
      : points{{xyz.begin(), xyz.end()}},
        tree(3, points, nanoflann::KDTreeSingleIndexAdaptorParams(12)) {}
};

NearestNeighbours::NearestNeighbours(std::span<const float> xyz)
    : tree_(std::make_unique<Tree>(xyz)) {}
NearestNeighbours::~NearestNeighbours() = default;
NearestNeighbours::NearestNeighbours(NearestNeighbours&&) noexcept = default;
NearestNeighbours& NearestNeighbours::operator=(NearestNeighbours&&) noexcept = default;

std::size_t NearestNeighbours::size() const { return tree_->points.kdtree_get_point_count(); }

std::vector<Neighbour> NearestNeighbours::nearest(const float* query, std::size_t k) const {
  k = std::min(k, size());
  if (k == 0) return {};
  NearestSet found(k);
  tree_->tree.findNeighbors(found, query, nanoflann::SearchParams());
  return std::move(found).sorted();
}

std::int32_t NearestNeighbours::nearest_index(const float* query) const {
  return nearest(query, 1).front().index;
}

std::vector<Neighbour> NearestNeighbours::within(const float* query, float radius) const {
  if (size() == 0) return {};
  std::vector<std::pair<std::uint32_t, float>> found;
  const float reach = std::nextafter(radius * radius, std::numeric_limits<float>::max());
  tree_->tree.radiusSearch(query, reach, found, nanoflann::SearchParams(0, 0.0F, false));
  std::vector<Neighbour> result;
  result.reserve(found.size());
  for (const auto& [index, squared] : found)
    result.push_back({static_cast<std::int32_t>(index), squared});
  std::ranges::sort(result, closer);
  return result;
}

}  // namespace cosegraph
