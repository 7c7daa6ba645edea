#include "tools/evaluation/charts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/error.hpp"

namespace cosegraph::evaluation {
namespace {

using ::testing::HasSubstr;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

cv::Mat3b decoded(const std::string& png) {
  return cv::imdecode(std::vector<unsigned char>(png.begin(), png.end()), cv::IMREAD_COLOR);
}

// The saturated colours of the picture with their numbers of pixels, most frequent first; text,
// axes and grid are grey.
std::vector<int> coloured_areas(const cv::Mat3b& image) {
  std::map<std::array<int, 3>, int> count;
  for (const cv::Vec3b& pixel : image) {
    const auto [low, high] = std::minmax({pixel[0], pixel[1], pixel[2]});
    if (high - low > 40) ++count[{pixel[0], pixel[1], pixel[2]}];
  }
  std::vector<int> areas;
  for (const auto& [colour, pixels] : count) areas.push_back(pixels);
  std::ranges::sort(areas, std::greater{});
  return areas;
}

BarChart chart_of(std::vector<double> first, std::vector<double> second) {
  BarChart chart{.title = "Errors", .unit = "%"};
  for (std::size_t g = 0; g < first.size(); ++g) chart.groups.push_back("group");
  chart.series = {{.name = "one", .values = std::move(first)},
                  {.name = "two", .values = std::move(second)}};
  return chart;
}

std::string message_of(const std::function<void()>& draw) {
  try {
    draw();
  } catch (const ParameterError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Bars, AValueTwiceAsLargeHasABarOfTwiceTheArea) {
  const auto areas = coloured_areas(decoded(draw_bars(chart_of({20.0}, {40.0}))));
  ASSERT_GE(areas.size(), 2U);
  // The bars are bordered and cut by nothing; the legend's swatches add a little.
  EXPECT_NEAR(static_cast<double>(areas[0]) / areas[1], 2.0, 0.25);
}

TEST(Bars, WithoutAValueThereIsNoBar) {
  const auto both = coloured_areas(decoded(draw_bars(chart_of({40.0}, {40.0}))));
  const auto one = coloured_areas(decoded(draw_bars(chart_of({40.0}, {kNone}))));
  EXPECT_NEAR(both[0], both[1], 0.02 * both[0]);
  EXPECT_GT(one[0], 5 * one[1]);  // what is left of the second is its swatch
}

TEST(Bars, ALogarithmicAxisGivesEveryDecadeTheSameHeight) {
  BarChart chart = chart_of({1.0}, {100.0});
  chart.logarithmic = true;
  const auto two = coloured_areas(decoded(draw_bars(chart)));
  chart.series[1].values = {1.0};
  const auto same = coloured_areas(decoded(draw_bars(chart)));
  EXPECT_NEAR(same[0], same[1], 0.02 * same[0]);
  EXPECT_LT(static_cast<double>(two[0]) / two[1], 10.0);  // linearly it would be a hundred
}

TEST(Bars, WhiskersAndMoreGroupsShow) {
  BarChart chart = chart_of({20.0}, {40.0});
  const std::string plain = draw_bars(chart);
  chart.series[0].errors = {5.0};
  EXPECT_NE(draw_bars(chart), plain);
  EXPECT_GT(
      decoded(draw_bars(chart_of(std::vector<double>(12, 20.0), std::vector<double>(12, 40.0))))
          .cols,
      decoded(plain).cols);
}

TEST(Bars, TwentyFourSeriesHaveColoursOfTheirOwn) {
  BarChart chart = chart_of({50.0}, {50.0});
  chart.series.clear();
  for (int s = 0; s < 24; ++s)
    chart.series.push_back({.name = "series " + std::to_string(s), .values = {50.0}});
  const cv::Mat3b image = decoded(draw_bars(chart));
  EXPECT_LE(image.cols, 2200);
  std::map<std::array<int, 3>, int> count;
  for (const cv::Vec3b& pixel : image) ++count[{pixel[0], pixel[1], pixel[2]}];
  // Bars are large and of one colour each; besides there are the ground and the grid.
  int large = 0;
  for (const auto& [colour, pixels] : count) large += pixels > 1500 ? 1 : 0;
  EXPECT_GE(large, 24);
}

TEST(Bars, TheSameChartIsTheSameBytes) {
  const BarChart chart = chart_of({20.0, 30.0}, {40.0, kNone});
  EXPECT_EQ(draw_bars(chart), draw_bars(chart));
}

TEST(Bars, NumbersThatDoNotFitAreRefusedByName) {
  BarChart chart = chart_of({20.0, 30.0}, {40.0});
  EXPECT_THAT(message_of([&] { draw_bars(chart); }), HasSubstr("two"));
  chart = chart_of({20.0}, {40.0});
  chart.series[0].errors = {1.0, 2.0};
  EXPECT_THAT(message_of([&] { draw_bars(chart); }), HasSubstr("one"));
  chart = chart_of({20.0}, {0.0});
  chart.logarithmic = true;
  EXPECT_THAT(message_of([&] { draw_bars(chart); }), HasSubstr("two"));
}

ConfusionMatrix matrix_of(std::vector<std::string> names, double diagonal) {
  ConfusionMatrix matrix{.title = "Ant", .names = std::move(names)};
  const std::size_t n = matrix.names.size();
  for (std::size_t i = 0; i < n * n; ++i)
    matrix.fraction.push_back(i % (n + 1) == 0 ? diagonal / static_cast<double>(n)
                                               : (1.0 - diagonal) / static_cast<double>(n * n - n));
  return matrix;
}

TEST(Confusions, ARightLabellingIsDarkOnItsDiagonalOnly) {
  const auto ink = [](double diagonal) {
    const ConfusionMatrix matrix = matrix_of({"a", "b", "c"}, diagonal);
    return coloured_areas(decoded(draw_confusions(std::span(&matrix, 1))));
  };
  const auto right = ink(1.0);
  const auto mixed = ink(0.5);
  ASSERT_FALSE(right.empty());
  ASSERT_FALSE(mixed.empty());
  // Three cells of one shade; then the other six have a shade, too, lighter by two.
  ASSERT_GE(mixed.size(), 2U);
  EXPECT_NEAR(mixed[0], 2 * right[0], 0.2 * right[0]);
  EXPECT_NEAR(mixed[1], right[0], 0.2 * right[0]);
  EXPECT_LT(right.size() > 1 ? right[1] : 0, right[0] / 2);
}

TEST(Confusions, WrapIntoRowsAndStandLongNames) {
  const std::vector<ConfusionMatrix> matrices(
      5, matrix_of({"a name that is far too long for a column", "b"}, 0.8));
  const cv::Mat3b row = decoded(draw_confusions(matrices, 5));
  const cv::Mat3b wrapped = decoded(draw_confusions(matrices, 2));
  EXPECT_GT(row.cols, wrapped.cols);
  EXPECT_LT(row.rows, wrapped.rows);
  EXPECT_LE(row.cols, 2200);
}

TEST(Confusions, FractionsThatDoNotFitAreRefusedByName) {
  ConfusionMatrix matrix = matrix_of({"a", "b"}, 0.8);
  matrix.fraction.pop_back();
  EXPECT_THAT(message_of([&] { draw_confusions(std::span(&matrix, 1)); }), HasSubstr("Ant"));
  matrix = matrix_of({"a", "b"}, 0.8);
  matrix.fraction[1] = -0.1;
  EXPECT_THAT(message_of([&] { draw_confusions(std::span(&matrix, 1)); }), HasSubstr("Ant"));
}

}  // namespace
}  // namespace cosegraph::evaluation
