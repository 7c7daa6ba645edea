// Voxel Cloud Connectivity Segmentation: Papon, Abramov, Schoeler, Woergoetter, CVPR 2013.
//
// PCL's implementation in the sensor's frame (its normals look to the origin), without its
// logarithmic depth transform.
#pragma once

#include "core/fields.hpp"
#include "core/values.hpp"

namespace cosegraph::supervoxels {

// Lengths are multiples of the cloud's scale.
struct Params {
  double voxel = 0.012;         // edge; adjacency is adjacency of occupied voxels
  double seed = 0.045;          // distance of the seeds, about the supervoxels' diameter
  double color_weight = 0.0;    // without effect on clouds without colour
  double spatial_weight = 0.4;  // of distance / seed
  double normal_weight = 1.0;   // of 1 - |cos| of the angle between normals
};

Fields describe(Params& params);

// Over-segments `dense`; lengths are multiples of dense.scale. Points PCL leaves without a
// supervoxel take their nearest neighbour's. Ids are renumbered 0 .. count-1 in the order of
// their first point. Supervoxels are adjacent where their voxels touch; a piece of one or two that
// touches no other (a surface seen at a grazing angle) is adjacent to the nearest supervoxel within
// the seed distance. A normal that PCL cannot estimate (an isolated voxel) points to the sensor.
// The same bytes at every call. Throws InputError on an empty cloud, one with non-finite points,
// or one that yields no supervoxel; ParameterError if the seeds are closer than the voxels.
Supervoxels compute(const Cloud& dense, const Params& params);

}  // namespace cosegraph::supervoxels
