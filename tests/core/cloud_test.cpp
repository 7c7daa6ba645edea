#include "core/cloud.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "core/random.hpp"
#include "core/values.hpp"

namespace cosegraph {
namespace {

using ::testing::ThrowsMessage;

// Four points with everything.
Cloud full_cloud() {
  return {.xyz = std::vector<float>(12, 0.5F),
          .normal = std::vector<float>(12, 0.0F),
          .rgb = std::vector<float>(12, 1.0F),
          .label = {0, 1, kNoLabel, 1},
          .label_names = {"body", "handle"},
          .dense_index = {3, 2, 1, kNoPoint},
          .width = 2,
          .height = 2};
}

void expect_refused(const std::function<void(Cloud&)>& damage, const std::string& message) {
  Cloud cloud = full_cloud();
  damage(cloud);
  EXPECT_THAT([&] { check_sizes(cloud); }, ThrowsMessage<InputError>(message));
}

// A box with its corner at the origin, two triangles a side, counter-clockwise from outside.
Mesh box(float x, float y, float z) {
  Mesh mesh;
  for (int corner = 0; corner < 8; ++corner)
    for (const float value : {corner & 1 ? x : 0.0F, corner & 2 ? y : 0.0F, corner & 4 ? z : 0.0F})
      mesh.vertex.push_back(value);
  mesh.face = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
               2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
  return mesh;
}

// Regular tetrahedron of edge length 2 sqrt(2).
Mesh tetrahedron() {
  return {.vertex = {1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1},
          .face = {0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2}};
}

// Unit sphere, `rings` x 2 `rings` quadrilaterals of latitude and longitude.
Mesh sphere(int rings) {
  Mesh mesh;
  const int sectors = 2 * rings;
  for (int r = 0; r <= rings; ++r) {
    for (int s = 0; s < sectors; ++s) {
      const double polar = std::numbers::pi * r / rings;
      const double around = 2.0 * std::numbers::pi * s / sectors;
      for (const double value : {std::sin(polar) * std::cos(around),
                                 std::sin(polar) * std::sin(around), std::cos(polar)})
        mesh.vertex.push_back(static_cast<float>(value));
    }
  }
  for (int r = 0; r < rings; ++r) {
    for (int s = 0; s < sectors; ++s) {
      const int next = (s + 1) % sectors;
      const int upper = r * sectors;
      const int lower = upper + sectors;
      for (const int v :
           {upper + s, lower + s, lower + next, upper + s, lower + next, upper + next})
        mesh.face.push_back(v);
    }
  }
  return mesh;
}

TEST(CheckSizes, AcceptsCloudsThatFit) {
  EXPECT_NO_THROW(check_sizes(full_cloud()));
  EXPECT_NO_THROW(check_sizes(Cloud{}));
  EXPECT_NO_THROW(check_sizes(Cloud{.xyz = {NAN, NAN, NAN}, .width = 1}));
  EXPECT_EQ(full_cloud().size(), 4U);
}

TEST(CheckSizes, RefusesCloudsThatDoNotFit) {
  expect_refused([](Cloud& c) { c.xyz.pop_back(); },
                 "the number of coordinates is not a multiple of 3");
  expect_refused([](Cloud& c) { c.normal.pop_back(); }, "normals do not fit points");
  expect_refused([](Cloud& c) { c.rgb.resize(15); }, "colours do not fit points");
  expect_refused([](Cloud& c) { c.dense_index.resize(3); }, "dense_index does not fit points");
  expect_refused([](Cloud& c) { c.width = 4; }, "width x height is not the number of points");
  expect_refused([](Cloud& c) { c.label.resize(5); }, "5 labels for 4 points");
  expect_refused([](Cloud& c) { c.label_names.clear(); },
                 "labels without names, or names without labels");
  expect_refused([](Cloud& c) { c.label.clear(); },
                 "labels without names, or names without labels");
  expect_refused([](Cloud& c) { c.label[2] = 2; }, "label 2 has no name");
  expect_refused([](Cloud& c) { c.label[0] = -2; }, "label -2 has no name");
}

// 65536 x 65536 is 0 in 32 bits.
TEST(CheckSizes, DoesNotOverflowOnHugeGrids) {
  EXPECT_THROW(check_sizes(Cloud{.width = 65536, .height = 65536}), InputError);
}

TEST(CheckSizes, AcceptsMeshesThatFit) {
  Mesh mesh = box(1, 2, 3);
  EXPECT_NO_THROW(check_sizes(mesh));
  EXPECT_EQ(mesh.vertex_count(), 8U);
  EXPECT_EQ(mesh.face_count(), 12U);
  mesh.face_label.assign(12, 0);
  mesh.label_names = {"side"};
  EXPECT_NO_THROW(check_sizes(mesh));
  EXPECT_NO_THROW(check_sizes(Mesh{}));
}

TEST(CheckSizes, RefusesMeshesThatDoNotFit) {
  const auto expect_mesh_refused = [](const std::function<void(Mesh&)>& damage,
                                      const std::string& message) {
    Mesh mesh = tetrahedron();
    mesh.face_label.assign(4, 0);
    mesh.label_names = {"side"};
    damage(mesh);
    EXPECT_THAT([&] { check_sizes(mesh); }, ThrowsMessage<InputError>(message));
  };
  expect_mesh_refused([](Mesh& m) { m.vertex.pop_back(); },
                      "the number of coordinates is not a multiple of 3");
  expect_mesh_refused([](Mesh& m) { m.face.pop_back(); },
                      "the number of face corners is not a multiple of 3");
  expect_mesh_refused([](Mesh& m) { m.face[7] = 4; }, "face 2 names vertex 4 of 4");
  expect_mesh_refused([](Mesh& m) { m.face[0] = -1; }, "face 0 names vertex -1 of 4");
  expect_mesh_refused([](Mesh& m) { m.face_label.resize(3); }, "3 labels for 4 faces");
  expect_mesh_refused([](Mesh& m) { m.face_label[1] = 1; }, "label 1 has no name");
}

TEST(SurfaceArea, IsThatOfKnownSolids) {
  EXPECT_DOUBLE_EQ(surface_area(box(1, 1, 1)), 6.0);
  EXPECT_DOUBLE_EQ(surface_area(box(2, 3, 4)), 52.0);
  EXPECT_NEAR(surface_area(tetrahedron()), 8.0 * std::sqrt(3.0), 1e-12);
}

// Heron's formula needs no vectors: an independent way to the area of a triangle.
TEST(SurfaceArea, EqualsHeronsFormula) {
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    Mesh mesh{.vertex = std::vector<float>(9), .face = {0, 1, 2}};
    for (float& value : mesh.vertex) value = static_cast<float>(random.uniform(-1.0, 1.0));
    const auto side = [&](int a, int b) {
      double squared = 0.0;
      for (int axis = 0; axis < 3; ++axis)
        squared += std::pow(double{mesh.vertex[3 * a + axis]} - mesh.vertex[3 * b + axis], 2.0);
      return std::sqrt(squared);
    };
    const double a = side(0, 1);
    const double b = side(1, 2);
    const double c = side(2, 0);
    const double half = (a + b + c) / 2.0;
    EXPECT_NEAR(surface_area(mesh), std::sqrt(half * (half - a) * (half - b) * (half - c)), 1e-7);
  }
}

TEST(SurfaceArea, ApproachesTheSphereFromBelow) {
  const double exact = 4.0 * std::numbers::pi;
  const double coarse = surface_area(sphere(20));
  const double fine = surface_area(sphere(40));
  EXPECT_LT(coarse, fine);
  EXPECT_LT(fine, exact);
  EXPECT_NEAR((exact - coarse) / (exact - fine), 4.0, 0.1);  // second order
}

TEST(SurfaceArea, GrowsWithTheSquareOfTheSize) {
  Mesh mesh = sphere(10);
  const double area = surface_area(mesh);
  for (float& value : mesh.vertex) value *= 4.0F;
  EXPECT_NEAR(surface_area(mesh), 16.0 * area, 1e-9 * area);
}

TEST(SurfaceArea, OfNothingAndOfDegenerateFacesIsZero) {
  EXPECT_EQ(surface_area(Mesh{}), 0.0);
  EXPECT_EQ(surface_area(Mesh{.vertex = {1, 2, 3, 4, 5, 6}, .face = {0, 0, 1, 1, 1, 1}}), 0.0);
}

TEST(PairIndex, NumbersUnorderedPairsWithoutGaps) {
  constexpr std::size_t kLabels = 7;
  std::vector<int> seen(kLabels * (kLabels + 1) / 2, 0);
  for (std::size_t a = 0; a < kLabels; ++a) {
    for (std::size_t b = 0; b <= a; ++b) {
      EXPECT_EQ(pair_index(a, b), pair_index(b, a));
      ++seen.at(pair_index(a, b));
    }
  }
  for (const int count : seen) EXPECT_EQ(count, 1);
}

}  // namespace
}  // namespace cosegraph
