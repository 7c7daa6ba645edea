// Labels for the segments of a query: energy (1) over the fully connected graph of segments,
// minimised exactly (Araslanov et al., section 3.5).
#pragma once

#include <cstdint>

#include "astar/relations.hpp"
#include "astar/search.hpp"
#include "core/fields.hpp"
#include "core/values.hpp"

namespace cosegraph::astar {

enum class Spatial {
  none,      // appearance only
  iso,       // with spatial relations and hard neighbourhood constraints
  iso_free,  // text "iso*": spatial relations without the hard constraints
};

enum class PairwiseScale {
  none,      // (1) as printed
  segments,  // pairwise terms divided by the number of segments
};

struct Params {
  Spatial spatial = Spatial::none;
  Likelihood likelihood = Likelihood::geomean;
  PairwiseScale pairwise_scale = PairwiseScale::segments;
  double pairwise_weight = 1.0;
  int max_distances = 400;   // per pair of segments
  int max_open = 2'000'000;  // A*: nodes on the heap
};

Fields describe(Params& params);

// `spectrum` and `relations` may be null when spatial is `none`. Throws MismatchError if spatial
// terms are asked for and spectrum or relation model are missing, were made with other recipes,
// or the label names of `scores` and `relations` differ.
Labelling infer(const Scores& scores, const Segments& segments, const Spectrum* spectrum,
                const RelationModel* relations, const Params& params);

}  // namespace cosegraph::astar

template <>
cosegraph::Names<cosegraph::astar::Spatial> cosegraph::names<cosegraph::astar::Spatial>();
template <>
cosegraph::Names<cosegraph::astar::PairwiseScale>
cosegraph::names<cosegraph::astar::PairwiseScale>();
