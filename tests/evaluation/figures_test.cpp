#include "tools/evaluation/figures.hpp"

#include <gtest/gtest.h>

#include "core/error.hpp"

namespace cosegraph::evaluation {
namespace {

// Six points: one was removed, one has no true label. The labelling names the labels in another
// order.
Cloud input() {
  return {.xyz = std::vector<float>(18),
          .label = {0, 0, 1, 1, 0, kNoLabel},
          .label_names = {"body", "handle"},
          .dense_index = {0, 1, 2, 3, kNoPoint, 1}};
}

Labelling labelling() {
  return {.label_names = {"handle", "body"}, .point_label = {1, 0, 0, 0}};
}

const std::vector<std::string> kNames{"body", "handle"};

TEST(Figures, CompareLabelsByNameOverThePointsThatCount) {
  const Comparison comparison = compare(input(), labelling(), kNames);
  EXPECT_EQ(comparison.truth, (std::vector<std::int32_t>{0, 0, 1, 1}));
  EXPECT_EQ(comparison.given, (std::vector<std::int32_t>{0, 1, 1, 1}));
}

TEST(Figures, AreTheMeasuresOfThatComparison) {
  const Figures figures = figures_of(compare(input(), labelling(), kNames));
  EXPECT_DOUBLE_EQ(figures.accuracy, 0.75);
  EXPECT_DOUBLE_EQ(figures.missing, 0.25);      // of body 1 of 2, of handle 2 of 2
  EXPECT_DOUBLE_EQ(figures.false_alarm, 0.25);  // 1 of 1 and 2 of 3
  EXPECT_DOUBLE_EQ(figures.hamming(), 0.25);
  EXPECT_DOUBLE_EQ(figures.rand, 0.5);  // 3 of 6 pairs of points
  EXPECT_GT(figures.gce, 0.0);
  EXPECT_LE(figures.lce, figures.gce);
}

TEST(Figures, AComparisonAddsOneInAllToAConfusion) {
  std::vector<double> fraction;
  for (int i = 0; i < 2; ++i) add_to(fraction, compare(input(), labelling(), kNames), 2);
  EXPECT_EQ(fraction, (std::vector<double>{0.5, 0.5, 0.0, 1.0}));
}

TEST(Figures, NothingToCompareAndUnknownLabelsAreRefused) {
  Cloud cloud = input();
  EXPECT_THROW(compare(cloud, labelling(), {"body"}), InputError);
  cloud.dense_index.assign(6, kNoPoint);
  EXPECT_THROW(compare(cloud, labelling(), kNames), InputError);
}

}  // namespace
}  // namespace cosegraph::evaluation
