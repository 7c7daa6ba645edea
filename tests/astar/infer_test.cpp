#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "astar/astar.hpp"
#include "astar/line_spectrum.hpp"
#include "core/error.hpp"
#include "core/random.hpp"

namespace cosegraph::astar {
namespace {

// Four segments in a row, 0 - 1 - 2 - 3, of 20 points each, at 0, 1, 2, 3 on a line; labels
// a, b, c. Appearance knows segments 0 (a) and 3 (c), leans to a for 1 and is even for 2.
struct Scene {
  Scores scores{.label_names = {"a", "b", "c"},
                .segment_count = 4,
                .probability = {0.90F, 0.05F, 0.05F,  //
                                0.40F, 0.35F, 0.25F,  //
                                0.30F, 0.35F, 0.35F,  //
                                0.05F, 0.05F, 0.90F}};
  Segments segments;
  Spectrum spectrum;
  RelationModel relations;

  Scene() {
    Random random(1);
    std::vector<float> position;
    for (std::int32_t p = 0; p < 80; ++p) {
      segments.of_point.push_back(p / 20);
      position.push_back(static_cast<float>(p / 20 + 0.05 * random.normal()));
    }
    segments.count = 4;
    segments.adjacency = {{0, 1}, {1, 2}, {2, 3}};
    spectrum = test::line_spectrum(position);
    relations.label_names = scores.label_names;
    relations.spectrum_recipe = "line";
    const auto at = [](float mean) { return DistanceMixture{{1.0F}, {mean}, {0.4F}}; };
    relations.pairs = {at(0.1F), at(1.0F), at(1.0F), at(3.0F), at(1.5F), at(0.1F)};
    relations.neighbours = {1, 1, 0, 1, 1, 1, 0, 1, 1};  // a and c never touch
  }
  Labelling infer(Params params) const {
    return astar::infer(scores, segments, &spectrum, &relations, params);
  }
};

TEST(Infer, WithoutSpatialTermsTakesTheMostProbableLabels) {
  const Scene scene;
  const auto result = infer(scene.scores, scene.segments, nullptr, nullptr, {});
  EXPECT_THAT(result.segment_label, testing::ElementsAre(0, 0, 1, 2));
  EXPECT_THAT(result.segment_confidence, testing::ElementsAre(0.9F, 0.4F, 0.35F, 0.9F));
  EXPECT_NEAR(result.energy, -std::log(0.9) - std::log(0.4) - std::log(0.35) - std::log(0.9), 1e-6);
  EXPECT_TRUE(result.proven_optimal);
  EXPECT_EQ(result.violations, 0);
  EXPECT_EQ(result.label_names, scene.scores.label_names);
}

TEST(Infer, CarriesSegmentsToPoints) {
  const Scene scene;
  const auto result = scene.infer({});
  ASSERT_EQ(result.point_label.size(), 80U);
  for (std::size_t p = 0; p < 80; ++p) {
    EXPECT_EQ(result.point_label[p], result.segment_label[p / 20]);
    EXPECT_EQ(result.point_confidence[p], result.segment_confidence[p / 20]);
  }
}

TEST(Infer, SpatialRelationsDecideWhatAppearanceCannot) {
  const Scene scene;
  const auto result =
      scene.infer({.spatial = Spatial::iso_free, .pairwise_scale = PairwiseScale::none});
  EXPECT_THAT(result.segment_label, testing::ElementsAre(0, 1, 1, 2));
}

TEST(Infer, EnergyIsThatOfEquationOne) {
  const Scene scene;
  for (const auto scale : {PairwiseScale::none, PairwiseScale::segments}) {
    const Params params{
        .spatial = Spatial::iso_free, .pairwise_scale = scale, .pairwise_weight = 0.7};
    const auto result = scene.infer(params);
    const double weight = scale == PairwiseScale::none ? 0.7 : 0.7 / 4.0;
    double expected = 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto of_i = static_cast<std::size_t>(result.segment_label[i]);
      expected -= std::log(scene.scores.probability[3 * i + of_i]);
      for (std::size_t j = 0; j < i; ++j) {
        std::vector<std::int32_t> a, b;
        for (std::int32_t p = 0; p < 20; ++p) {
          a.push_back(static_cast<std::int32_t>(20 * i) + p);
          b.push_back(static_cast<std::int32_t>(20 * j) + p);
        }
        const auto posterior =
            log_pair_posterior(scene.spectrum, a, b, scene.relations, params.likelihood, 400);
        expected -=
            weight * posterior[3 * of_i + static_cast<std::size_t>(result.segment_label[j])];
      }
    }
    EXPECT_NEAR(result.energy, expected, 1e-6);
  }
}

TEST(Infer, HardConstraintsForbidNeighboursThatWereNeverSeen) {
  Scene scene;
  // Appearance alone says a a c c: segments 1 and 2 touch.
  scene.scores.probability = {0.90F, 0.05F, 0.05F, 0.80F, 0.10F, 0.10F,
                              0.10F, 0.05F, 0.85F, 0.05F, 0.05F, 0.90F};
  const auto free = scene.infer({.spatial = Spatial::iso_free, .pairwise_weight = 0.01});
  EXPECT_THAT(free.segment_label, testing::ElementsAre(0, 0, 2, 2));
  EXPECT_EQ(free.violations, 1);
  const auto bound = scene.infer({.spatial = Spatial::iso, .pairwise_weight = 0.01});
  EXPECT_THAT(bound.segment_label, testing::ElementsAre(0, 1, 2, 2));
  EXPECT_EQ(bound.violations, 0);
  EXPECT_GT(bound.energy, free.energy);
}

TEST(Infer, ViolatesConstraintsOnlyIfThereIsNoOtherWay) {
  Scene scene;
  scene.relations.neighbours = {1, 0, 0, 0, 0, 0, 0, 0, 0};  // a touches a, nothing else
  auto result = scene.infer({.spatial = Spatial::iso, .pairwise_weight = 50.0});
  EXPECT_THAT(result.segment_label, testing::Each(0));
  EXPECT_EQ(result.violations, 0);
  scene.relations.neighbours.assign(9, 0);
  result = scene.infer({.spatial = Spatial::iso});
  EXPECT_EQ(result.violations, 3);
  EXPECT_LT(result.energy, 100.0);  // penalties are not part of it
}

TEST(Infer, PairwiseWeightZeroIsAppearanceOnly) {
  const Scene scene;
  const auto plain = scene.infer({});
  const auto weightless = scene.infer({.spatial = Spatial::iso_free, .pairwise_weight = 0.0});
  EXPECT_EQ(weightless.segment_label, plain.segment_label);
  EXPECT_NEAR(weightless.energy, plain.energy, 1e-9);
}

TEST(Infer, SegmentsWithoutSamplesGoByTheirAppearance) {
  Scene scene;
  for (std::size_t s = 20; s < 40; ++s) scene.spectrum.sample_dense[s] = kNoPoint;
  const auto result = scene.infer({.spatial = Spatial::iso_free});
  EXPECT_EQ(result.segment_label[1], 0);
}

TEST(Infer, AppearanceNeverForbidsALabel) {
  Scene scene;
  scene.scores.probability.assign(12, 0.0F);
  const auto result = scene.infer({});
  EXPECT_NEAR(result.energy, -4.0 * std::log(1e-6), 1e-6);
}

TEST(Infer, SaysWhenItIsNotProven) {
  const Scene scene;
  const auto proven = scene.infer({.spatial = Spatial::iso, .pairwise_scale = PairwiseScale::none});
  const auto given_up =
      scene.infer({.spatial = Spatial::iso, .pairwise_scale = PairwiseScale::none, .max_open = 1});
  EXPECT_TRUE(proven.proven_optimal);
  EXPECT_EQ(proven.gap, 0.0);
  EXPECT_EQ(given_up.proven_optimal, given_up.gap == 0.0);
  EXPECT_GE(given_up.energy, proven.energy - 1e-9);
}

TEST(Infer, OfNoSegmentsIsEmpty) {
  const Scene scene;
  const Scores scores{.label_names = {"a", "b", "c"}};
  Spectrum empty;
  empty.recipe = "line";
  for (const auto spatial : {Spatial::none, Spatial::iso}) {
    const auto result = infer(scores, {}, &empty, &scene.relations, {.spatial = spatial});
    EXPECT_TRUE(result.segment_label.empty()) << to_name(spatial);
    EXPECT_TRUE(result.proven_optimal);
  }
}

TEST(Infer, RefusesSpatialTermsThatDoNotFit) {
  Scene scene;
  const Params iso{.spatial = Spatial::iso};
  EXPECT_THROW(infer(scene.scores, scene.segments, nullptr, &scene.relations, iso), MismatchError);
  EXPECT_THROW(infer(scene.scores, scene.segments, &scene.spectrum, nullptr, iso), MismatchError);
  scene.spectrum.recipe = "other";
  EXPECT_THROW(scene.infer(iso), MismatchError);
  scene.relations.spectrum_recipe = "";
  scene.spectrum.recipe = "";
  EXPECT_THROW(scene.infer(iso), MismatchError);
  scene = {};
  scene.relations.label_names[1] = "z";
  EXPECT_THROW(scene.infer(iso), MismatchError);
}

TEST(Infer, RefusesMoreSegmentsThanItCanCompare) {
  Scene scene;
  scene.segments.count = scene.scores.segment_count = 10000;
  scene.scores.probability.assign(10000 * scene.scores.label_names.size(), 0.3F);
  EXPECT_NO_THROW(scene.infer({}));
  EXPECT_THROW(scene.infer({.spatial = Spatial::iso}), InputError);
}

TEST(Infer, RefusesScoresAndSegmentsThatDoNotFit) {
  Scene scene;
  scene.scores.segment_count = 3;
  EXPECT_THROW(scene.infer({}), MismatchError);
  scene = {};
  scene.scores.probability.pop_back();
  EXPECT_THROW(scene.infer({}), InputError);
  scene = {};
  scene.scores.probability[2] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(scene.infer({}), InputError);
  scene = {};
  scene.segments.of_point[5] = 4;
  EXPECT_THROW(scene.infer({}), InputError);
  scene = {};
  scene.segments.adjacency = {{1, 1}};
  EXPECT_THROW(scene.infer({}), InputError);
}

TEST(AstarParams, RoundTripAsText) {
  for (const auto& [value, name] : names<Spatial>()) EXPECT_EQ(from_name<Spatial>(name), value);
  for (const auto& [value, name] : names<PairwiseScale>())
    EXPECT_EQ(from_name<PairwiseScale>(name), value);
  EXPECT_EQ(to_name(Spatial::iso_free), "iso*");
  Params params{.spatial = Spatial::iso_free, .pairwise_weight = 0.25};
  Params other;
  apply_recipe(describe(other), recipe(describe(params)));
  EXPECT_EQ(recipe(describe(other)), recipe(describe(params)));
}

}  // namespace
}  // namespace cosegraph::astar
