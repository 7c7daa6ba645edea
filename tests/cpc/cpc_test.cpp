#include "cpc/cpc.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <thread>

#include "camera/camera.hpp"
#include "cpc/boundary.hpp"
#include "io/mesh_io.hpp"
#include "source/source.hpp"
#include "supervoxels/supervoxels.hpp"
#include "support/data.hpp"

namespace cosegraph::cpc {
namespace {

// Depth of the nearest of some spheres along every ray of a grid, without their steep rims; label =
// sphere.
struct Sphere {
  double x;
  double radius;
};

Cloud seen(const std::vector<Sphere>& spheres) {
  Cloud cloud;
  for (double x = -0.6; x < 0.6; x += 0.005)
    for (double y = -0.4; y < 0.4; y += 0.005) {
      double nearest = std::numeric_limits<double>::infinity();
      std::int32_t label = kNoLabel;
      for (std::size_t s = 0; s < spheres.size(); ++s) {
        const double squared =
            std::pow(spheres[s].radius, 2) - std::pow(x - spheres[s].x, 2) - y * y;
        if (squared < 0.2 * std::pow(spheres[s].radius, 2) || 3.0 - std::sqrt(squared) >= nearest)
          continue;
        nearest = 3.0 - std::sqrt(squared);
        label = static_cast<std::int32_t>(s);
      }
      if (label == kNoLabel) continue;
      for (const double value : {x, y, nearest}) cloud.xyz.push_back(static_cast<float>(value));
      cloud.label.push_back(label);
    }
  cloud.label_names.assign(spheres.size(), "sphere");
  cloud.width = static_cast<std::uint32_t>(cloud.size());
  return cloud;
}

Cloud snowman() {
  return seen({{-0.18, 0.22}, {0.2, 0.24}});
}

// Fraction of points that carry their segment's most frequent label.
double purity(const std::vector<std::int32_t>& segment, const std::vector<std::int32_t>& label) {
  std::map<std::int32_t, std::map<std::int32_t, int>> votes;
  for (std::size_t i = 0; i < segment.size(); ++i) ++votes[segment[i]][label[i]];
  double right = 0.0;
  for (const auto& [id, counts] : votes)
    right += std::ranges::max_element(counts, {}, [](const auto& at) { return at.second; })->second;
  return right / static_cast<double>(segment.size());
}

TEST(Cuts, PartTwoSpheresWhereTheyMeet) {
  const Cloud cloud = snowman();
  const auto supervoxels = supervoxels::compute(cloud, {});
  const Segments segments = compute(supervoxels, {});
  EXPECT_EQ(segments.count, 2);
  EXPECT_GT(purity(segments.of_point, cloud.label), 0.96);
  ASSERT_EQ(segments.adjacency.size(), 1U);
  EXPECT_GT(segments.concavity[0], 0.9F);
}

TEST(Cuts, LeaveAConvexShapeWhole) {
  const auto supervoxels = supervoxels::compute(seen({{0.0, 0.35}}), {});
  const Segments segments = compute(supervoxels, {});
  EXPECT_EQ(segments.count, 1);
  EXPECT_TRUE(segments.adjacency.empty());
}

TEST(Cuts, AreNotMadeWhereNoneAreAllowed) {
  Params params;
  params.max_cuts = 0;
  params.concavity_tolerance = 180.0;  // every edge counts as convex
  params.sanity_check = false;
  EXPECT_EQ(compute(supervoxels::compute(snowman(), {}), params).count, 1);
}

TEST(Segments, AreConsistentWithTheirSupervoxels) {
  const auto supervoxels = supervoxels::compute(seen({{-0.3, 0.2}, {0.05, 0.22}, {0.4, 0.19}}), {});
  const Segments segments = compute(supervoxels, {});
  ASSERT_EQ(segments.of_supervoxel.size(), supervoxels.count());
  ASSERT_EQ(segments.of_point.size(), supervoxels.of_point.size());
  std::int32_t next = 0;
  for (const std::int32_t id : segments.of_supervoxel) {
    ASSERT_LE(id, next) << "ids are not in the order of their first supervoxel";
    next = std::max(next, id + 1);
  }
  EXPECT_EQ(next, segments.count);
  for (std::size_t i = 0; i < segments.of_point.size(); ++i)
    ASSERT_EQ(segments.of_point[i], segments.of_supervoxel[supervoxels.of_point[i]]);
  const auto boundaries = boundaries_of(supervoxels, segments.of_supervoxel);
  ASSERT_EQ(segments.adjacency.size(), boundaries.size());
  ASSERT_EQ(segments.concavity.size(), boundaries.size());
  for (std::size_t i = 0; i < boundaries.size(); ++i) {
    EXPECT_EQ(segments.adjacency[i][0], boundaries[i].a);
    EXPECT_EQ(segments.adjacency[i][1], boundaries[i].b);
    EXPECT_FLOAT_EQ(segments.concavity[i], static_cast<float>(boundaries[i].score()));
  }
}

TEST(Segments, DoNotDependOnTheUnitOfLength) {
  auto supervoxels = supervoxels::compute(snowman(), {});
  const Segments metres = compute(supervoxels, {});
  for (float& value : supervoxels.centroid) value *= 1024.0F;
  supervoxels.seed_resolution *= 1024.0F;
  const Segments larger = compute(supervoxels, {});
  EXPECT_EQ(larger.of_supervoxel, metres.of_supervoxel);
}

// PCL's RANSAC and graph are shared by no two calls; its graph nodes lie at other addresses in
// every call, which must not show.
TEST(Segments, AreTheSameBytesFromEveryThread) {
  const auto supervoxels = supervoxels::compute(seen({{-0.3, 0.2}, {0.05, 0.22}, {0.4, 0.19}}), {});
  for (const Merge merge : {Merge::concavity, Merge::size}) {
    Params params;
    params.merge = merge;
    const Segments once = compute(supervoxels, params);
    std::vector<Segments> again(6);
    std::vector<std::thread> threads;
    for (auto& result : again) threads.emplace_back([&] { result = compute(supervoxels, params); });
    for (auto& thread : threads) thread.join();
    for (const auto& result : again) {
      EXPECT_EQ(result.of_supervoxel, once.of_supervoxel);
      EXPECT_EQ(result.adjacency, once.adjacency);
      EXPECT_EQ(result.concavity, once.concavity);
    }
  }
}

TEST(Segments, OfOneSupervoxelAreOne) {
  const Supervoxels single{.of_point = {0, 0},
                           .centroid = {0, 0, 1},
                           .normal = {0, 0, -1},
                           .point_count = {2},
                           .seed_resolution = 0.05F};
  const Segments segments = compute(single, {});
  EXPECT_EQ(segments.count, 1);
  EXPECT_THAT(segments.of_point, testing::ElementsAre(0, 0));
}

TEST(Segments, RefuseSupervoxelsThatDoNotFitTogether) {
  const auto good = supervoxels::compute(snowman(), {});
  EXPECT_THROW(compute({}, {}), InputError);
  auto damaged = good;
  damaged.seed_resolution = 0.0F;
  EXPECT_THROW(compute(damaged, {}), InputError);
  damaged = good;
  damaged.adjacency.push_back({0, static_cast<std::int32_t>(good.count())});
  EXPECT_THROW(compute(damaged, {}), InputError);
  damaged = good;
  damaged.normal.pop_back();
  EXPECT_THROW(compute(damaged, {}), InputError);
  damaged = good;
  damaged.centroid[4] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(compute(damaged, {}), InputError);
  damaged = good;
  damaged.centroid[4] = 1e20F;
  EXPECT_THROW(compute(damaged, {}), InputError);
  damaged = good;
  damaged.seed_resolution = 1e-30F;
  EXPECT_THROW(compute(damaged, {}), InputError);
  damaged = good;
  damaged.of_point[0] = -1;
  EXPECT_THROW(compute(damaged, {}), InputError);
  Params params;
  EXPECT_THROW(set_field(describe(params), "merge", {"largest"}), ParameterError);
}

// The best any labelling of whole segments can reach, which bounds the accuracy of the method.
TEST(Segments, FollowThePartsOfBenchmarkShapes) {
  double by_concavity = 0.0;
  double by_size = 0.0;
  int views = 0;
  for (const char* name : {"lpsb/Teddy/161", "lpsb/Ant/81", "lpsb/Chair/101"}) {
    const std::string mesh_file = std::string(name) + ".off";
    COSEGRAPH_NEEDS_DATA(mesh_file);
    Mesh mesh = io::read_mesh(test::data_folder() / mesh_file);
    io::read_labels(test::data_folder() / (std::string(name) + "_labels.txt"), mesh);
    for (const auto& direction : {std::array{0.6, 0.5, 0.62}, std::array{-0.5, 0.7, -0.5}}) {
      const Cloud dense = source::prepare(camera::render(mesh, direction, 0.2, {}), {}, {}).dense;
      const auto supervoxels = supervoxels::compute(dense, {});
      Params params;
      by_concavity += purity(compute(supervoxels, params).of_point, dense.label);
      params.merge = Merge::size;
      by_size += purity(compute(supervoxels, params).of_point, dense.label);
      ++views;
    }
  }
  EXPECT_GT(by_concavity / views, 0.92);
  EXPECT_GT(by_concavity, by_size);
}

}  // namespace
}  // namespace cosegraph::cpc
