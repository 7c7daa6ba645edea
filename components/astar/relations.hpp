// Spatial part relations: distributions of commute-time distances between parts, eq. (8) and (9)
// (Araslanov et al., section 3.4), learned from the reference and evaluated on the query.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/names.hpp"
#include "core/values.hpp"

namespace cosegraph::astar {

enum class Likelihood {
  literal,  // (8) as printed: sum of densities
  geomean,  // ours: exp of the mean log(density + 0.001), so that no odd distance alone decides
};

struct RelationParams {
  int mixture = 3;              // components per pair of parts
  int samples_per_pair = 2000;  // distances per pair and view
  std::uint64_t seed = 1;
};

// One training view: its spectrum, and the part of each sample (kNoLabel: none).
struct RelationView {
  const Spectrum* spectrum;
  std::vector<std::int32_t> label;
};

// A 1-D mixture per unordered pair of labels (the same label included) over all views; deviations
// have a floor of 2 % of the mean distance of all pairs. A pair never seen together in a view has
// an empty mixture.
std::vector<DistanceMixture> fit_relations(std::span<const RelationView> views, int label_count,
                                           const RelationParams& params);

// log p(i', j' | D), eq. (9), of the distances between two groups of samples (group_a may equal
// group_b): L x L, row i' for group_a. At most `max_distances` distances are used (an even
// stride). A pair with an empty mixture has the lowest likelihood of the pairs that have one.
// Groups without samples, or a relation model without pairs: all zero (no opinion).
std::vector<double> log_pair_posterior(const Spectrum& spectrum,
                                       std::span<const std::int32_t> group_a,
                                       std::span<const std::int32_t> group_b,
                                       const RelationModel& model, Likelihood likelihood,
                                       int max_distances);

// Which labels the reference shows next to each other: L x L, symmetric, 1 on the diagonal. Two
// labels are neighbours if in some view at least `min_pairs` pairs of points, one of each label,
// lie within `radius` (times the cloud's scale).
std::vector<std::uint8_t> observed_neighbours(std::span<const Cloud* const> views, int label_count,
                                              double radius, int min_pairs);

}  // namespace cosegraph::astar

template <>
cosegraph::Names<cosegraph::astar::Likelihood> cosegraph::names<cosegraph::astar::Likelihood>();
