#include "supervoxels/supervoxels.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <thread>

#include "core/random.hpp"

namespace cosegraph::supervoxels {
namespace {

using ::testing::Each;
using ::testing::Eq;
using ::testing::IsEmpty;

constexpr double kSpacing = 0.005;

void add_point(Cloud& cloud, double x, double y, double z) {
  for (const double value : {x, y, z}) cloud.xyz.push_back(static_cast<float>(value));
  cloud.width = static_cast<std::uint32_t>(cloud.size());
}

// A strip of the plane z = 2 + slope |x|, x in [begin, end], y in [0, width], jittered a little.
void add_strip(Cloud& cloud, double begin, double end, double width, double slope) {
  Random random(cloud.size() + 1);
  for (double x = begin + kSpacing / 2.0; x < end; x += kSpacing)
    for (double y = kSpacing / 2.0; y < width; y += kSpacing) {
      const double at = x + random.uniform(-1e-3, 1e-3);
      add_point(cloud, at, y + random.uniform(-1e-3, 1e-3), 2.0 + slope * std::abs(at));
    }
}

Cloud flat() {
  Cloud cloud;
  add_strip(cloud, -0.3, 0.3, 0.4, 0.0);
  return cloud;
}

// A roof whose ridge is nearest to the sensor.
Cloud roof() {
  Cloud cloud;
  add_strip(cloud, -0.3, 0.3, 0.4, 1.0);
  return cloud;
}

Supervoxels computed(const Cloud& cloud) {
  return compute(cloud, {});
}

void expect_consistent(const Supervoxels& result, const Cloud& cloud) {
  const auto count = static_cast<std::int32_t>(result.count());
  ASSERT_EQ(result.of_point.size(), cloud.size());
  ASSERT_EQ(result.normal.size(), result.centroid.size());
  ASSERT_EQ(result.point_count.size(), result.count());
  std::vector<std::int32_t> points(result.count(), 0);
  std::int32_t next = 0;
  for (const std::int32_t id : result.of_point) {
    ASSERT_GE(id, 0);
    ASSERT_LE(id, next) << "ids are not in the order of their first point";
    next = std::max(next, id + 1);
    ++points[id];
  }
  EXPECT_EQ(next, count);
  EXPECT_EQ(points, result.point_count);
  EXPECT_TRUE(std::ranges::is_sorted(result.adjacency));
  EXPECT_EQ(std::ranges::adjacent_find(result.adjacency), result.adjacency.end());
  for (const auto& [a, b] : result.adjacency) {
    EXPECT_LT(a, b);
    EXPECT_GE(a, 0);
    EXPECT_LT(b, count);
  }
  for (std::size_t i = 0; i < result.normal.size(); i += 3) {
    const float* n = &result.normal[i];
    const float* c = &result.centroid[i];
    EXPECT_NEAR(std::hypot(n[0], n[1], n[2]), 1.0, 1e-5);
    double toward = 0.0;
    for (int axis = 0; axis < 3; ++axis) toward += n[axis] * (cloud.origin[axis] - c[axis]);
    EXPECT_GE(toward, 0.0);
  }
}

TEST(Supervoxels, PartitionThePointsConsistently) {
  for (const Cloud& cloud : {flat(), roof()}) expect_consistent(computed(cloud), cloud);
}

TEST(Supervoxels, HaveAboutTheSizeOfTheSeedDistance) {
  const Cloud cloud = flat();
  const Supervoxels result = computed(cloud);
  const double expected = 0.6 * 0.4 / std::pow(Params{}.seed, 2);
  EXPECT_GT(result.count(), 0.7 * expected);
  EXPECT_LT(result.count(), 1.6 * expected);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const std::size_t id = result.of_point[i];
    const double distance = std::hypot(cloud.xyz[3 * i] - result.centroid[3 * id],
                                       cloud.xyz[3 * i + 1] - result.centroid[3 * id + 1]);
    ASSERT_LT(distance, 1.5 * Params{}.seed);
  }
}

TEST(Supervoxels, OfAPlaneHaveItsNormal) {
  const Supervoxels result = computed(flat());
  for (std::size_t i = 0; i < result.normal.size(); i += 3)
    EXPECT_NEAR(result.normal[i + 2], -1.0, 1e-4);
}

TEST(Supervoxels, RespectACrease) {
  const Cloud cloud = roof();
  const Supervoxels result = computed(cloud);
  std::vector<std::array<int, 2>> sides(result.count());
  for (std::size_t i = 0; i < cloud.size(); ++i)
    ++sides[result.of_point[i]][cloud.xyz[3 * i] < 0.0F ? 0 : 1];
  int minority = 0;
  for (const auto& [left, right] : sides) minority += std::min(left, right);
  EXPECT_LT(minority, 0.03 * static_cast<double>(cloud.size()));
}

TEST(Supervoxels, AreNotAdjacentAcrossAGap) {
  Cloud cloud;
  add_strip(cloud, -0.3, -0.05, 0.4, 0.0);
  const std::size_t left = cloud.size();
  add_strip(cloud, 0.05, 0.3, 0.4, 0.0);
  const Supervoxels result = computed(cloud);
  const auto first_right = *std::ranges::min_element(
      result.of_point.begin() + static_cast<std::ptrdiff_t>(left), result.of_point.end());
  for (std::size_t i = 0; i < left; ++i) ASSERT_LT(result.of_point[i], first_right);
  for (const auto& [a, b] : result.adjacency) EXPECT_EQ(a < first_right, b < first_right);
}

TEST(Supervoxels, OfOneSurfaceAreConnected) {
  const Supervoxels result = computed(roof());
  std::set<std::int32_t> reached{0};
  for (bool grown = true; grown;) {
    grown = false;
    for (const auto& [a, b] : result.adjacency)
      if (reached.contains(a) != reached.contains(b)) {
        reached.insert({a, b});
        grown = true;
      }
  }
  EXPECT_EQ(reached.size(), result.count());
}

TEST(Supervoxels, SparseInPlacesAreLinkedToTheirSurface) {
  Cloud cloud = flat();
  const std::size_t surface = cloud.size();
  add_point(cloud, 0.3 + 0.025, 0.2, 2.0);  // two voxels off the rim
  add_point(cloud, 0.3 + 0.5, 0.2, 2.0);    // far away
  const Supervoxels result = computed(cloud);
  const std::int32_t near = result.of_point[surface];
  const std::int32_t far = result.of_point[surface + 1];
  ASSERT_EQ(result.point_count[near], 1);
  ASSERT_EQ(result.point_count[far], 1);
  const auto links = [&](std::int32_t id) {
    return std::ranges::count_if(result.adjacency,
                                 [id](auto pair) { return pair[0] == id || pair[1] == id; });
  };
  EXPECT_EQ(links(near), 1);
  EXPECT_EQ(links(far), 0);
  expect_consistent(result, cloud);
}

TEST(Supervoxels, DoNotDependOnTheUnitOfLength) {
  const Cloud metres = roof();
  Cloud larger = metres;
  larger.scale = 1024.0F;  // a power of two: exact
  for (float& value : larger.xyz) value *= 1024.0F;
  EXPECT_EQ(computed(larger).of_point, computed(metres).of_point);
  EXPECT_EQ(computed(larger).adjacency, computed(metres).adjacency);
}

TEST(Supervoxels, LookToTheSensorWhereverItIs) {
  Cloud moved = roof();
  moved.origin = {0.5F, -2.0F, 6.0F};  // now behind the roof
  const Supervoxels result = computed(moved);
  expect_consistent(result, moved);
  for (std::size_t i = 0; i < result.normal.size(); i += 3) EXPECT_GT(result.normal[i + 2], 0.0F);
}

TEST(Supervoxels, FollowColoursIfTheyWeigh) {
  Cloud cloud = flat();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const float shade = std::sin(40.0F * cloud.xyz[3 * i]) > 0.0F ? 1.0F : 0.0F;
    cloud.rgb.insert(cloud.rgb.end(), {shade, 0.0F, 0.0F});
  }
  const auto mixed_points = [&](double color_weight) {
    Params params;
    params.color_weight = color_weight;
    const Supervoxels result = compute(cloud, params);
    std::vector<std::array<int, 2>> shades(result.count());
    for (std::size_t i = 0; i < cloud.size(); ++i)
      ++shades[result.of_point[i]][cloud.rgb[3 * i] > 0.5F ? 1 : 0];
    int mixed = 0;
    for (const auto& [dark, light] : shades) mixed += std::min(dark, light);
    return mixed;
  };
  EXPECT_LT(2 * mixed_points(5.0), mixed_points(0.0));
}

TEST(Supervoxels, AreTheSameBytesFromEveryThread) {
  const Cloud cloud = roof();
  const Supervoxels once = computed(cloud);
  std::vector<Supervoxels> again(4);
  std::vector<std::thread> threads;
  for (auto& result : again) threads.emplace_back([&result, &cloud] { result = computed(cloud); });
  for (auto& thread : threads) thread.join();
  for (const auto& result : again) {
    EXPECT_EQ(result.of_point, once.of_point);
    EXPECT_EQ(result.centroid, once.centroid);
    EXPECT_EQ(result.normal, once.normal);
    EXPECT_EQ(result.adjacency, once.adjacency);
  }
}

TEST(Supervoxels, OfASinglePointAreOneThatLooksToTheSensor) {
  Cloud cloud;
  add_point(cloud, 0.0, 0.0, 2.0);
  const Supervoxels result = computed(cloud);
  EXPECT_THAT(result.of_point, Each(Eq(0)));
  EXPECT_THAT(result.adjacency, IsEmpty());
  expect_consistent(result, cloud);
}

TEST(Supervoxels, RefuseCloudsTheyCannotWorkOn) {
  EXPECT_THROW(computed({}), InputError);
  Cloud damaged = flat();
  damaged.xyz[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(computed(damaged), InputError);
  damaged = flat();
  damaged.scale = 0.0F;
  EXPECT_THROW(computed(damaged), InputError);
  damaged = flat();
  damaged.xyz[7] = 1e20F;  // PCL would number voxels up to there
  EXPECT_THROW(computed(damaged), InputError);
  damaged = flat();
  damaged.scale = 1e-20F;
  EXPECT_THROW(computed(damaged), InputError);
  Params params;
  params.seed = 0.01;
  EXPECT_THROW(compute(flat(), params), ParameterError);
  EXPECT_THROW(set_field(describe(params), "voxel", {"0"}), ParameterError);
}

}  // namespace
}  // namespace cosegraph::supervoxels
