// From an input cloud to what the pipeline works on: object extraction, scale, the dense cloud for
// supervoxels and the sparse cloud with normals for descriptors and spectra.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/cloud.hpp"
#include "core/fields.hpp"

namespace cosegraph::source {

// How "scale" is estimated from the visible points alone. The constants bring the mean over the
// benchmark's views to sqrt(surface area of the full mesh) = 1; README.md has the spread.
enum class ScaleRule {
  area,    // sqrt of the visible area (occupied cells weighted by their normals' obliqueness)
  extent,  // robust extent: a high percentile of the distances to the centroid
  fixed,   // 1 in the input's unit: for inputs that are all to one scale
};

// What belongs to the model: reference and query must agree. Lengths are multiples of the scale.
struct Params {
  ScaleRule scale_rule = ScaleRule::area;
  double dense_spacing = 0.005;  // finest spacing of the dense cloud
  double spacing = 0.014;        // voxel of the sparse cloud
  double normal_radius = 0.035;  // neighbourhood of the normals' PCA
};

Fields describe(Params& params);

// What belongs to one scene: getting the object out of it. The steps are done in this order on at
// most 60000 cells of the scene. The dominant plane is the one with most points (not area: a near
// table comes before a far wall), and every point is tested against it.
struct Extraction {
  bool enabled = false;             // off: all finite points are the object
  std::vector<std::string> crop;    // six numbers xmin ymin zmin xmax ymax zmax, or none; in m
  int outlier_neighbours = 30;      // statistical outlier removal; 0: none
  double outlier_sigma = 2.0;       // points farther than mean + sigma deviations go
  double plane_tolerance = 0.01;    // dominant plane (table, floor) removed, in m; 0: none.
                                    // A plane with less than a fifth of the scene is left alone
  bool standing = true;             // with a plane: only what stands on it, on the sensor's side
                                    // and over the outline of its largest connected piece
  double cluster_tolerance = 0.02;  // Euclidean clusters, in m; 0: all points are one
  int cluster = 0;                  // which cluster to keep, 0 = largest (by occupied cells)
};

Fields describe(Extraction& extraction);

struct Frame {
  Cloud input;  // the input's points in its order, dense_index filled, recipe and scale too
  Cloud dense;  // unorganised, one mean point per voxel, no normals
  Cloud cloud;  // unorganised, one mean point per voxel of `dense`, normals toward the sensor
  std::vector<std::string> notes;  // what a user should know ("2000000 points reduced to 19873")
};

// Throws InputError for a cloud without enough finite points to work on (fewer than 50 after
// extraction and reduction), or without extent. Deterministic. Memory is bounded: the dense cloud
// holds at most 60000 points (its spacing grows until it does; noted). A label of `dense` or
// `cloud` is the most frequent one of the points it stands for (ties: the smaller index); labels
// influence nothing else.
Frame prepare(Cloud input, const Extraction& extraction, const Params& params);

// The scale of finite points `xyz` by `rule`, in the input's unit. Does not depend on the order or
// density of the points as long as their spacing stays below about 0.02 scales; invariant to
// rotation up to a few percent (`area`) or about one percent (`extent`). Throws InputError if the
// points have no extent.
double estimate_scale(const std::vector<float>& xyz, ScaleRule rule);

}  // namespace cosegraph::source

template <>
cosegraph::Names<cosegraph::source::ScaleRule> cosegraph::names<cosegraph::source::ScaleRule>();
