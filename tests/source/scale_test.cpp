#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <numbers>

#include "camera/camera.hpp"
#include "io/mesh_io.hpp"
#include "source/shapes.hpp"
#include "source/source.hpp"
#include "support/data.hpp"

namespace cosegraph::source {
namespace {

using test::board;
using test::half_sphere;
using Xyz = std::vector<float>;

Xyz moved(const Xyz& xyz, const Eigen::Affine3f& motion) {
  Xyz result(xyz.size());
  for (std::size_t i = 0; i < xyz.size(); i += 3)
    Eigen::Map<Eigen::Vector3f>{&result[i]} = motion * Eigen::Map<const Eigen::Vector3f>{&xyz[i]};
  return result;
}

Eigen::Affine3f random_rotation(std::uint64_t seed) {
  Random random(seed);
  const auto component = [&random] { return static_cast<float>(random.normal()); };
  Eigen::Quaternionf turn(component(), component(), component(), component());
  return Eigen::Affine3f(turn.normalized());
}

Xyz thinned(const Xyz& xyz, const std::function<double(const float*)>& probability) {
  Random random(5);
  Xyz result;
  for (std::size_t i = 0; i < xyz.size(); i += 3)
    if (random.uniform() < probability(&xyz[i])) result.insert(result.end(), &xyz[i], &xyz[i] + 3);
  return result;
}

// A bent body: two spheres and a board, seen from one side.
Xyz body() {
  Cloud cloud = half_sphere(8000, 0.25, 2.0);
  Cloud arm = half_sphere(2000, 0.12, 2.0);
  for (std::size_t i = 0; i < arm.size(); ++i) arm.xyz[3 * i] += 0.37F;
  return test::joined(test::joined(cloud, arm), board(70, 0.4, 0.9, 2.3)).xyz;
}

class ByRule : public ::testing::TestWithParam<ScaleRule> {
 protected:
  static double scale(const Xyz& xyz) { return estimate_scale(xyz, GetParam()); }
};

TEST_P(ByRule, FollowsTheUnitOfLength) {
  const Xyz xyz = body();
  const Xyz millimetres = moved(xyz, Eigen::Affine3f(Eigen::Scaling(1000.0F)));
  EXPECT_NEAR(scale(millimetres) / scale(xyz), 1000.0, 10.0);
}

TEST_P(ByRule, DoesNotDependOnWhereTheObjectIs) {
  const Xyz xyz = body();
  const Xyz far = moved(xyz, Eigen::Affine3f(Eigen::Translation3f(4.0F, -3.0F, 8.0F)));
  EXPECT_NEAR(scale(far) / scale(xyz), 1.0, 0.005);
}

TEST_P(ByRule, DoesNotDependOnTheObjectsTurn) {
  const Xyz xyz = body();
  for (std::uint64_t seed = 1; seed <= 8; ++seed)
    EXPECT_NEAR(scale(moved(xyz, random_rotation(seed))) / scale(xyz), 1.0, 0.04) << seed;
}

TEST_P(ByRule, DoesNotDependOnTheDensity) {
  const Xyz xyz = body();
  const Xyz sparse = thinned(xyz, [](const float*) { return 0.3; });
  const Xyz uneven = thinned(xyz, [](const float* p) { return p[0] < 0.0F ? 1.0 : 0.3; });
  EXPECT_NEAR(scale(sparse) / scale(xyz), 1.0, 0.06);
  EXPECT_NEAR(scale(uneven) / scale(xyz), 1.0, 0.06);
}

TEST_P(ByRule, DoesNotDependOnTheOrderOfThePoints) {
  const Xyz xyz = body();
  Xyz reversed;
  for (std::size_t i = xyz.size(); i > 0; i -= 3)
    reversed.insert(reversed.end(), &xyz[i - 3], &xyz[i - 3] + 3);
  EXPECT_NEAR(scale(reversed) / scale(xyz), 1.0, 1e-6);
}

TEST_P(ByRule, WithstandsNoiseAndOutliers) {
  const Xyz xyz = body();
  const Xyz noisy = test::with_noise({.xyz = xyz}, 0.004, 1).xyz;
  Xyz spoiled = xyz;
  Random random(2);
  for (std::size_t i = 0; i < xyz.size() / 3 / 100; ++i)
    for (const double low : {-0.5, -0.5, 1.5})
      spoiled.push_back(static_cast<float>(random.uniform(low, low + 1.0)));
  EXPECT_NEAR(scale(noisy) / scale(xyz), 1.0, 0.05);
  EXPECT_NEAR(scale(spoiled) / scale(xyz), 1.0, 0.1);
}

TEST_P(ByRule, RefusesPointsWithoutExtent) {
  EXPECT_THROW(scale({}), InputError);
  const Xyz same(300, 1.5F);
  EXPECT_THROW(scale(same), InputError);
}

INSTANTIATE_TEST_SUITE_P(Scale, ByRule, ::testing::Values(ScaleRule::area, ScaleRule::extent),
                         [](const auto& rule) { return std::string(to_name(rule.param)); });

TEST(ScaleByArea, IsProportionalToTheRootOfTheVisibleArea) {
  // sqrt(area): the sphere shows 2 pi r^2, the boards e^2 whatever their tilt.
  const double sphere = estimate_scale(half_sphere(10000, 0.3, 2.0).xyz, ScaleRule::area) /
                        (0.3 * std::sqrt(2.0 * std::numbers::pi));
  for (const double tilt : {0.0, 0.5, 1.0}) {
    const double flat = estimate_scale(board(100, 0.5, tilt, 2.0).xyz, ScaleRule::area) / 0.5;
    EXPECT_NEAR(flat / sphere, 1.0, 0.08) << tilt;
  }
}

TEST(ScaleByExtent, IsProportionalToTheNinetiethPercentile) {
  // Distances to the centroid of a half sphere's shell: with the depth t uniform in [0, 1] and the
  // centroid at t = 1/2 they are sqrt(5/4 - t), so 90 % are below sqrt(5/4 - 1/10) r.
  const double percentile = std::sqrt(1.15);
  const double sphere = estimate_scale(half_sphere(10000, 0.3, 2.0).xyz, ScaleRule::extent) / 0.3;
  const Cloud line = [] {
    Cloud cloud;  // 90 % of a uniform rod lie within 0.45 of its middle
    for (int i = 0; i < 5000; ++i) test::add_point(cloud, (i + 0.5) / 5000.0, 0.0, 2.0);
    return cloud;
  }();
  EXPECT_NEAR(estimate_scale(line.xyz, ScaleRule::extent) / sphere, 0.45 / percentile, 0.02);
}

TEST(FixedScale, IsOneInTheInputsUnit) {
  EXPECT_EQ(estimate_scale(body(), ScaleRule::fixed), 1.0);
}

TEST(ScaleRuleNames, RoundTrip) {
  for (const auto rule : {ScaleRule::area, ScaleRule::extent, ScaleRule::fixed})
    EXPECT_EQ(from_name<ScaleRule>(to_name(rule)), rule);
  EXPECT_THROW(from_name<ScaleRule>("volume"), ParameterError);
}

// The constants are calibrated so that views of benchmark shapes come out near the root of the
// full mesh's area.
TEST(ScaleByArea, IsNearTheRootOfTheMeshAreaOnTheBenchmark) {
  double log_sum = 0.0;
  int views = 0;
  for (const char* name : {"lpsb/FourLeg/381", "lpsb/Hand/181", "lpsb/Table/141"}) {
    const std::string mesh_file = std::string(name) + ".off";
    COSEGRAPH_NEEDS_DATA(mesh_file);
    const Mesh mesh = io::read_mesh(test::data_folder() / mesh_file);
    for (const auto& direction : camera::fibonacci_directions(5)) {
      const Cloud view = finite_points(camera::render(mesh, direction, 0.3, {}));
      const double scale = estimate_scale(view.xyz, ScaleRule::area);
      log_sum += std::log(scale / std::sqrt(surface_area(mesh)));
      ++views;
    }
  }
  EXPECT_NEAR(std::exp(log_sum / views), 1.0, 0.1);
}

}  // namespace
}  // namespace cosegraph::source
