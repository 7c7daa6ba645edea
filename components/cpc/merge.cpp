#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <tuple>
#include <vector>

#include "cpc/boundary.hpp"
#include "cpc/cpc.hpp"

namespace cosegraph::cpc {
namespace {

// Supervoxels per segment id.
std::map<std::int32_t, int> sizes_of(std::span<const std::int32_t> segment) {
  std::map<std::int32_t, int> sizes;
  for (const std::int32_t id : segment) ++sizes[id];
  return sizes;
}

struct MergeStep {
  std::int32_t from;
  std::int32_t into;
};

void apply(const MergeStep& step, std::span<std::int32_t> segment) {
  std::ranges::replace(segment, step.from, step.into);
}

// The step of smallest (score, small segment, neighbour).
std::optional<MergeStep> least_concave(const std::vector<Boundary>& boundaries,
                                       const std::map<std::int32_t, int>& sizes, int min_segment) {
  using Candidate = std::tuple<double, std::int32_t, std::int32_t>;
  std::optional<Candidate> best;
  const auto offer = [&](double score, std::int32_t from, std::int32_t into) {
    if (sizes.at(from) >= min_segment) return;
    const Candidate candidate{score, from, into};
    if (!best || candidate < *best) best = candidate;
  };
  for (const Boundary& boundary : boundaries) {
    offer(boundary.score(), boundary.a, boundary.b);
    offer(boundary.score(), boundary.b, boundary.a);
  }
  if (!best) return std::nullopt;
  return MergeStep{std::get<1>(*best), std::get<2>(*best)};
}

std::optional<std::int32_t> largest_neighbour(const std::vector<Boundary>& boundaries,
                                              const std::map<std::int32_t, int>& sizes,
                                              std::int32_t of) {
  std::optional<std::int32_t> largest;
  for (const Boundary& boundary : boundaries) {
    if (boundary.a != of && boundary.b != of) continue;
    const std::int32_t other = boundary.a == of ? boundary.b : boundary.a;
    if (!largest || std::pair(-sizes.at(other), other) < std::pair(-sizes.at(*largest), *largest))
      largest = other;
  }
  return largest;
}

}  // namespace

bool is_concave(const Supervoxels& supervoxels, std::int32_t a, std::int32_t b) {
  double turn = 0.0;  // (n1 - n2) . (x1 - x2); the length of d does not change the sign
  for (int axis = 0; axis < 3; ++axis)
    turn +=
        (static_cast<double>(supervoxels.normal[3 * a + axis]) - supervoxels.normal[3 * b + axis]) *
        (static_cast<double>(supervoxels.centroid[3 * a + axis]) -
         supervoxels.centroid[3 * b + axis]);
  return turn < 0.0;
}

std::vector<Boundary> boundaries_of(const Supervoxels& supervoxels,
                                    std::span<const std::int32_t> segment) {
  std::map<std::array<std::int32_t, 2>, Boundary> found;
  for (const auto& [a, b] : supervoxels.adjacency) {
    const auto [low, high] = std::minmax(segment[a], segment[b]);
    if (low == high) continue;
    Boundary& boundary = found[{low, high}];
    boundary.a = low;
    boundary.b = high;
    ++boundary.edges;
    boundary.concave += is_concave(supervoxels, a, b) ? 1 : 0;
  }
  std::vector<Boundary> result;
  result.reserve(found.size());
  for (const auto& [pair, boundary] : found) result.push_back(boundary);
  return result;
}

void merge_by_concavity(const Supervoxels& supervoxels, int min_segment,
                        std::span<std::int32_t> segment) {
  while (const auto step =
             least_concave(boundaries_of(supervoxels, segment), sizes_of(segment), min_segment))
    apply(*step, segment);
}

void merge_by_size(const Supervoxels& supervoxels, int min_segment,
                   std::span<std::int32_t> segment) {
  for (bool merged = true; merged;) {
    merged = false;
    for (std::size_t i = 0; i < segment.size(); ++i) {
      const auto sizes = sizes_of(segment);
      if (sizes.at(segment[i]) >= min_segment) continue;
      const auto into = largest_neighbour(boundaries_of(supervoxels, segment), sizes, segment[i]);
      if (!into) continue;
      apply({segment[i], *into}, segment);
      merged = true;
    }
  }
}

}  // namespace cosegraph::cpc
