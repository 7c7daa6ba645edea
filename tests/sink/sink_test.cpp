#include "sink/sink.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/error.hpp"
#include "core/random.hpp"

namespace cosegraph::sink {
namespace {

// Six input points of which the last was removed; four dense points in two segments.
struct Frame {
  Cloud input;
  Segments segments;
  Labelling labelling;

  Frame() {
    for (int i = 0; i < 18; ++i) input.xyz.push_back(static_cast<float>(i));
    input.xyz[15] = std::numeric_limits<float>::quiet_NaN();
    input.width = 3;
    input.height = 2;
    input.dense_index = {0, 0, 1, 2, 3, kNoPoint};
    input.label_names = {"handle", "body", "lid"};
    input.label = {1, 1, 0, 0, kNoLabel, 0};
    segments.of_point = {0, 0, 1, 1};
    segments.count = 2;
    labelling.label_names = {"body", "handle"};
    labelling.segment_label = {0, 1};
    labelling.segment_confidence = {0.9F, 0.6F};
    labelling.point_label = {0, 0, 1, 1};
    labelling.point_confidence = {0.9F, 0.9F, 0.6F, 0.6F};
  }
};

TEST(ToInput, GivesEveryInputPointTheLabelOfItsDensePoint) {
  const Frame frame;
  const auto result = to_input(frame.input, frame.labelling);
  EXPECT_THAT(result.cloud.label, testing::ElementsAre(0, 0, 0, 1, 1, kNoLabel));
  EXPECT_THAT(result.confidence, testing::ElementsAre(0.9F, 0.9F, 0.9F, 0.6F, 0.6F, 0.0F));
  EXPECT_EQ(result.cloud.label_names, frame.labelling.label_names);
  EXPECT_EQ(result.cloud.width, 3U);
  EXPECT_EQ(result.cloud.height, 2U);
  EXPECT_NO_THROW(check_sizes(result.cloud));
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_EQ(result.cloud.rgb[3 * i + c], palette(result.cloud.label[i])[c]);
}

TEST(ToInput, TakesADenseCloudAsItIs) {
  Frame frame;
  frame.input = Cloud{.xyz = std::vector<float>(12, 1.0F), .width = 4};
  EXPECT_THAT(to_input(frame.input, frame.labelling).cloud.label, testing::ElementsAre(0, 0, 1, 1));
}

TEST(ToInput, OfNothingIsEmpty) {
  const auto result = to_input({}, {});
  EXPECT_TRUE(result.cloud.label.empty());
  EXPECT_TRUE(result.confidence.empty());
}

TEST(ToInput, RefusesALabellingOfAnotherCloud) {
  Frame frame;
  frame.labelling.point_label.resize(3);
  EXPECT_THROW(to_input(frame.input, frame.labelling), MismatchError);
  frame.input.dense_index.pop_back();
  EXPECT_THROW(to_input(frame.input, frame.labelling), InputError);
}

TEST(Evaluate, ComparesByName) {
  const Frame frame;
  const auto result = evaluate(frame.input, frame.segments, frame.labelling);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->points, 4);  // not the unlabelled one, not the removed one
  EXPECT_DOUBLE_EQ(result->accuracy, 0.75);
  EXPECT_DOUBLE_EQ(result->floor, 0.5);
  EXPECT_DOUBLE_EQ(result->oracle, 0.75);
  EXPECT_TRUE(result->unknown.empty());
}

TEST(Evaluate, NamesTrueLabelsThatTheModelLacks) {
  Frame frame;
  frame.input.label = {2, 2, 2, 0, 0, 0};
  const auto result = evaluate(frame.input, frame.segments, frame.labelling);
  EXPECT_THAT(result->unknown, testing::ElementsAre("lid"));
  EXPECT_DOUBLE_EQ(result->accuracy, 0.4);
  EXPECT_DOUBLE_EQ(result->oracle, 1.0);
}

TEST(Evaluate, AccuracyNeverExceedsTheOracle) {
  Random random(1);
  for (int run = 0; run < 100; ++run) {
    Frame frame;
    frame.input = {};
    frame.input.label_names = {"handle", "body"};
    frame.segments.of_point.clear();
    frame.labelling.point_label.clear();
    for (int i = 0; i < 40; ++i) {
      const auto segment = static_cast<std::int32_t>(random.below(5));
      frame.input.xyz.insert(frame.input.xyz.end(), 3, 0.0F);
      frame.input.label.push_back(static_cast<std::int32_t>(random.below(2)));
      frame.segments.of_point.push_back(segment);
      frame.labelling.point_label.push_back(segment % 2);
    }
    frame.labelling.majority = static_cast<std::int32_t>(random.below(2));
    const auto result = evaluate(frame.input, frame.segments, frame.labelling);
    EXPECT_LE(result->accuracy, result->oracle);
    EXPECT_LE(result->floor, result->oracle);
  }
}

TEST(Evaluate, HasNothingToSayWithoutTrueLabels) {
  Frame frame;
  frame.input.label.assign(6, kNoLabel);
  EXPECT_FALSE(evaluate(frame.input, frame.segments, frame.labelling));
  frame.input.label.clear();
  frame.input.label_names.clear();
  EXPECT_FALSE(evaluate(frame.input, frame.segments, frame.labelling));
}

TEST(Evaluate, RefusesSegmentsOfAnotherCloud) {
  Frame frame;
  frame.segments.of_point.push_back(0);
  EXPECT_THROW(evaluate(frame.input, frame.segments, frame.labelling), MismatchError);
}

using Colour = std::array<double, 3>;

double linear(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

Colour product(const std::array<Colour, 3>& matrix, const Colour& v) {
  Colour result{};
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) result[r] += matrix[r][c] * v[c];
  return result;
}

// CIELAB of a label's colour as seen by an eye, given as a matrix over linear RGB.
Colour lab(std::int32_t label, const std::array<Colour, 3>& eye) {
  const auto rgb = palette(label);
  Colour seen = product(eye, {linear(rgb[0]), linear(rgb[1]), linear(rgb[2])});
  for (double& value : seen) value = std::clamp(value, 0.0, 1.0);
  const Colour xyz = product(
      {{{0.4124, 0.3576, 0.1805}, {0.2126, 0.7152, 0.0722}, {0.0193, 0.1192, 0.9505}}}, seen);
  const auto f = [](double t) { return t > 0.008856 ? std::cbrt(t) : 7.787 * t + 16.0 / 116.0; };
  const double x = f(xyz[0] / 0.9505);
  const double y = f(xyz[1]);
  const double z = f(xyz[2] / 1.089);
  return {116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)};
}

// Dichromats after Machado, Oliveira, Fernandes (IEEE TVCG 2009).
constexpr std::array<Colour, 3> kNormal = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
constexpr std::array<Colour, 3> kProtan = {{{0.152286, 1.052583, -0.204868},
                                            {0.114503, 0.786281, 0.099216},
                                            {-0.003882, -0.048116, 1.051998}}};
constexpr std::array<Colour, 3> kDeutan = {{{0.367322, 0.860646, -0.227968},
                                            {0.280085, 0.672501, 0.047413},
                                            {-0.011820, 0.042940, 0.968881}}};

TEST(Palette, TwelveColoursDifferForColourBlindEyesToo) {
  for (const auto& eye : {kNormal, kProtan, kDeutan})
    for (std::int32_t a = 0; a < 12; ++a)
      for (std::int32_t b = 0; b < a; ++b) {
        const auto first = lab(a, eye);
        const auto second = lab(b, eye);
        double square = 0.0;
        for (std::size_t c = 0; c < 3; ++c) square += std::pow(first[c] - second[c], 2.0);
        EXPECT_GT(std::sqrt(square), 23.0) << a << " and " << b;
      }
}

TEST(Palette, GoesOnWithOtherLightness) {
  std::set<std::array<float, 3>> all;
  for (std::int32_t label = kNoLabel; label < 36; ++label) {
    for (const float channel : palette(label)) {
      EXPECT_GE(channel, 0.0F);
      EXPECT_LE(channel, 1.0F);
    }
    all.insert(palette(label));
  }
  EXPECT_EQ(all.size(), 37U);
  EXPECT_LT(lab(12, kNormal)[0], lab(0, kNormal)[0]);
  EXPECT_GT(lab(24, kNormal)[0], lab(0, kNormal)[0]);
}

}  // namespace
}  // namespace cosegraph::sink
