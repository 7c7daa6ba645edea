#include "core/nearest.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <string>
#include <tuple>

#include "core/error.hpp"

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

// The tree's lower bounds of distances carry rounding errors of a few units in the last place, so
// it is asked for slightly more than is wanted; what it offers is then compared exactly.
float with_slack(float squared_distance) {
  constexpr float kMax = std::numeric_limits<float>::max();
  return std::min(kMax, std::nextafter(squared_distance * (1.0F + 1e-5F), kMax));
}

bool is_usable(const float* point) {
  return std::all_of(point, point + 3, NearestNeighbours::takes);
}

void check_query(const float* query) {
  if (!is_usable(query))
    throw InputError("a point whose neighbours are wanted is not finite, or too far out");
}

std::span<const float> checked(std::span<const float> xyz) {
  for (std::size_t i = 0; i + 2 < xyz.size(); i += 3)
    if (!is_usable(&xyz[i]))
      throw InputError("point " + std::to_string(i / 3) + " is not finite, or too far out");
  return xyz;
}

bool closer(const Neighbour& a, const Neighbour& b) {
  return std::tie(a.squared_distance, a.index) < std::tie(b.squared_distance, b.index);
}

// Keeps the k nearest of what the tree offers, ties by index.
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
  float worstDist() const {
    if (heap_.size() < capacity_) return std::numeric_limits<float>::max();
    return with_slack(heap_.front().squared_distance);
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
    : tree_(std::make_unique<Tree>(checked(xyz))) {}
NearestNeighbours::~NearestNeighbours() = default;
NearestNeighbours::NearestNeighbours(NearestNeighbours&&) noexcept = default;
NearestNeighbours& NearestNeighbours::operator=(NearestNeighbours&&) noexcept = default;

std::size_t NearestNeighbours::size() const {
  return tree_->points.kdtree_get_point_count();
}

std::vector<Neighbour> NearestNeighbours::nearest(const float* query, std::size_t k) const {
  k = std::min(k, size());
  if (k == 0) return {};
  check_query(query);
  NearestSet found(k);
  tree_->tree.findNeighbors(found, query, nanoflann::SearchParams());
  return std::move(found).sorted();
}

std::int32_t NearestNeighbours::nearest_index(const float* query) const {
  return nearest(query, 1).front().index;
}

std::vector<Neighbour> NearestNeighbours::within(const float* query, float radius) const {
  if (size() == 0 || !(radius >= 0.0F)) return {};
  check_query(query);
  const float limit = radius * radius;
  std::vector<std::pair<std::uint32_t, float>> found;
  tree_->tree.radiusSearch(query, with_slack(limit), found,
                           nanoflann::SearchParams(0, 0.0F, false));
  std::vector<Neighbour> result;
  result.reserve(found.size());
  for (const auto& [index, squared] : found)
    if (squared <= limit) result.push_back({static_cast<std::int32_t>(index), squared});
  std::ranges::sort(result, closer);
  return result;
}

}  // namespace cosegraph
