#include "source/source.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "source/shapes.hpp"

namespace cosegraph::source {
namespace {

using test::board;
using test::half_sphere;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Frame prepared(const Cloud& input) {
  return prepare(input, {}, {});
}

double distance(const Cloud& a, std::size_t i, const Cloud& b, std::size_t j) {
  return std::hypot(a.xyz[3 * i] - b.xyz[3 * j], a.xyz[3 * i + 1] - b.xyz[3 * j + 1],
                    a.xyz[3 * i + 2] - b.xyz[3 * j + 2]);
}

std::string refusal(const Cloud& input) {
  try {
    prepared(input);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

// Left half label 0, right half 1, every tenth without.
Cloud labelled(Cloud cloud) {
  cloud.label_names = {"left", "right"};
  for (std::size_t i = 0; i < cloud.size(); ++i)
    cloud.label.push_back(i % 10 == 0 ? kNoLabel : (cloud.xyz[3 * i] < 0.0F ? 0 : 1));
  return cloud;
}

TEST(Prepare, GivesConsistentClouds) {
  const Frame frame = prepared(half_sphere(20000, 0.3, 2.0));
  check_sizes(frame.input);
  check_sizes(frame.dense);
  check_sizes(frame.cloud);
  EXPECT_EQ(frame.input.size(), 20000U);
  EXPECT_EQ(frame.input.dense_index.size(), frame.input.size());
  EXPECT_EQ(frame.cloud.dense_index.size(), frame.cloud.size());
  EXPECT_THAT(frame.dense.dense_index, IsEmpty());
  EXPECT_EQ(frame.cloud.normal.size(), frame.cloud.xyz.size());
  EXPECT_GT(frame.dense.size(), frame.cloud.size());
  for (const Cloud* cloud : {&frame.dense, &frame.cloud}) {
    EXPECT_EQ(cloud->scale, frame.input.scale);
    EXPECT_EQ(cloud->recipe, frame.input.recipe);
    EXPECT_THAT(cloud->recipe, HasSubstr("scale_rule=area"));
  }
}

TEST(Prepare, StandsForEveryPointByOneInItsVoxel) {
  const Frame frame = prepared(half_sphere(20000, 0.3, 2.0));
  const double dense_diagonal = std::sqrt(3.0) * 0.005 * frame.dense.scale;
  for (std::size_t i = 0; i < frame.input.size(); ++i)
    ASSERT_LE(distance(frame.input, i, frame.dense, frame.input.dense_index[i]), dense_diagonal);
  const double diagonal = std::sqrt(3.0) * 0.014 * frame.cloud.scale;
  for (std::size_t i = 0; i < frame.cloud.size(); ++i)
    ASSERT_LE(distance(frame.cloud, i, frame.dense, frame.cloud.dense_index[i]), diagonal);
}

TEST(Prepare, FindsTheNormalsOfASphere) {
  Cloud input = half_sphere(20000, 0.3, 2.0);
  for (std::size_t i = 0; i < input.size(); ++i) input.xyz[3 * i] += 7.0F;
  input.origin = {7.0F, 0.0F, 0.0F};
  const Frame frame = prepared(input);
  double worst = 1.0;
  for (std::size_t i = 0; i < frame.cloud.size(); ++i) {
    const float* p = &frame.cloud.xyz[3 * i];
    const float* n = &frame.cloud.normal[3 * i];
    ASSERT_NEAR(std::hypot(n[0], n[1], n[2]), 1.0, 1e-5);
    if (p[2] > 1.93F) continue;  // turned away from the sensor or with neighbours on one side only
    const double radial = ((p[0] - 7.0) * n[0] + p[1] * n[1] + (p[2] - 2.0) * n[2]) /
                          std::hypot(p[0] - 7.0, p[1], p[2] - 2.0);
    worst = std::min(worst, radial);
  }
  EXPECT_GT(worst, std::cos(0.1));
}

TEST(Prepare, TurnsNormalsTowardTheSensor) {
  const Frame frame = prepared(test::with_noise(half_sphere(20000, 0.3, 2.0), 0.002, 1));
  for (std::size_t i = 0; i < frame.cloud.size(); ++i) {
    double toward = 0.0;
    for (int axis = 0; axis < 3; ++axis)
      toward -= frame.cloud.xyz[3 * i + axis] * frame.cloud.normal[3 * i + axis];
    ASSERT_GE(toward, 0.0);
  }
}

TEST(Prepare, TakesAPlaneForAnObject) {
  const Frame frame = prepared(board(120, 0.5, 0.6, 2.0));
  const std::array<double, 3> across{0.0, std::sin(0.6), -std::cos(0.6)};
  for (std::size_t i = 0; i < frame.cloud.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      ASSERT_NEAR(frame.cloud.normal[3 * i + axis], across[axis], 1e-3);
}

TEST(Prepare, PassesLabelsOnWithoutBeingInfluencedByThem) {
  const Cloud plain = half_sphere(20000, 0.3, 2.0);
  const Frame with = prepared(labelled(plain));
  const Frame without = prepared(plain);
  EXPECT_EQ(with.dense.xyz, without.dense.xyz);
  EXPECT_EQ(with.cloud.xyz, without.cloud.xyz);
  EXPECT_EQ(with.cloud.normal, without.cloud.normal);
  EXPECT_EQ(with.cloud.recipe, without.cloud.recipe);
  EXPECT_THAT(without.cloud.label, IsEmpty());
  for (const Cloud* cloud : {&with.dense, &with.cloud})
    for (std::size_t i = 0; i < cloud->size(); ++i) {
      if (std::abs(cloud->xyz[3 * i]) < 0.02F || cloud->label[i] == kNoLabel) continue;
      ASSERT_EQ(cloud->label[i], cloud->xyz[3 * i] < 0.0F ? 0 : 1);
    }
  // A voxel of several points is unlabelled only if all of them are.
  EXPECT_LT(std::ranges::count(with.cloud.label, kNoLabel) * 50, std::ssize(with.cloud.label));
}

TEST(Prepare, AveragesColours) {
  Cloud input = half_sphere(20000, 0.3, 2.0);
  for (std::size_t i = 0; i < input.size(); ++i)
    input.rgb.insert(input.rgb.end(), {0.25F, 0.5F, i % 2 == 0 ? 0.0F : 1.0F});
  const Frame frame = prepared(input);
  for (std::size_t i = 0; i < frame.cloud.size(); ++i) {
    ASSERT_FLOAT_EQ(frame.cloud.rgb[3 * i], 0.25F);
    ASSERT_FLOAT_EQ(frame.cloud.rgb[3 * i + 1], 0.5F);
    ASSERT_THAT(frame.cloud.rgb[3 * i + 2], testing::AllOf(testing::Ge(0.0F), testing::Le(1.0F)));
  }
}

TEST(Prepare, LeavesOutPointsThatAreNotFinite) {
  Cloud input = half_sphere(20000, 0.3, 2.0);
  for (std::size_t i = 0; i < input.size(); i += 3) input.xyz[3 * i + 1] = kNan;
  input.xyz[3] = std::numeric_limits<float>::infinity();
  input.xyz[3 * 4 + 2] = -3e38F;  // sums and squares of such are not
  const Frame frame = prepared(input);
  for (std::size_t i = 0; i < input.size(); ++i)
    ASSERT_EQ(frame.input.dense_index[i] == kNoPoint, i % 3 == 0 || i == 1 || i == 4) << i;
}

TEST(Prepare, GivesTheSameBytesEveryTime) {
  const Cloud input = labelled(test::with_noise(half_sphere(20000, 0.3, 2.0), 0.003, 4));
  const Frame first = prepared(input);
  const Frame second = prepared(input);
  EXPECT_EQ(first.dense.xyz, second.dense.xyz);
  EXPECT_EQ(first.cloud.xyz, second.cloud.xyz);
  EXPECT_EQ(first.cloud.normal, second.cloud.normal);
  EXPECT_EQ(first.input.dense_index, second.input.dense_index);
}

TEST(Prepare, BoundsTheDenseCloudOfTwoMillionPoints) {
  const Frame frame = prepared(test::with_noise(half_sphere(2000000, 0.3, 2.0), 0.02, 1));
  EXPECT_LE(frame.dense.size(), 60000U);
  EXPECT_GT(frame.dense.size(), 30000U);
  ASSERT_THAT(frame.notes, SizeIs(1));
  EXPECT_THAT(frame.notes[0], HasSubstr("2000000 points reduced to"));
}

TEST(Prepare, KeepsDuplicatesTogether) {
  const Cloud once = half_sphere(5000, 0.3, 2.0);
  const Frame frame = prepared(test::joined(once, once));
  for (std::size_t i = 0; i < once.size(); ++i)
    ASSERT_EQ(frame.input.dense_index[i], frame.input.dense_index[i + once.size()]);
}

TEST(Prepare, RefusesCloudsThatHoldNoObject) {
  EXPECT_THAT(refusal({}), HasSubstr("only 0 points are finite"));
  EXPECT_THAT(refusal(half_sphere(3, 0.3, 2.0)), HasSubstr("only 3 points are finite"));
  Cloud lost = half_sphere(1000, 0.3, 2.0);
  std::ranges::fill(lost.xyz, kNan);
  EXPECT_THAT(refusal(lost), HasSubstr("only 0 points are finite"));
  Cloud same = half_sphere(1000, 0.3, 2.0);
  std::ranges::fill(same.xyz, 1.25F);
  EXPECT_THAT(refusal(same), HasSubstr("no extent"));
  Cloud broken = half_sphere(1000, 0.3, 2.0);
  broken.width = 7;
  EXPECT_THROW(prepared(broken), InputError);
}

TEST(Prepare, RefusesAFixedScaleThatLeavesNothing) {
  Params coarse{.scale_rule = ScaleRule::fixed};
  EXPECT_THROW(prepare(half_sphere(5000, 0.005, 2.0), {}, coarse), InputError);
}

TEST(SourceParameters, RoundTripThroughTheirRecipe) {
  Params params{.scale_rule = ScaleRule::extent, .spacing = 0.02};
  Params copy;
  apply_recipe(describe(copy), recipe(describe(params)));
  EXPECT_EQ(copy.scale_rule, ScaleRule::extent);
  EXPECT_EQ(copy.spacing, 0.02);
  EXPECT_THROW(set_field(describe(copy), "spacing", {"0"}), ParameterError);
  EXPECT_THROW(set_field(describe(copy), "scale_rule", {"length"}), ParameterError);
}

}  // namespace
}  // namespace cosegraph::source
