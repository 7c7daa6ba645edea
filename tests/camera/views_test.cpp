#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "camera/camera.hpp"
#include "camera/solids.hpp"

namespace cosegraph::camera {
namespace {

using Direction = std::array<double, 3>;
using testing::ElementsAre;

double cosine(const Direction& a, const Direction& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

TEST(VisibleFractions, ASphereShowsTheCapThatTheTangentConeCutsOff) {
  const Mesh mesh = test::sphere(60);
  const auto directions = fibonacci_directions(20);
  for (const double distance : {1.5, 2.0, 4.0, 50.0}) {
    const double exact = 0.5 * (1.0 - 1.0 / distance);
    double mean = 0.0;
    for (const Direction& direction : directions) {
      const double visible = visible_fractions(mesh, direction, {.distance = distance})[0];
      EXPECT_NEAR(visible, exact, 0.025) << distance;
      mean += visible / static_cast<double>(directions.size());
    }
    EXPECT_NEAR(mean, exact, 0.01) << distance;
  }
}

TEST(VisibleFractions, ManyFacesPerPixelCountAsOften) {
  // About 60 000 faces of a sphere, a third of a pixel each.
  const Mesh mesh = test::sphere(122);
  EXPECT_NEAR(visible_fractions(mesh, {0.5, 0.5, 0.7}, {})[0], 0.375, 0.02);
}

TEST(VisibleFractions, ACubeShowsThreeSidesFromACornerAndOneFromAFace) {
  const auto near_one = testing::DoubleNear(1.0, 0.02);
  const auto corner = visible_fractions(test::cube(), {1, -1, 1}, {.distance = 10.0});
  EXPECT_THAT(corner, ElementsAre(0.0, near_one, near_one, 0.0, 0.0, near_one));
  const auto face = visible_fractions(test::cube(), {0, -1, 0}, {.distance = 10.0});
  EXPECT_THAT(face, ElementsAre(0.0, 0.0, near_one, 0.0, 0.0, 0.0));
}

// A plate of 2 x 2 and, `gap` behind it, one of 1 x 1; seen along -z.
Mesh plate_before_plate(double shift) {
  Mesh mesh;
  mesh.label_names = {"front", "back", "no face"};
  test::add_plate(mesh, {-1, -1, 1}, {2, 0, 0}, {0, 2, 0}, 0);
  test::add_plate(mesh, {-0.5 + shift, -0.5, 0.9}, {1, 0, 0}, {0, 1, 0}, 1);
  return mesh;
}

TEST(VisibleFractions, WhatIsBehindSomethingIsNotSeen) {
  const Params params{.distance = 100.0};
  EXPECT_THAT(visible_fractions(plate_before_plate(0.0), {0, 0, 1}, params),
              ElementsAre(testing::DoubleNear(1.0, 0.02), 0.0, 0.0));
  EXPECT_THAT(visible_fractions(plate_before_plate(1.0), {0, 0, 1}, params),
              ElementsAre(testing::DoubleNear(1.0, 0.02), testing::DoubleNear(0.5, 0.02), 0.0));
  const auto from_behind = visible_fractions(plate_before_plate(0.0), {0, 0, -1}, params);
  EXPECT_THAT(from_behind,
              ElementsAre(testing::DoubleNear(0.75, 0.02), testing::DoubleNear(1.0, 0.02), 0.0));
}

TEST(VisibleFractions, TheOrderOfFacesDoesNotMatter) {
  const Mesh mesh = test::triangle_soup(30, 3);
  const auto first = visible_fractions(mesh, {1, 2, 3}, {});
  const auto again = visible_fractions(test::shuffled(mesh, 4), {1, 2, 3}, {});
  for (std::size_t l = 0; l < first.size(); ++l) EXPECT_NEAR(first[l], again[l], 1e-9);
}

TEST(VisibleFractions, AnUnlabelledMeshHasNone) {
  Mesh mesh = test::cube();
  mesh.face_label.clear();
  mesh.label_names.clear();
  EXPECT_TRUE(visible_fractions(mesh, {1, 0, 0}, {}).empty());
}

TEST(FibonacciDirections, AreUnitVectorsEvenlySpread) {
  const auto directions = fibonacci_directions(80);
  ASSERT_EQ(directions.size(), 80U);
  Direction mean{};
  for (std::size_t i = 0; i < 80; ++i) {
    EXPECT_NEAR(cosine(directions[i], directions[i]), 1.0, 1e-12);
    for (int axis = 0; axis < 3; ++axis) mean[axis] += directions[i][axis] / 80.0;
    double nearest = -1.0;
    for (std::size_t j = 0; j < 80; ++j)
      if (j != i) nearest = std::max(nearest, cosine(directions[i], directions[j]));
    // 80 equal caps have an angular radius of 12.8 degrees.
    const double degrees = std::acos(nearest) * 180.0 / std::numbers::pi;
    EXPECT_GT(degrees, 16.0);
    EXPECT_LT(degrees, 25.6);
  }
  EXPECT_LT(cosine(mean, mean), 1e-3);
  EXPECT_EQ(fibonacci_directions(1).size(), 1U);
}

TEST(ChooseViews, EveryViewIsValidAndTheyAreAsFarApartAsCanBe) {
  // Two labelled halves: valid views look at the seam.
  Mesh mesh = test::sphere(30);
  mesh.label_names = {"upper", "lower"};
  for (std::size_t f = 0; f < mesh.face_count(); ++f) {
    double z = 0.0;
    for (std::size_t c = 0; c < 3; ++c)
      z += mesh.vertex[3 * static_cast<std::size_t>(mesh.face[3 * f + c]) + 2];
    mesh.face_label[f] = z > 0.0 ? 0 : 1;
  }
  const Params params;
  const auto views = choose_views(mesh, params);
  ASSERT_EQ(views.size(), 8U);
  std::vector<Direction> valid;
  for (const Direction& direction : fibonacci_directions(80)) {
    const auto visible = visible_fractions(mesh, direction, params);
    if (std::min(visible[0], visible[1]) >= 0.2) valid.push_back(direction);
  }
  EXPECT_LT(valid.size(), 70U);
  for (std::size_t v = 0; v < views.size(); ++v) {
    EXPECT_THAT(valid, testing::Contains(views[v].direction));
    EXPECT_GE(views[v].roll, 0.0);
    EXPECT_LT(views[v].roll, 2.0 * std::numbers::pi);
    if (v == 0) continue;
    // Nobody is farther from the views before than the one that was taken.
    const auto nearness = [&](const Direction& d) {
      double nearest = -1.0;
      for (std::size_t u = 0; u < v; ++u)
        nearest = std::max(nearest, cosine(d, views[u].direction));
      return nearest;
    };
    for (const Direction& direction : valid)
      EXPECT_GE(nearness(direction), nearness(views[v].direction) - 1e-12);
  }
}

TEST(ChooseViews, AreDrawnFromTheSeedAlone) {
  const auto key = [](std::uint64_t seed) {
    std::vector<double> numbers;
    Mesh mesh = test::sphere(10);
    for (const View& view : choose_views(mesh, {.visible = 0.1, .seed = seed}))
      numbers.insert(numbers.end(), {view.direction[0], view.direction[1], view.roll});
    return numbers;
  };
  EXPECT_EQ(key(1), key(1));
  EXPECT_NE(key(1), key(2));
}

TEST(ChooseViews, LabelsWithoutFacesAndUnlabelledMeshesDoNotForbidViews) {
  Mesh mesh = test::sphere(10);
  mesh.label_names.emplace_back("nothing");
  EXPECT_EQ(choose_views(mesh, {}).size(), 8U);
  mesh.face_label.clear();
  mesh.label_names.clear();
  EXPECT_EQ(choose_views(mesh, {}).size(), 8U);
  EXPECT_EQ(choose_views(mesh, {.directions = 5, .count = 100}).size(), 20U);
}

// A plate at the bottom of a square shaft: seen from a cone of directions only.
Mesh plate_in_shaft(double depth) {
  Mesh mesh;
  mesh.label_names = {"shaft", "bottom"};
  const double floor = -0.01;
  test::add_plate(mesh, {-1, -1, floor}, {2, 0, 0}, {0, 0, depth}, 0);
  test::add_plate(mesh, {-1, 1, floor}, {2, 0, 0}, {0, 0, depth}, 0);
  test::add_plate(mesh, {-1, -1, floor}, {0, 2, 0}, {0, 0, depth}, 0);
  test::add_plate(mesh, {1, -1, floor}, {0, 2, 0}, {0, 0, depth}, 0);
  test::add_plate(mesh, {-1, -1, floor}, {2, 0, 0}, {0, 2, 0}, 0);
  test::add_plate(mesh, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 1);
  return mesh;
}

TEST(ChooseViews, LookMoreFinelyWhereFewDirectionsAreValid) {
  const Mesh mesh = plate_in_shaft(3.4);
  const Params params{.visible = 0.1};
  int coarse = 0;
  for (const Direction& direction : fibonacci_directions(80)) {
    const auto visible = visible_fractions(mesh, direction, params);
    coarse += std::min(visible[0], visible[1]) >= 0.1 ? 1 : 0;
  }
  EXPECT_GT(coarse, 0);
  EXPECT_LT(coarse, 8);
  const auto views = choose_views(mesh, params);
  ASSERT_EQ(views.size(), 8U);
  for (const View& view : views) {
    const auto visible = visible_fractions(mesh, view.direction, params);
    EXPECT_GE(std::min(visible[0], visible[1]), 0.1);
  }
}

TEST(ChooseViews, APartThatIsNeverSeenLeavesNoView) {
  Mesh mesh = test::cube();
  for (auto& label : mesh.face_label) label = 0;
  mesh.label_names = {"box", "content"};
  test::add_plate(mesh, {-0.5, -0.5, 0}, {1, 0, 0}, {0, 1, 0}, 1);
  EXPECT_TRUE(choose_views(mesh, {.directions = 20}).empty());
}

TEST(CameraParams, SurviveTheirRecipe) {
  Params params{.pitch = 0.0125, .count = 5, .seed = 99};
  Params other;
  apply_recipe(describe(other), recipe(describe(params)));
  EXPECT_EQ(recipe(describe(other)), recipe(describe(params)));
  EXPECT_EQ(other.count, 5);
}

}  // namespace
}  // namespace cosegraph::camera
