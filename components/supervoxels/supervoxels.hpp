// Voxel Cloud Connectivity Segmentation: Papon, Abramov, Schoeler, Woergoetter, CVPR 2013.
#pragma once

#include "core/fields.hpp"
#include "core/values.hpp"

namespace cosegraph::supervoxels {

struct Params {
  double voxel = 0.012;
  double seed = 0.05;
  double color_weight = 0.0;
  double spatial_weight = 0.4;
  double normal_weight = 1.0;
};

Fields describe(Params& params);

// Over-segments `dense`; lengths are multiples of dense.scale. Points PCL leaves without a
// supervoxel take their nearest neighbour's. Ids are renumbered 0 .. count-1 in the order of
// their first point. Throws InputError on an empty cloud or one that yields no supervoxel.
Supervoxels compute(const Cloud& dense, const Params& params);

}  // namespace cosegraph::supervoxels
