#include "sample/sequence.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "camera/solids.hpp"
#include "sample/shapes.hpp"

namespace cosegraph::sample {
namespace {

// A sensor without faults.
SequenceParams ideal(int frames = 1) {
  return {.frames = frames,
          .disparity_noise = 0.0,
          .disparity_step = 0.0,
          .grazing = 90.0,
          .edge_jump = 0.0,
          .dropout = 0.0};
}

bool seen(const Cloud& cloud, std::size_t i) {
  return std::isfinite(cloud.xyz[3 * i + 2]);
}

std::size_t seen_count(const Cloud& cloud) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) count += seen(cloud, i) ? 1 : 0;
  return count;
}

TEST(Sequence, FramesAreOrganisedLabelledClouds) {
  const Mesh mesh = make(Kind::mug, 1);
  const SequenceParams params{.frames = 4, .width = 160, .height = 120, .focal = 140};
  const auto clouds = sequence(mesh, params);
  ASSERT_EQ(clouds.size(), 4U);
  for (const Cloud& cloud : clouds) {
    check_sizes(cloud);
    EXPECT_EQ(cloud.width, 160U);
    EXPECT_EQ(cloud.height, 120U);
    EXPECT_EQ(cloud.label_names, mesh.label_names);
    EXPECT_GT(seen_count(cloud), 1000U);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      ASSERT_EQ(seen(cloud, i), cloud.label[i] != kNoLabel);
      if (!seen(cloud, i)) continue;
      // A point stays on its pixel's ray whatever the noise.
      const float z = cloud.xyz[3 * i + 2];
      ASSERT_NEAR(cloud.xyz[3 * i] / z * 140.0 + 79.5, static_cast<double>(i % 160), 1e-3);
      ASSERT_NEAR(cloud.xyz[3 * i + 1] / z * 140.0 + 59.5, static_cast<double>(i / 160), 1e-3);
    }
  }
}

TEST(Sequence, TheObjectHasItsHeightInMetres) {
  SequenceParams params = ideal();
  params.object_height = 0.4;
  params.elevation = 0.0;
  params.distance = 40.0;
  params.focal = 20000.0;
  const Cloud cloud = sequence(test::sphere(60), params)[0];
  float top = 0.0F;
  float bottom = 0.0F;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!seen(cloud, i)) continue;
    top = std::min(top, cloud.xyz[3 * i + 1]);
    bottom = std::max(bottom, cloud.xyz[3 * i + 1]);
  }
  EXPECT_NEAR(bottom - top, 0.4, 0.01);
}

TEST(Sequence, TheCameraGoesRoundFromStartToEnd) {
  SequenceParams params = ideal(4);
  params.elevation = 0.0;
  // The sides of a cube, seen in turn: +x, +y, -x, -y.
  const auto clouds = sequence(test::cube(), params);
  const std::array<std::int32_t, 4> expected{1, 3, 0, 2};
  for (std::size_t f = 0; f < 4; ++f) {
    const Cloud& cloud = clouds[f];
    EXPECT_EQ(cloud.label[120 * 320 + 160], expected[f]) << f;
  }
  params.elevation = 90.0;
  EXPECT_EQ(sequence(test::cube(), params)[0].label[120 * 320 + 160], 5);
}

// Standard deviation of the depth of the face-on side of a cube around its true value.
double depth_deviation(double distance) {
  SequenceParams params = ideal();
  params.elevation = 0.0;
  params.object_height = 0.5;
  params.focal = 500.0;
  params.distance = distance;
  const Cloud clean = sequence(test::cube(), params)[0];
  params.disparity_noise = 0.1;
  const Cloud noisy = sequence(test::cube(), params)[0];
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < clean.size(); ++i) {
    if (clean.label[i] != 1) continue;
    sum += std::pow(noisy.xyz[3 * i + 2] - clean.xyz[3 * i + 2], 2.0);
    ++count;
  }
  EXPECT_GT(count, 500U);
  return std::sqrt(sum / static_cast<double>(count));
}

TEST(Sequence, NoiseGrowsWithTheSquareOfDepth) {
  for (const double distance : {2.0, 4.0}) {
    const double z = distance - 0.25;
    const double expected = z * z / (500.0 * 0.075) * 0.1;
    EXPECT_NEAR(depth_deviation(distance) / expected, 1.0, 0.1) << distance;
  }
}

TEST(Sequence, DisparityComesInSteps) {
  SequenceParams params = ideal();
  params.disparity_step = 0.125;
  const Cloud cloud = sequence(make(Kind::mug, 2), params)[0];
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!seen(cloud, i)) continue;
    const double steps = params.focal * params.baseline / cloud.xyz[3 * i + 2] / 0.125;
    ASSERT_NEAR(steps, std::round(steps), 1e-3);
  }
}

TEST(Sequence, GrazedSurfaceIsMissing) {
  SequenceParams params = ideal();
  params.distance = 10.0;
  params.focal = 5000.0;
  params.elevation = 0.0;
  const double radius = 0.125;
  const auto widest = [&](double grazing) {
    params.grazing = grazing;
    const Cloud cloud = sequence(test::sphere(120), params)[0];
    double result = 0.0;
    for (std::size_t i = 0; i < cloud.size(); ++i)
      if (seen(cloud, i))
        result = std::max<double>(result, std::hypot(cloud.xyz[3 * i], cloud.xyz[3 * i + 1]));
    return result / radius;
  };
  EXPECT_NEAR(widest(30.0), 0.5, 0.03);
  EXPECT_NEAR(widest(60.0), std::sqrt(0.75), 0.03);
  EXPECT_GT(widest(90.0), 0.98);
}

TEST(Sequence, PixelsBesideDepthEdgesAreMissing) {
  SequenceParams params = ideal();
  const Cloud whole = sequence(make(Kind::chair, 2), params)[0];
  params.edge_jump = 0.02;
  const Cloud cut = sequence(make(Kind::chair, 2), params)[0];
  EXPECT_LT(seen_count(cut), seen_count(whole));
  for (std::uint32_t row = 1; row + 1 < cut.height; ++row) {
    for (std::uint32_t column = 1; column + 1 < cut.width; ++column) {
      const std::size_t i = row * cut.width + column;
      if (!seen(cut, i)) continue;
      for (const std::size_t j : {i - 1, i + 1, i - cut.width, i + cut.width}) {
        ASSERT_TRUE(seen(whole, j));
        ASSERT_LE(std::abs(whole.xyz[3 * j + 2] / whole.xyz[3 * i + 2] - 1.0), 0.0201);
      }
    }
  }
}

TEST(Sequence, DropoutTakesItsShare) {
  SequenceParams params = ideal();
  const std::size_t whole = seen_count(sequence(test::sphere(40), params)[0]);
  params.dropout = 0.25;
  const std::size_t left = seen_count(sequence(test::sphere(40), params)[0]);
  EXPECT_NEAR(static_cast<double>(left) / static_cast<double>(whole), 0.75, 0.02);
}

TEST(Sequence, TheSameSeedGivesTheSameBytes) {
  const Mesh mesh = make(Kind::aeroplane, 1);
  SequenceParams params{.frames = 2, .width = 100, .height = 80, .focal = 90};
  const auto first = sequence(mesh, params);
  const auto again = sequence(mesh, params);
  params.seed = 2;
  const auto other = sequence(mesh, params);
  for (std::size_t f = 0; f < 2; ++f) {
    const std::size_t bytes = 4 * first[f].xyz.size();
    EXPECT_EQ(std::memcmp(first[f].xyz.data(), again[f].xyz.data(), bytes), 0);
    EXPECT_NE(std::memcmp(first[f].xyz.data(), other[f].xyz.data(), bytes), 0);
  }
}

TEST(Sequence, RefusesACameraInsideTheObjectAndAFlatObject) {
  SequenceParams params = ideal();
  params.distance = 0.1;
  EXPECT_THROW(sequence(test::cube(), params), InputError);
  EXPECT_THROW(sequence({}, {}), InputError);
  Mesh flat;
  flat.label_names = {"flat"};
  test::add_plate(flat, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0);
  EXPECT_THROW(sequence(flat, {}), InputError);
}

TEST(SequenceParams, SurviveTheirRecipe) {
  SequenceParams params{.frames = 7, .disparity_step = 0.0625};
  SequenceParams other;
  apply_recipe(describe(other), recipe(describe(params)));
  EXPECT_EQ(recipe(describe(other)), recipe(describe(params)));
}

}  // namespace
}  // namespace cosegraph::sample
