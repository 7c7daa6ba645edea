#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.hpp"
#include "sink/sink.hpp"

namespace cosegraph::sink {
namespace {

cv::Mat3b decoded(const std::string& png) {
  const std::vector<unsigned char> bytes(png.begin(), png.end());
  return cv::imdecode(bytes, cv::IMREAD_COLOR);
}

// Pixels of a label's colour, unshaded.
cv::Mat1b pixels_of(const cv::Mat3b& image, std::int32_t label) {
  const auto rgb = palette(label);
  const cv::Scalar colour(255.0F * rgb[2], 255.0F * rgb[1], 255.0F * rgb[0]);
  cv::Mat1b mask;
  cv::inRange(image, colour - cv::Scalar::all(2), colour + cv::Scalar::all(2), mask);
  return mask;
}

cv::Point2d centre_of(const cv::Mat1b& mask) {
  std::vector<cv::Point> points;
  cv::findNonZero(mask, points);
  cv::Point2d sum(0.0, 0.0);
  for (const auto& point : points) sum += cv::Point2d(point);
  return sum / std::max(1.0, static_cast<double>(points.size()));
}

// A square patch facing the sensor, which is at the origin and looks along z.
void add_patch(Cloud& cloud, std::vector<std::int32_t>& group, float x, float y, float z,
               float side, std::int32_t of_group) {
  constexpr int kSteps = 40;
  for (int row = 0; row < kSteps; ++row)
    for (int column = 0; column < kSteps; ++column) {
      const float step = side / kSteps;
      cloud.xyz.insert(cloud.xyz.end(), {x + step * static_cast<float>(column - kSteps / 2),
                                         y + step * static_cast<float>(row - kSteps / 2), z});
      group.push_back(of_group);
    }
  cloud.width = static_cast<std::uint32_t>(cloud.size());
}

struct Scene {
  Cloud cloud;
  std::vector<std::int32_t> group;
  Panel panel(std::vector<std::string> names) const {
    return {.title = "title",
            .subtitle = "subtitle",
            .cloud = &cloud,
            .group = group,
            .names = std::move(names)};
  }
};

// Group 0 to the left, group 1 to the right, group 2 below.
Scene three_patches() {
  Scene scene;
  add_patch(scene.cloud, scene.group, -1.0F, 0.0F, 5.0F, 0.8F, 0);
  add_patch(scene.cloud, scene.group, 1.0F, 0.0F, 5.0F, 0.8F, 1);
  add_patch(scene.cloud, scene.group, 0.0F, 1.0F, 5.0F, 0.8F, 2);
  return scene;
}

std::string png_of(const Panel& panel) {
  return draw_png(std::span(&panel, 1));
}

TEST(DrawPng, ShowsPointsWhereTheSensorSeesThem) {
  const auto scene = three_patches();
  // Without names there is no legend: all coloured pixels are points.
  const auto image = decoded(png_of(scene.panel({})));
  const auto left = centre_of(pixels_of(image, 0));
  const auto right = centre_of(pixels_of(image, 1));
  const auto below = centre_of(pixels_of(image, 2));
  EXPECT_LT(left.x + 100.0, right.x);
  EXPECT_NEAR(left.y, right.y, 3.0);
  EXPECT_GT(below.y, left.y + 50.0);
  EXPECT_NEAR(below.x, 0.5 * (left.x + right.x), 3.0);
}

TEST(DrawPng, FillsTheSurfaceBetweenThePoints) {
  const auto scene = three_patches();
  const auto image = decoded(png_of(scene.panel({})));
  const auto mask = pixels_of(image, 0);
  const auto box = cv::boundingRect(mask);
  const cv::Rect inside(box.x + box.width / 10, box.y + box.height / 10, box.width * 8 / 10,
                        box.height * 8 / 10);
  EXPECT_GT(inside.area(), 5000);
  double lightest = 0.0;
  cv::Mat1b red;
  cv::extractChannel(image(inside), red, 2);  // the group's colour is blue, the background white
  cv::minMaxLoc(red, nullptr, &lightest);
  EXPECT_LT(lightest, 60.0);
}

TEST(DrawPng, NearerPointsHideFartherOnes) {
  Scene scene;
  add_patch(scene.cloud, scene.group, 0.0F, 0.0F, 4.0F, 1.0F, 0);
  add_patch(scene.cloud, scene.group, 0.0F, 0.0F, 6.0F, 1.0F, 1);  // same place, behind
  add_patch(scene.cloud, scene.group, 3.0F, 0.0F, 6.0F, 1.0F, 2);
  const auto image = decoded(png_of(scene.panel({"near", "far", "beside"})));
  // What is left of the hidden group is its swatch in the legend.
  EXPECT_GT(cv::countNonZero(pixels_of(image, 0)), 2000);
  EXPECT_LT(cv::countNonZero(pixels_of(image, 1)), 300);
  EXPECT_GT(cv::countNonZero(pixels_of(image, 2)), 1000);
}

TEST(DrawPng, HasAWhiteBackgroundAndDarkText) {
  const auto scene = three_patches();
  const auto image = decoded(png_of(scene.panel({"a", "b", "c"})));
  EXPECT_EQ(image(0, 0), cv::Vec3b::all(255));
  EXPECT_EQ(image(image.rows - 1, image.cols - 1), cv::Vec3b::all(255));
  double darkest = 255.0;
  cv::minMaxLoc(image(cv::Rect(0, 0, image.cols, 50)).reshape(1), &darkest);
  EXPECT_LT(darkest, 80.0);  // the title
}

TEST(DrawPng, TheSameNameHasTheSameColourInAllPanels) {
  const auto scene = three_patches();
  const Panel panels[] = {scene.panel({"a", "b", "c"}), scene.panel({"c", "a", "b"})};
  const auto image = decoded(draw_png(panels));
  const auto half = [&](int which, std::int32_t label) {
    return centre_of(
        pixels_of(image(cv::Rect(which * image.cols / 2, 0, image.cols / 2, 460)), label));
  };
  // "c", colour 2, is below in the first panel and to the left in the second.
  EXPECT_NEAR(half(0, 0).y, half(1, 2).y, 3.0);
  EXPECT_NEAR(half(0, 0).x, half(1, 2).x, 12.0);
  EXPECT_NEAR(half(0, 2).y, half(1, 1).y, 3.0);
}

TEST(DrawPng, NeighbouringGroupsWithoutNamesDiffer) {
  Scene scene;  // 8 x 8 tiles, more than there are colours
  for (int tile = 0; tile < 64; ++tile)
    add_patch(scene.cloud, scene.group, 0.5F * static_cast<float>(tile % 8),
              0.5F * static_cast<float>(tile / 8), 20.0F, 0.5F, tile);
  const auto image = decoded(png_of(scene.panel({})));
  cv::Mat1b mask(image.size(), 0);
  for (std::int32_t label = 0; label < 12; ++label) mask |= pixels_of(image, label);
  const auto box = cv::boundingRect(mask);
  const auto tile_at = [&](int column, int row) {
    return image(box.y + (2 * row + 1) * box.height / 16,
                 box.x + (2 * column + 1) * box.width / 16);
  };
  for (int row = 0; row < 8; ++row)
    for (int column = 0; column < 7; ++column) {
      EXPECT_GT(cv::norm(tile_at(column, row), tile_at(column + 1, row)), 30.0);
      EXPECT_GT(cv::norm(tile_at(row, column), tile_at(row, column + 1)), 30.0);
    }
}

TEST(DrawPng, PointsWithoutAGroupAreGreyAndRemovedOnesAreLeftOut) {
  auto scene = three_patches();
  for (std::size_t i = 0; i < 1600; ++i) scene.group[i] = kNoLabel;
  for (std::size_t i = 1600; i < 3200; ++i)
    scene.cloud.xyz[3 * i + 1] = std::numeric_limits<float>::quiet_NaN();
  for (auto& group : scene.group) group = group == 2 ? 0 : group;
  const auto image = decoded(png_of(scene.panel({})));
  EXPECT_GT(cv::countNonZero(pixels_of(image, kNoLabel)), 1000);
  EXPECT_GT(cv::countNonZero(pixels_of(image, 0)), 1000);
  EXPECT_EQ(cv::countNonZero(pixels_of(image, 1)), 0);
}

TEST(DrawPng, NormalsShadeTheSurface) {
  auto scene = three_patches();
  for (std::size_t i = 0; i < scene.cloud.size(); ++i)
    scene.cloud.normal.insert(scene.cloud.normal.end(), {0.8F, 0.0F, -0.6F});
  const auto image = decoded(png_of(scene.panel({})));
  EXPECT_LT(cv::countNonZero(pixels_of(image, 0)), 50);  // darker than the plain colour
}

TEST(DrawPng, WrapsIntoRowsOfPanelsOfOneSize) {
  const auto scene = three_patches();
  const std::vector<Panel> panels(5, scene.panel({}));
  const auto one = decoded(draw_png(std::span(panels).first(1)));
  const auto row = decoded(draw_png(std::span(panels).first(2), {.columns = 4}));
  const auto wrapped = decoded(draw_png(panels, {.columns = 2}));
  EXPECT_EQ(row.rows, one.rows);
  EXPECT_GT(row.cols, 2 * one.cols - 60);
  EXPECT_EQ(wrapped.cols, row.cols);
  EXPECT_GT(wrapped.rows, 3 * one.rows - 120);
}

TEST(DrawPng, IsTheSameInEveryRun) {
  const auto scene = three_patches();
  EXPECT_EQ(png_of(scene.panel({"a", "b", "c"})), png_of(scene.panel({"a", "b", "c"})));
}

TEST(DrawPng, TakesEmptyAndTinyClouds) {
  Scene scene;
  EXPECT_FALSE(decoded(png_of(scene.panel({}))).empty());
  scene.cloud.xyz = {0.0F, 0.0F, 0.0F};
  scene.cloud.width = 1;
  scene.group = {0};
  EXPECT_FALSE(decoded(png_of(scene.panel({"only"}))).empty());
  scene.cloud.xyz.assign(9, 1.0F);
  scene.cloud.width = 3;
  scene.group = {0, kNoLabel, 0};
  EXPECT_FALSE(decoded(png_of(scene.panel({}))).empty());
}

TEST(DrawPng, SeesARawObjectFromOutside) {
  Scene scene;  // the sensor would be in the middle
  add_patch(scene.cloud, scene.group, 0.0F, 0.0F, 0.3F, 1.0F, 0);
  add_patch(scene.cloud, scene.group, 0.0F, 0.0F, -0.3F, 1.0F, 1);
  const auto image = decoded(png_of(scene.panel({})));
  EXPECT_GT(cv::countNonZero(pixels_of(image, 0) | pixels_of(image, 1)), 10000);
}

TEST(DrawPng, PanelsCanBeSmaller) {
  const auto scene = three_patches();
  const std::vector<Panel> panels(20, scene.panel({}));
  const auto usual = decoded(draw_png(panels, {.columns = 9}));
  const auto small = decoded(draw_png(panels, {.columns = 9, .panel_width = 220}));
  EXPECT_EQ(usual.cols - small.cols, 9 * (480 - 220));
  EXPECT_EQ(usual.rows - small.rows, 3 * (400 - 183));
  EXPECT_GT(cv::countNonZero(pixels_of(small, 0)), 18 * 500);
}

// Nothing below the last row of panels.
TEST(DrawPng, HasNoLegendWithoutNamesOrWhereNoneIsWanted) {
  const auto scene = three_patches();
  const auto named = decoded(png_of(scene.panel({"a", "b", "c"})));
  const auto unnamed = decoded(png_of(scene.panel({})));
  const Panel panel = scene.panel({"a", "b", "c"});
  const auto unwanted = decoded(draw_png(std::span(&panel, 1), {.legend = false}));
  EXPECT_LT(unnamed.rows, named.rows);
  EXPECT_EQ(unnamed.size(), unwanted.size());
  const cv::Mat below = unnamed(cv::Rect(0, 470, unnamed.cols, unnamed.rows - 470));
  EXPECT_EQ(cv::norm(below, cv::Mat3b(below.size(), cv::Vec3b::all(255)), cv::NORM_INF), 0.0);
}

TEST(DrawPng, RefusesPanelsThatDoNotFit) {
  auto scene = three_patches();
  EXPECT_THROW(draw_png({}), InputError);
  EXPECT_THROW(png_of({.title = "none"}), InputError);
  EXPECT_THROW(png_of(scene.panel({"a", "b"})), InputError);
  const Panel panel = scene.panel({});
  EXPECT_THROW(draw_png(std::span(&panel, 1), {.columns = 0}), ParameterError);
  EXPECT_THROW(draw_png(std::span(&panel, 1), {.panel_width = 10}), ParameterError);
  scene.group.pop_back();
  EXPECT_THROW(png_of(scene.panel({})), InputError);
}

}  // namespace
}  // namespace cosegraph::sink
