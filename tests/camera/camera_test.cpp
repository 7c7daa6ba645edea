#include "camera/camera.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cstring>
#include <limits>
#include <optional>

#include "camera/solids.hpp"

namespace cosegraph::camera {
namespace {

using Direction = std::array<double, 3>;
using testing::HasSubstr;

constexpr Pinhole kCamera{.width = 64, .height = 48, .fx = 70, .fy = 60, .cx = 30.3, .cy = 25.1};

Eigen::Vector3d vertex(const Mesh& mesh, std::size_t face, std::size_t corner) {
  const auto v = static_cast<std::size_t>(mesh.face[3 * face + corner]);
  return Eigen::Map<const Eigen::Vector3f>(&mesh.vertex[3 * v]).cast<double>();
}

Eigen::Vector3d apply(const Pose& pose, const Eigen::Vector3d& p) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> r(pose.rotation.data());
  return r * p + Eigen::Map<const Eigen::Vector3d>(pose.translation.data());
}

// Where the line `t ray` meets a triangle, by solving for the barycentric coordinates.
std::optional<double> hit(const Eigen::Vector3d& ray, const std::array<Eigen::Vector3d, 3>& abc) {
  Eigen::Matrix3d system;
  system << abc[0] - abc[1], abc[0] - abc[2], ray;
  const Eigen::Vector3d solution = system.fullPivLu().solve(abc[0]);
  const double b = solution[0];
  const double c = solution[1];
  if (b < 0.0 || c < 0.0 || b + c > 1.0 || solution[2] <= 0.0) return std::nullopt;
  return solution[2];
}

TEST(Cast, AgreesWithTracingEveryRayThroughEveryTriangle) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Mesh mesh = test::triangle_soup(40, seed);
    const Pose pose = look_at({2.5, -1.0, 1.5}, {0, 0, 0}, 0.4);
    const DepthImage image = cast(mesh, kCamera, pose);
    int hits = 0;
    for (std::size_t pixel = 0; pixel < image.depth.size(); ++pixel) {
      const auto column = static_cast<double>(pixel % kCamera.width);
      const auto row = static_cast<double>(pixel / kCamera.width);
      const Eigen::Vector3d ray((column - kCamera.cx) / kCamera.fx, (row - kCamera.cy) / kCamera.fy,
                                1.0);
      double nearest = std::numeric_limits<double>::infinity();
      std::int32_t face = -1;
      for (std::size_t f = 0; f < mesh.face_count(); ++f) {
        const auto depth =
            hit(ray, {apply(pose, vertex(mesh, f, 0)), apply(pose, vertex(mesh, f, 1)),
                      apply(pose, vertex(mesh, f, 2))});
        if (!depth || *depth >= nearest) continue;
        nearest = *depth;
        face = static_cast<std::int32_t>(f);
      }
      ASSERT_EQ(image.face[pixel], face) << pixel;
      if (face < 0) continue;
      EXPECT_NEAR(image.depth[pixel], nearest, 1e-9);
      ++hits;
    }
    EXPECT_GT(hits, 500);
  }
}

TEST(Cast, LabelsDoNotDependOnTheOrderOfFacesEvenWhereTheyCoincide) {
  Mesh mesh = test::triangle_soup(60, 5);
  for (std::int32_t f = 0; f < 30; ++f)  // a twin at the same place with another label
    test::add_triangle(mesh, 3 * f, 3 * f + 1, 3 * f + 2, 59 - f);
  const Pose pose = look_at({3, 1, 1}, {0, 0, 0}, 0.0);
  const DepthImage first = cast(mesh, kCamera, pose);
  const Cloud cloud = to_cloud(first, mesh);
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Mesh other = test::shuffled(mesh, seed);
    const DepthImage again = cast(other, kCamera, pose);
    EXPECT_EQ(again.depth, first.depth);
    EXPECT_EQ(to_cloud(again, other).label, cloud.label);
  }
}

TEST(Cast, AClosedSurfaceHasNoCracks) {
  const Mesh mesh = test::sphere(20);
  const DepthImage outside =
      cast(mesh, {.width = 101, .height = 101, .fx = 200, .fy = 200, .cx = 50, .cy = 50},
           look_at({5, 0, 0}, {0, 0, 0}, 0.0));
  for (int row = 0; row < 101; ++row) {
    for (int column = 0; column < 101; ++column) {
      const bool on_sphere = std::hypot(column - 50, row - 50) < 39.0;
      EXPECT_TRUE(!on_sphere || outside.face[101 * row + column] >= 0) << column << ' ' << row;
    }
  }
}

TEST(Cast, FacesThatAreNotInFrontOfTheCameraAreLeftOut) {
  Mesh mesh;
  mesh.label_names = {"behind", "across", "front"};
  test::add_plate(mesh, {-1, -1, -2}, {2, 0, 0}, {0, 2, 0}, 0);
  test::add_plate(mesh, {0, -1, -1}, {0, 2, 0}, {0, 0, 2}, 1);
  test::add_plate(mesh, {-1, -1, 3}, {2, 0, 0}, {0, 2, 0}, 2);
  const Cloud cloud = to_cloud(cast(mesh, kCamera, {}), mesh);
  EXPECT_THAT(cloud.label, testing::Each(testing::AnyOf(kNoLabel, 2)));
  EXPECT_THAT(cloud.label, testing::Contains(2));
}

TEST(Cast, DegenerateFacesAreNeverHit) {
  Mesh mesh = test::cube();
  const Pose pose = look_at({4, 3, 2}, {0, 0, 0}, 1.0);
  const DepthImage plain = cast(mesh, kCamera, pose);
  const std::int32_t far = test::add_vertex(mesh, {3, 3, 3});
  test::add_triangle(mesh, 0, 0, 5, 0);
  test::add_triangle(mesh, far, far, far, 1);
  const std::int32_t middle = test::add_vertex(mesh, {0, 0, 3});
  const std::int32_t end = test::add_vertex(mesh, {-3, -3, 3});
  test::add_triangle(mesh, far, middle, end, 1);
  const DepthImage image = cast(mesh, kCamera, pose);
  EXPECT_EQ(image.depth, plain.depth);
  EXPECT_EQ(image.face, plain.face);
}

TEST(Cast, ACameraNeedsPixels) {
  EXPECT_THROW(cast(test::cube(), {}, {}), InputError);
  Mesh broken = test::cube();
  broken.face[0] = 1000;
  EXPECT_THROW(cast(broken, kCamera, {}), InputError);
}

TEST(LookAt, TheTargetIsAheadAndTheSkyIsUp) {
  const Pose pose = look_at({3, -2, 1}, {0.5, 0.25, 0}, 0.0);
  const Eigen::Vector3d target = apply(pose, {0.5, 0.25, 0});
  EXPECT_NEAR(target.x(), 0.0, 1e-12);
  EXPECT_NEAR(target.y(), 0.0, 1e-12);
  EXPECT_NEAR(target.z(), std::sqrt(2.5 * 2.5 + 2.25 * 2.25 + 1.0), 1e-12);
  EXPECT_LT(apply(pose, {0.5, 0.25, 0.5}).y(), target.y() - 0.3);
  for (const Direction& eye : {Direction{0, 0, 5}, Direction{0, 0, -5}, Direction{1, 1, 1}}) {
    const Pose any = look_at(eye, {0, 0, 0}, 0.7);
    const Eigen::Map<const Eigen::Matrix3d> r(any.rotation.data());
    EXPECT_TRUE((r * r.transpose()).isIdentity(1e-12));
    EXPECT_NEAR(r.determinant(), 1.0, 1e-12);
  }
}

TEST(Render, PointsLieOnTheSurface) {
  const double radius = 2.5;
  const Mesh mesh = test::sphere(60, radius);
  const Params params{.pitch = 0.02, .distance = 3.0};
  const Cloud cloud = render(mesh, {0.3, -0.5, 0.8}, 1.0, params);
  check_sizes(cloud);
  const double sagitta = radius * (1.0 - std::cos(std::numbers::pi / 60));
  std::size_t seen = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Map<const Eigen::Vector3f> point(&cloud.xyz[3 * i]);
    EXPECT_EQ(point.allFinite(), cloud.label[i] == 0);
    if (!point.allFinite()) continue;
    ++seen;
    const double r = (point.cast<double>() - Eigen::Vector3d(0, 0, 3.0 * radius)).norm();
    EXPECT_LE(r, radius + 1e-5);
    EXPECT_GE(r, radius - 2.0 * sagitta);
  }
  EXPECT_GT(seen, 500U);
}

TEST(Render, RaysAreOnePitchApartInTheMiddleOfTheObject) {
  Mesh mesh;
  mesh.label_names = {"plate"};
  test::add_plate(mesh, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0);
  const Params params{.pitch = 0.02, .distance = 5.0};
  const Cloud cloud = render(mesh, {0, 0, -1}, 0.0, params);
  std::size_t seen = 0;
  for (const std::int32_t label : cloud.label) seen += label == 0 ? 1 : 0;
  EXPECT_NEAR(static_cast<double>(seen), 2500.0, 101.0);  // up to a row and a column of 50
  const std::size_t centre = cloud.size() / 2;
  EXPECT_NEAR(cloud.xyz[3 * (centre + 1)] - cloud.xyz[3 * centre], 0.02 * 2.0, 1e-6);
  EXPECT_NEAR(cloud.xyz[3 * (centre + cloud.width) + 1] - cloud.xyz[3 * centre + 1], 0.04, 1e-6);
}

TEST(Render, RollTurnsTheImageAndNothingElse) {
  const Params params{.pitch = 0.05};
  const Cloud upright = render(test::cube(), {1, 2, 3}, 0.0, params);
  const Cloud turned = render(test::cube(), {1, 2, 3}, std::numbers::pi / 2, params);
  const auto n = upright.width;
  ASSERT_EQ(turned.width, n);
  for (std::uint32_t row = 0; row < n; ++row)
    for (std::uint32_t column = 0; column < n; ++column)
      ASSERT_EQ(turned.label[(n - 1 - column) * n + row], upright.label[row * n + column]);
}

TEST(Render, TheSameBytesForAnyOrderOfFaces) {
  const Mesh mesh = test::sphere(24);
  const Cloud first = render(mesh, {1, 0.2, 0.1}, 0.3, {.pitch = 0.02});
  const Cloud again = render(test::shuffled(mesh, 9), {1, 0.2, 0.1}, 0.3, {.pitch = 0.02});
  ASSERT_EQ(first.xyz.size(), again.xyz.size());
  EXPECT_EQ(std::memcmp(first.xyz.data(), again.xyz.data(), 4 * first.xyz.size()), 0);
}

TEST(Render, AnUnlabelledMeshGivesAnUnlabelledCloud) {
  Mesh mesh = test::cube();
  mesh.face_label.clear();
  mesh.label_names.clear();
  const Cloud cloud = render(mesh, {1, 1, 1}, 0.0, {.pitch = 0.05});
  check_sizes(cloud);
  EXPECT_TRUE(cloud.label.empty());
}

TEST(Render, RefusesWhatHasNoSurfaceOrNoDirection) {
  EXPECT_THROW(render({}, {1, 0, 0}, 0.0, {}), InputError);
  EXPECT_THROW(render(test::cube(), {0, 0, 0}, 0.0, {}), InputError);
  Mesh broken = test::cube();
  broken.vertex[4] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(render(broken, {1, 0, 0}, 0.0, {}), InputError);
  Mesh needle;
  needle.label_names = {"needle"};
  test::add_plate(needle, {0, 0, 0}, {1e4, 0, 0}, {0, 1e-4, 0}, 0);
  try {
    render(needle, {0, 0, 1}, 0.0, {});
    FAIL() << "a needle was rendered";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("too thin"));
  }
}

}  // namespace
}  // namespace cosegraph::camera
