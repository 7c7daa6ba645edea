#include "fuzz/scene.hpp"

#include <cmath>
#include <numbers>

#include "astar/astar.hpp"
#include "descriptors/descriptors.hpp"
#include "fisher/fisher.hpp"
#include "spectra/spectra.hpp"
#include "supervoxels/supervoxels.hpp"
#include "svm/svm.hpp"

namespace cosegraph::fuzz {
namespace {

constexpr int kBall = 45;    // points
constexpr int kHandle = 20;  // points

void add_point(Cloud& cloud, std::array<double, 3> normal, std::array<double, 3> at,
               std::int32_t label) {
  for (const double x : at) cloud.xyz.push_back(static_cast<float>(x));
  for (const double x : normal) cloud.normal.push_back(static_cast<float>(x));
  cloud.label.push_back(label);
  cloud.dense_index.push_back(static_cast<std::int32_t>(cloud.dense_index.size()));
  cloud.width = static_cast<std::uint32_t>(cloud.size());
}

// Half a ball that faces the sensor at the origin, with a rod to its side.
Cloud mug() {
  Cloud cloud{.label_names = {"body", "handle"}, .recipe = "r"};
  for (int i = 0; i < kBall; ++i) {
    const double depth = (i + 0.5) / kBall;
    const double turn = i * std::numbers::pi * (3.0 - std::sqrt(5.0));
    const double ring = std::sqrt(1.0 - depth * depth);
    const std::array<double, 3> n{ring * std::cos(turn), ring * std::sin(turn), -depth};
    add_point(cloud, n, {0.4 * n[0], 0.4 * n[1], 2.0 + 0.4 * n[2]}, 0);
  }
  for (int i = 0; i < kHandle; ++i) {
    const double turn = -0.25 * std::numbers::pi * (i % 5);
    const std::array<double, 3> n{0.0, std::cos(turn), std::sin(turn)};
    add_point(cloud, n, {0.42 + 0.015 * i, 0.1 * n[1], 2.0 + 0.1 * n[2]}, 1);
  }
  return cloud;
}

// More of them than cutting so small a shape gives.
Segments one_per_supervoxel(const Supervoxels& supervoxels) {
  Segments segments{.of_point = supervoxels.of_point,
                    .count = static_cast<std::int32_t>(supervoxels.count()),
                    .adjacency = supervoxels.adjacency,
                    .concavity = std::vector<float>(supervoxels.adjacency.size(), 0.25F)};
  for (std::int32_t i = 0; i < segments.count; ++i) segments.of_supervoxel.push_back(i);
  return segments;
}

}  // namespace

training::Params small_training() {
  training::Params params{.projection = 6};
  params.mixture.components = 2;
  params.draw.clusters = 5;
  params.draw.packets = 3;
  params.relations.samples_per_pair = 50;
  return params;
}

Scene make_scene(const training::Params& params) {
  Scene scene{.cloud = mug()};
  scene.supervoxels = supervoxels::compute(scene.cloud, {.voxel = 0.08, .seed = 0.25});
  scene.segments = one_per_supervoxel(scene.supervoxels);
  scene.descriptors =
      descriptors::compute(scene.cloud, {.channels = {"fpfh:0.3:0.25"}, .threads = 1});
  scene.spectrum = spectra::compute(scene.cloud, {.samples = 30, .eigenpairs = 4});
  const training::View view{scene.cloud, scene.descriptors, scene.spectrum};
  scene.model = training::train({&view, 1}, params);
  const AppearanceModel& appearance = scene.model.appearance;
  scene.encodings = fisher::encode_segments(scene.cloud, scene.descriptors, scene.segments,
                                            appearance, {.clusters = 3, .packets = 2});
  scene.scores = svm::score(scene.encodings, appearance);
  scene.labelling = astar::infer(scene.scores, scene.segments, &scene.spectrum,
                                 &scene.model.relation, {.spatial = astar::Spatial::iso});
  return scene;
}

}  // namespace cosegraph::fuzz
