#include "tools/evaluation/charts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.hpp"
#include "sink/sink.hpp"

namespace cosegraph::evaluation {
namespace {

using testing::HasSubstr;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kLegendSwatch = 12 * 12;  // pixels of a series' colour in the legend

cv::Mat3b decoded(const std::string& png) {
  const std::vector<unsigned char> bytes(png.begin(), png.end());
  return cv::imdecode(bytes, cv::IMREAD_COLOR);
}

cv::Mat3b bars(const BarChart& chart) {
  return decoded(draw_bars(chart));
}

cv::Mat1b pixels_of(const cv::Mat3b& image, std::int32_t series) {
  const auto rgb = sink::palette(series);
  const cv::Scalar colour(255.0F * rgb[2], 255.0F * rgb[1], 255.0F * rgb[0]);
  cv::Mat1b mask;
  cv::inRange(image, colour - cv::Scalar::all(2), colour + cv::Scalar::all(2), mask);
  return mask;
}

// Pixels of a series' bars, without its place in the legend.
int bar_area(const cv::Mat3b& image, std::int32_t series) {
  return cv::countNonZero(pixels_of(image, series)) - kLegendSwatch;
}

// The height of a series' highest bar.
int tallest(const cv::Mat3b& image, std::int32_t series) {
  cv::Mat1i columns;
  cv::reduce(pixels_of(image, series) / 255, columns, 0, cv::REDUCE_SUM, CV_32S);
  double most = 0.0;
  cv::minMaxLoc(columns, nullptr, &most);
  return static_cast<int>(most);
}

int dark_pixels(const cv::Mat3b& image) {
  cv::Mat1b mask;
  cv::inRange(image, cv::Scalar::all(0), cv::Scalar::all(60), mask);
  return cv::countNonZero(mask);
}

BarChart chart_of(std::vector<double> first, std::vector<double> second = {}) {
  BarChart chart{.title = "title", .subtitle = "subtitle", .unit = "%"};
  for (std::size_t g = 0; g < first.size(); ++g) chart.groups.push_back("group");
  chart.series.push_back({.name = "first", .values = std::move(first)});
  if (!second.empty()) chart.series.push_back({.name = "second", .values = std::move(second)});
  return chart;
}

// The text of the ParameterError that `draw` throws.
std::string refusal(const std::function<void()>& draw) {
  try {
    draw();
  } catch (const ParameterError& error) {
    return error.what();
  }
  return "no ParameterError";
}

TEST(DrawBars, GrowsWithItsGroupsAndSeries) {
  const auto small = bars(chart_of({1, 2, 3, 4, 5, 6, 7, 8}));
  const auto more = bars(chart_of({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}));
  const auto twice = bars(chart_of({1, 2, 3, 4, 5, 6, 7, 8}, {1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_NEAR(more.cols, 1.5 * small.cols, 100.0);
  EXPECT_EQ(more.rows, small.rows);
  EXPECT_GT(twice.cols, small.cols + 200);
}

TEST(DrawBars, HeightsAreInProportionToValues) {
  const auto image = bars(chart_of({40.0}, {10.0}));
  EXPECT_GT(tallest(image, 0), 300);
  EXPECT_NEAR(tallest(image, 0), 4.0 * tallest(image, 1), 8.0);
}

TEST(DrawBars, EqualRatiosAreEqualStepsOfALogarithmicAxis) {
  auto chart = chart_of({0.001}, {0.1});
  chart.series.push_back({.name = "third", .values = {10.0}});
  chart.logarithmic = true;
  const auto image = bars(chart);
  EXPECT_GT(tallest(image, 0), 20);  // although it stands at a power of ten
  const int step = tallest(image, 1) - tallest(image, 0);
  EXPECT_GT(step, 100);
  EXPECT_NEAR(tallest(image, 2) - tallest(image, 1), step, 2.0);
}

TEST(DrawBars, ALogarithmicAxisStartsAtADecade) {
  auto chart = chart_of({0.05}, {0.5});
  chart.logarithmic = true;
  const auto image = bars(chart);
  // Heights over 0.01: log10 5 and log10 50.
  const double ratio = static_cast<double>(tallest(image, 1)) / tallest(image, 0);
  EXPECT_NEAR(ratio, std::log10(50.0) / std::log10(5.0), 0.03);
}

TEST(DrawBars, NaNDrawsNothing) {
  const auto all = bars(chart_of({20.0, 20.0}, {20.0, 20.0}));
  const auto some = bars(chart_of({20.0, 20.0}, {kNone, 20.0}));
  const auto none = bars(chart_of({20.0, 20.0}, {kNone, kNone}));
  EXPECT_EQ(bar_area(some, 0), bar_area(all, 0));
  EXPECT_NEAR(bar_area(some, 1), 0.5 * bar_area(all, 1), 2.0);
  EXPECT_EQ(bar_area(none, 1), 0);
  EXPECT_LT(dark_pixels(some), dark_pixels(all));  // no number either
  EXPECT_FALSE(bars(chart_of({kNone})).empty());
}

TEST(DrawBars, WhiskersReachFromBelowTheEndOfTheBarToAbove) {
  auto chart = chart_of({40.0, 20.0});  // the second has no say in the axis
  const auto plain = bars(chart);
  chart.series[0].errors = {kNone, 15.0};
  const auto with = bars(chart);
  ASSERT_EQ(with.size(), plain.size());
  // On the bar's axis, counted from its foot: 5 is inside the bar, 35 above it.
  const auto box = cv::boundingRect(
      pixels_of(plain, 0)(cv::Rect(plain.cols / 2, 0, plain.cols / 2, plain.rows)));
  const int column = plain.cols / 2 + box.x + box.width / 2;
  const int foot = box.br().y;
  const auto is_dark = [&](const cv::Mat3b& image, double value) {
    const int row = foot - static_cast<int>(value / 20.0 * box.height);
    for (int c = column - 1; c <= column + 1; ++c)
      if (image(row, c)[0] < 60 && image(row, c)[2] < 60) return true;
    return false;
  };
  for (const double value : {7.0, 15.0, 27.0, 33.0}) {
    EXPECT_FALSE(is_dark(plain, value)) << value;
    EXPECT_TRUE(is_dark(with, value)) << value;
  }
  EXPECT_FALSE(is_dark(with, 3.0));
}

TEST(DrawBars, AWhiskerBelowALogarithmicAxisEndsAtItsEdge) {
  auto chart = chart_of({1.0}, {10.0});
  chart.logarithmic = true;
  const auto plain = bars(chart);
  chart.series[0].errors = {2.0};  // down to -1
  const auto with = bars(chart);
  ASSERT_EQ(with.size(), plain.size());
  cv::Mat1b changed;
  cv::extractChannel(cv::Mat(with != plain), changed, 0);
  const int foot =
      cv::boundingRect(pixels_of(plain, 1)(cv::Rect(0, 0, plain.cols, plain.rows - 60))).br().y;
  EXPECT_NEAR(cv::boundingRect(changed).br().y, foot, 3.0);
}

TEST(DrawBars, NegativeValuesHangFromZero) {
  const auto image = bars(chart_of({-10.0}, {10.0}));
  const auto box_of = [&](std::int32_t series) {
    // Without the legend below.
    return cv::boundingRect(pixels_of(image, series)(cv::Rect(0, 0, image.cols, image.rows - 60)));
  };
  EXPECT_NEAR(box_of(0).y, box_of(1).br().y, 3.0);
  EXPECT_NEAR(box_of(0).height, box_of(1).height, 3.0);
}

TEST(DrawBars, TwentyFourSeriesHaveDifferentColours) {
  BarChart chart{.title = "", .subtitle = "", .unit = "", .groups = {"group"}};
  for (int s = 0; s < 24; ++s) chart.series.push_back({.name = "s", .values = {1.0}});
  const auto image = bars(chart);
  std::vector<cv::Vec3b> colours;  // along a line across the bars
  for (int column = 0; column + 2 < image.cols; ++column) {
    const cv::Vec3b colour = image(200, column);
    const bool is_flat = colour == image(200, column + 1) && colour == image(200, column + 2);
    const bool is_grey = colour[0] == colour[1] && colour[1] == colour[2];
    if (is_flat && !is_grey && std::ranges::find(colours, colour) == colours.end())
      colours.push_back(colour);
  }
  EXPECT_EQ(colours.size(), 24U);
}

TEST(DrawBars, StaysWithinASensibleWidth) {
  BarChart chart{.title = "title", .subtitle = "", .unit = "s"};
  for (int g = 0; g < 5; ++g) chart.groups.push_back("group");
  for (int s = 0; s < 24; ++s)
    chart.series.push_back({.name = std::string(200, 'x'), .values = std::vector(5, 12.3)});
  EXPECT_LE(bars(chart).cols, 2200);
}

// Text that ran into the border would leave ink there.
void expect_white_border(const cv::Mat3b& image) {
  constexpr int kBorder = 8;
  cv::Mat3b border = image.clone();
  border(cv::Rect(kBorder, kBorder, image.cols - 2 * kBorder, image.rows - 2 * kBorder)) =
      cv::Vec3b::all(255);
  double darkest = 0.0;
  cv::minMaxLoc(border.reshape(1), &darkest);
  EXPECT_EQ(darkest, 255.0);
}

TEST(DrawBars, LongTextIsNotClipped) {
  auto chart = chart_of({1234567.8}, {0.1});
  chart.title = std::string(300, 'w');
  chart.subtitle = std::string(100, 'w') + " words " + std::string(100, 'w');
  chart.unit = "points per second";
  chart.groups[0] = std::string(100, 'w');
  chart.series[0].name = std::string(100, 'w');
  expect_white_border(bars(chart));
}

TEST(DrawBars, IsTheSameInEveryRun) {
  EXPECT_EQ(draw_bars(chart_of({1, 2}, {3, 4})), draw_bars(chart_of({1, 2}, {3, 4})));
}

TEST(DrawBars, RefusesWhatDoesNotFitAndNamesTheSeries) {
  const auto refused = [](const BarChart& chart) { return refusal([&] { draw_bars(chart); }); };
  auto chart = chart_of({1.0, 2.0}, {1.0});
  EXPECT_THAT(refused(chart), HasSubstr("series 'second' has 1 values for 2 groups"));
  chart = chart_of({1.0, 2.0}, {1.0, 2.0});
  chart.series[0].errors = {1.0};
  EXPECT_THAT(refused(chart), HasSubstr("series 'first' has 1 errors for 2 groups"));
  chart.series[0].errors = {1.0, -1.0};
  EXPECT_THAT(refused(chart), HasSubstr("series 'first' has a standard error"));
  EXPECT_THAT(refused(chart_of({1.0, kInfinity})), HasSubstr("series 'first' has an infinite"));
  chart = chart_of({1.0}, {0.0});
  chart.logarithmic = true;
  EXPECT_THAT(refused(chart), HasSubstr("series 'second' has a value on the logarithmic axis"));
  chart.series.clear();
  EXPECT_THAT(refused(chart), HasSubstr("chart 'title' needs"));
}

ConfusionMatrix matrix_of(std::vector<double> fraction) {
  ConfusionMatrix matrix{.title = "title", .subtitle = "subtitle"};
  const auto count = static_cast<std::size_t>(std::sqrt(fraction.size()));
  for (std::size_t i = 0; i < count; ++i) matrix.names.push_back("p" + std::to_string(i));
  matrix.fraction = std::move(fraction);
  return matrix;
}

cv::Mat3b confusion(const ConfusionMatrix& matrix) {
  return decoded(draw_confusions(std::span(&matrix, 1)));
}

// Pixels of cells as dark as a share of all of the row.
int darkest_cells(const cv::Mat3b& image) {
  cv::Mat1b mask;
  cv::inRange(image, cv::Scalar(90, 35, 3), cv::Scalar(102, 45, 13), mask);
  return cv::countNonZero(mask);
}

int coloured_pixels(const cv::Mat3b& image) {
  int count = 0;
  for (const auto& pixel : image)
    if (pixel[0] > pixel[2] + 2) ++count;
  return count;
}

TEST(DrawConfusions, ShadesACellByItsShareOfItsRow) {
  // The rows' shares of all points are not seen in the shades.
  const int even = darkest_cells(confusion(matrix_of({0.5, 0.0, 0.0, 0.5})));
  EXPECT_GT(even, 3000);
  EXPECT_NEAR(darkest_cells(confusion(matrix_of({0.9, 0.0, 0.0, 0.1}))), even, 60);
  // One row right, the other mixed.
  EXPECT_NEAR(darkest_cells(confusion(matrix_of({0.5, 0.0, 0.25, 0.25}))), even / 2, 60);
}

TEST(DrawConfusions, TheTrueLabelIsTheRow) {
  const auto image = confusion(matrix_of({0.0, 0.5, 0.0, 0.5}));  // all labelled p1
  cv::Mat1b mask;
  cv::inRange(image, cv::Scalar(90, 35, 3), cv::Scalar(102, 45, 13), mask);
  const auto box = cv::boundingRect(mask);
  EXPECT_NEAR(box.height, 2.0 * box.width, 4.0);  // a column of two cells
}

TEST(DrawConfusions, AnEmptyMatrixHasNoShades) {
  EXPECT_EQ(coloured_pixels(confusion(matrix_of({0.0, 0.0, 0.0, 0.0}))), 0);
  EXPECT_GT(coloured_pixels(confusion(matrix_of({0.9, 0.1, 0.0, 0.0}))), 2000);
}

TEST(DrawConfusions, WrapsIntoRowsAndGrowsWithTheLabels) {
  const std::vector<ConfusionMatrix> matrices(5, matrix_of({0.5, 0.0, 0.0, 0.5}));
  const auto one = decoded(draw_confusions(std::span(matrices).first(1)));
  const auto row = decoded(draw_confusions(std::span(matrices).first(2)));
  const auto wrapped = decoded(draw_confusions(matrices, 2));
  EXPECT_GT(row.cols, 2 * one.cols - 100);
  EXPECT_EQ(wrapped.cols, row.cols);
  EXPECT_GT(wrapped.rows, row.rows + 2 * 150);
  std::vector<double> ten(100, 0.01);
  EXPECT_GT(confusion(matrix_of(ten)).rows, one.rows + 100);
}

TEST(DrawConfusions, NineteenCategoriesFitIntoASensibleWidth) {
  std::vector<ConfusionMatrix> matrices(19, matrix_of(std::vector(144, 1.0 / 144)));
  for (auto& matrix : matrices) matrix.names[3] = "left upper front leg of the armadillo";
  EXPECT_LE(decoded(draw_confusions(matrices)).cols, 2200);
}

TEST(DrawConfusions, LongTextIsNotClipped) {
  auto matrix = matrix_of({0.5, 0.0, 0.0, 0.5});
  matrix.title = matrix.subtitle = matrix.names[0] = matrix.names[1] = std::string(200, 'w');
  expect_white_border(confusion(matrix));
}

TEST(DrawConfusions, IsTheSameInEveryRun) {
  const std::vector<ConfusionMatrix> matrices(2, matrix_of({0.5, 0.1, 0.0, 0.4}));
  EXPECT_EQ(draw_confusions(matrices), draw_confusions(matrices));
}

TEST(DrawConfusions, RefusesWhatIsNoConfusionMatrixAndNamesIt) {
  const auto refused = [](const ConfusionMatrix& matrix) {
    return refusal([&] { draw_confusions(std::span(&matrix, 1)); });
  };
  auto matrix = matrix_of({0.5, 0.0, 0.0, 0.5});
  matrix.names.push_back("one more");
  EXPECT_THAT(refused(matrix), HasSubstr("matrix 'title' has 4 fractions for 3 names"));
  EXPECT_THAT(refused(matrix_of({0.5, 0.0, -0.5, 1.0})),
              HasSubstr("matrix 'title' has a fraction"));
  EXPECT_THAT(refused(matrix_of({0.5, 0.0, kNone, 0.5})),
              HasSubstr("matrix 'title' has a fraction"));
  EXPECT_THAT(refused(matrix_of({30.0, 0.0, 0.0, 20.0})),
              HasSubstr("matrix 'title' has fractions"));
  EXPECT_THAT(refused(matrix_of({})), HasSubstr("matrix 'title' has no labels"));
  EXPECT_THAT(refusal([] { draw_confusions({}); }), HasSubstr("at least one"));
  const auto good = matrix_of({0.5, 0.0, 0.0, 0.5});
  EXPECT_THAT(refusal([&] { draw_confusions(std::span(&good, 1), 0); }), HasSubstr("columns"));
}

}  // namespace
}  // namespace cosegraph::evaluation
