// Constrained Planar Cuts: Schoeler, Papon, Woergoetter, CVPR 2015, with the merging of small
// fragments in ascending order of concavity (Araslanov et al., GCPR 2016, section 3.2).
//
// The cuts are PCL's, with its fixed RANSAC seed; the merging is ours.
#pragma once

#include <cstdint>
#include <span>

#include "core/fields.hpp"
#include "core/values.hpp"

namespace cosegraph::cpc {

enum class Merge {
  concavity,  // smallest concavity score first, into that neighbour
  size,       // original: vertex order, into the largest neighbour
};

struct Params {
  double concavity_tolerance = 5.0;  // angle up to which a concave edge still counts as convex
  bool sanity_check = true;          // edges along the crease count as concave
  int max_cuts = 25;                 // levels of recursive cutting
  int min_cut_edges = 10;            // segments with fewer edges are not cut
  double min_cut_score = 0.16;       // fraction of concave edges a cut must gather
  int ransac_iterations = 500;
  int min_segment = 3;  // segments of fewer supervoxels are merged
  Merge merge = Merge::concavity;
};

Fields describe(Params& params);

// Partitions the supervoxels; their seed distance is how far from a plane edges support it. Segment
// ids are 0 .. count-1 in the order of their first supervoxel. The same bytes at every call, from any thread. Throws
// InputError if `supervoxels` is empty or inconsistent.
Segments compute(const Supervoxels& supervoxels, const Params& params);

// True where supervoxels a and b meet in a concave edge: n1.d - n2.d < 0, d = (x1-x2)/|x1-x2|.
bool is_concave(const Supervoxels& supervoxels, std::int32_t a, std::int32_t b);

// Merges every segment of fewer than `min_segment` supervoxels in ascending order of concavity
// score (fraction of concave edges on the shared boundary); ties by the smaller segment id, then
// by the smaller neighbour id. `segment` holds an id per supervoxel and is changed in place.
// Scores are those of the current segments: they are counted anew after every merge. The merged
// segment takes its neighbour's id. A small segment without neighbours stays.
void merge_by_concavity(const Supervoxels& supervoxels, int min_segment,
                        std::span<std::int32_t> segment);

// The original rule: segments in the order of their first supervoxel, each small one into its
// largest neighbour (ties: the smaller id), until none is left that has a neighbour.
void merge_by_size(const Supervoxels& supervoxels, int min_segment,
                   std::span<std::int32_t> segment);

}  // namespace cosegraph::cpc

template <>
cosegraph::Names<cosegraph::cpc::Merge> cosegraph::names<cosegraph::cpc::Merge>();
