// What travels between the stages, as plain values: one struct per topic type (see idl/), without
// the frame header. The stages convert; the algorithms see only these.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/cloud.hpp"

namespace cosegraph {

// Supervoxels of a frame's `dense` cloud.
struct Supervoxels {
  std::vector<std::int32_t> of_point;     // per dense point, 0 .. count-1 (every point has one)
  std::vector<float> centroid;            // 3S
  std::vector<float> normal;              // 3S, unit, toward the sensor
  std::vector<std::int32_t> point_count;  // S
  std::vector<std::array<std::int32_t, 2>> adjacency;  // pairs a < b, sorted, unique
  float seed_resolution = 0.0F;                        // distance of the seeds, in the cloud's unit

  std::size_t count() const { return centroid.size() / 3; }
};

// Work and memory of the stages behind grow with the square of the number of segments: more than
// so many, in any message, are refused.
constexpr std::int32_t kMostSegments = 1 << 14;

// Part candidates: a partition of the supervoxels.
struct Segments {
  std::vector<std::int32_t> of_supervoxel;  // S, 0 .. count-1
  std::vector<std::int32_t> of_point;       // per dense point
  std::int32_t count = 0;
  std::vector<std::array<std::int32_t, 2>> adjacency;  // segment pairs a < b, sorted, unique
  std::vector<float> concavity;  // per pair: fraction of concave edges on the shared boundary
};

// Local descriptors of one kind at one radius.
struct DescriptorChannel {
  std::string name;  // descriptors::to_text(Channel), as "fpfh:0.08"
  std::int32_t dimension = 0;
  std::vector<std::int32_t> keypoint;  // indices into the frame's `cloud`, ascending
  std::vector<float> value;            // keypoint.size() x dimension; all finite
};

struct Descriptors {
  std::string recipe;  // of descriptors::Params
  std::vector<DescriptorChannel> channels;
};

// Packet vectors (BoW or Fisher) per segment, ready for the classifier.
struct Encodings {
  std::int32_t segment_count = 0;
  std::int32_t dimension = 0;
  std::vector<std::int32_t> segment;  // per packet, ascending; a segment may have none
  std::vector<float> value;           // segment.size() x dimension, most of them 0
};

// Appearance posterior p(l | T_i) per segment; rows sum to 1.
struct Scores {
  std::vector<std::string> label_names;
  std::int32_t majority = 0;  // the reference's most frequent label: the floor for any method
  std::int32_t segment_count = 0;
  std::vector<float> probability;  // segment_count x label_names.size()
};

// Laplace-Beltrami eigenpairs of a frame's `cloud`, sampled.
struct Spectrum {
  std::string recipe;                        // of spectra::Params
  std::vector<std::int32_t> sample;          // M indices into `cloud`, ascending
  std::vector<std::int32_t> sample_dense;    // the same samples as indices into `dense`
  std::vector<float> eigenvalue;             // E, ascending, without the zero mode; 1 / scale^2
  std::vector<float> eigenfunction;          // M x E, row = sample
  std::vector<std::int32_t> component;       // M: connected piece of the surface
  std::vector<std::int32_t> nearest_sample;  // per `cloud` point, 0 .. M-1
};

// The answer for one frame.
struct Labelling {
  std::vector<std::string> label_names;
  std::int32_t majority = 0;                // of Scores
  std::vector<std::int32_t> segment_label;  // per segment
  std::vector<float> segment_confidence;    // per segment, p(l | T_i) of the chosen label
  std::vector<std::int32_t> point_label;    // per dense point
  std::vector<float> point_confidence;      // per dense point
  double energy = 0.0;                      // (1) at the answer, without the constraint penalties
  bool proven_optimal = false;
  double gap = 0.0;             // upper bound on energy minus the minimum; 0 if proven
  std::int32_t violations = 0;  // adjacent segment pairs whose labels the reference never shows
  std::int64_t expansions = 0;  // nodes A* expanded
};

// Mixture of Gaussians with diagonal covariance, eq. (2).
struct GaussianMixture {
  std::int32_t components = 0;  // K
  std::int32_t dimension = 0;   // D
  std::vector<float> weight;    // K, sums to 1
  std::vector<float> mean;      // K x D
  std::vector<float> sigma;     // K x D, standard deviations
};

// Principal components: y = basis (x - mean). No projection if `output` is 0.
struct Projection {
  std::int32_t input = 0;
  std::int32_t output = 0;
  std::vector<float> mean;   // input
  std::vector<float> basis;  // output x input, orthonormal rows
};

// Part classifier over packet vectors, one-vs-rest.
struct Classifier {
  std::string kernel;  // "linear" or "rbf"
  std::int32_t dimension = 0;
  std::int32_t label_count = 0;
  std::vector<float> weight;       // linear: label_count x dimension
  std::vector<float> support;      // rbf: V x dimension
  std::vector<float> coefficient;  // rbf: label_count x V
  std::vector<float> bias;         // label_count
  double gamma = 0.0;              // rbf: exp(-gamma |x - v|^2)
  double sharpness = 3.0;          // probability = softmax(sharpness * margin)
};

struct AppearanceChannel {
  std::string name;            // of the DescriptorChannel it was learned from
  std::int32_t dimension = 0;  // of that channel
  Projection projection;
  GaussianMixture mixture;
  float block_scale = 1.0F;  // brings the channel's block of the packet vector to unit mean norm
};

struct AppearanceModel {
  std::uint64_t id = 0;                  // one id for both halves of a model; never 0 once trained
  std::vector<std::string> label_names;  // L, sorted
  std::vector<float> label_share;        // L: fraction of the training points, sums to 1
  std::string cloud_recipe;              // what the training clouds had
  std::string descriptor_recipe;         // what the training descriptors had
  std::string encoding_recipe;           // of fisher::Encoding
  std::vector<AppearanceChannel> channels;
  Classifier classifier;
};

// 1-D mixture of commute-time distances for one unordered pair of parts, eq. (8).
struct DistanceMixture {
  std::vector<float> weight;
  std::vector<float> mean;
  std::vector<float> sigma;
};

struct RelationModel {
  std::uint64_t id = 0;
  std::vector<std::string> label_names;  // L
  std::string spectrum_recipe;           // empty if trained without spectra: no `pairs` then
  std::vector<DistanceMixture> pairs;    // L (L + 1) / 2, at pair_index(); empty mixture: unseen
  std::vector<std::uint8_t> neighbours;  // L x L, symmetric: 1 if the reference shows the pair
};

// Position of the unordered pair (a, b) among the pairs of `RelationModel::pairs`.
constexpr std::size_t pair_index(std::size_t a, std::size_t b) {
  if (a < b) std::swap(a, b);
  return a * (a + 1) / 2 + b;
}

struct Model {
  AppearanceModel appearance;
  RelationModel relation;
};

}  // namespace cosegraph
