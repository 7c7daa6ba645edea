#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "core/nearest.hpp"
#include "sink/sink.hpp"

namespace cosegraph::sink {
namespace {

using Eigen::Vector3f;

constexpr int kSupersampling = 2;  // drawn this many times larger, then averaged
constexpr int kMinWidth = 64;      // of a panel's image, pixels
constexpr int kMargin = 16;
constexpr int kTitleHeight = 30;
constexpr int kSubtitleHeight = 22;
constexpr int kLegendHeight = 28;  // of one row
constexpr int kSwatch = 14;
constexpr std::size_t kMostText = 200;     // bytes of a name or title that are drawn
constexpr std::size_t kMostEntries = 100;  // of the legend
constexpr float kFill = 0.90F;             // share of the image that the points extend over

const cv::Scalar kInk(40, 40, 40);
const cv::Scalar kFaintInk(110, 110, 110);

cv::Vec3f bgr(const std::array<float, 3>& rgb) {
  return 255.0F * cv::Vec3f(rgb[2], rgb[1], rgb[0]);
}

// A visible point in image coordinates (pixels of the supersampled image).
struct Dot {
  float x, y;
  float depth;
  float shade;  // 0 .. 1
  std::int32_t group;
};

bool is_finite(const float* p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

std::vector<std::size_t> finite_indices(const Cloud& cloud) {
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (is_finite(&cloud.xyz[3 * i])) result.push_back(i);
  return result;
}

Vector3f position(const Cloud& cloud, std::size_t i) {
  return Eigen::Map<const Vector3f>(&cloud.xyz[3 * i]);
}

// Where the picture is taken from. Rows of `axes`: right, down, forward.
struct View {
  Vector3f eye;
  Eigen::Matrix3f axes;
};

// From the sensor toward the points' centroid, the sensor's y axis pointing down. A cloud that
// lies around its sensor (a raw object in its own coordinates) is seen from outside instead.
View view_of(const Cloud& cloud, const std::vector<std::size_t>& points) {
  Vector3f centroid = Vector3f::Zero();
  for (const std::size_t i : points)
    centroid += position(cloud, i) / static_cast<float>(points.size());
  float radius = 0.0F;
  for (const std::size_t i : points)
    radius += (position(cloud, i) - centroid).squaredNorm() / static_cast<float>(points.size());
  radius = std::sqrt(radius);
  View view{.eye = Eigen::Map<const Vector3f>(cloud.origin.data())};
  if ((centroid - view.eye).norm() <= 1.2F * radius)
    view.eye = centroid - Vector3f(0.0F, 0.0F, 6.0F * std::max(radius, 1e-6F));
  const Vector3f forward = (centroid - view.eye).normalized();
  Vector3f right = Vector3f::UnitY().cross(forward);
  if (right.norm() < 1e-3F) right = Vector3f::UnitX();
  right.normalize();
  view.axes.row(0) = right;
  view.axes.row(1) = forward.cross(right);
  view.axes.row(2) = forward;
  return view;
}

// Brightness of a surface lit from the eye.
float shade_of(const Cloud& cloud, std::size_t i, const Vector3f& eye) {
  if (cloud.normal.empty()) return 1.0F;
  const Vector3f normal = Eigen::Map<const Vector3f>(&cloud.normal[3 * i]);
  const Vector3f toward = (eye - position(cloud, i)).normalized();
  const float cosine = std::abs(normal.dot(toward));
  return std::isfinite(cosine) ? 0.6F + 0.4F * std::min(cosine, 1.0F) : 1.0F;
}

// Range of the values but for the outermost 0.2 % on either side.
std::pair<float, float> extent(std::vector<float> values) {
  const auto low = static_cast<std::ptrdiff_t>(values.size() / 500);
  const auto high = static_cast<std::ptrdiff_t>(values.size()) - 1 - low;
  std::ranges::nth_element(values, values.begin() + low);
  const float lowest = values[static_cast<std::size_t>(low)];
  std::ranges::nth_element(values, values.begin() + high);
  return {lowest, values[static_cast<std::size_t>(high)]};
}

// Scales and shifts the dots so that they fill the image; returns the scale.
float fit_to_image(std::vector<Dot>& dots, cv::Size size) {
  std::vector<float> x, y;
  for (const auto& dot : dots) {
    x.push_back(dot.x);
    y.push_back(dot.y);
  }
  const auto [left, right] = extent(std::move(x));
  const auto [top, bottom] = extent(std::move(y));
  const auto width = static_cast<float>(size.width);
  const auto height = static_cast<float>(size.height);
  const float scale = kFill * std::min(width / std::max(right - left, 1e-9F),
                                       height / std::max(bottom - top, 1e-9F));
  for (auto& dot : dots) {
    dot.x = 0.5F * width + scale * (dot.x - 0.5F * (left + right));
    dot.y = 0.5F * height + scale * (dot.y - 0.5F * (top + bottom));
  }
  return scale;
}

// The median distance between neighbouring points as seen from the eye, as an angle.
float angular_spacing(const Cloud& cloud, const std::vector<std::size_t>& points,
                      const View& view) {
  std::vector<float> xyz;
  for (const std::size_t i : points)
    xyz.insert(xyz.end(), &cloud.xyz[3 * i], &cloud.xyz[3 * i] + 3);
  const NearestNeighbours near(xyz);
  std::vector<float> spacing;
  const std::size_t step = std::max<std::size_t>(1, points.size() / 1000);
  for (std::size_t p = 0; p < points.size(); p += step) {
    const auto found = near.nearest(&xyz[3 * p], 5);
    const float depth = (position(cloud, points[p]) - view.eye).norm();
    spacing.push_back(std::sqrt(found.back().squared_distance) / std::max(depth, 1e-9F));
  }
  const auto middle = spacing.begin() + static_cast<std::ptrdiff_t>(spacing.size() / 2);
  std::ranges::nth_element(spacing, middle);
  return *middle;
}

// The dots of a panel and their common radius in pixels.
struct Dots {
  std::vector<Dot> dot;
  float radius = 1.0F;
};

Dots project(const Panel& panel, cv::Size size) {
  const Cloud& cloud = *panel.cloud;
  const auto points = finite_indices(cloud);
  if (points.empty()) return {};
  const View view = view_of(cloud, points);
  Dots result;
  for (const std::size_t i : points) {
    const Vector3f p = view.axes * (position(cloud, i) - view.eye);
    if (!(p.z() > 1e-6F)) continue;
    const float x = p.x() / p.z();
    const float y = p.y() / p.z();
    if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(p.z())) continue;
    result.dot.push_back({x, y, p.z(), shade_of(cloud, i, view.eye), panel.group[i]});
  }
  if (result.dot.empty()) return {};
  const float scale = fit_to_image(result.dot, size);
  const float spacing = scale * angular_spacing(cloud, points, view);
  result.radius = std::clamp(spacing, 1.0F, 0.05F * static_cast<float>(size.height));
  return result;
}

// `value` as a pixel in -1 .. size; the dots of an odd cloud can be anywhere.
int pixel(float value, int size) {
  return value > -1.0F ? static_cast<int>(std::min(value, static_cast<float>(size))) : -1;
}

// Calls `visit(row, column, squared distance)` for the pixels of a disc.
void for_each_pixel(const Dot& dot, float radius, cv::Size size, auto visit) {
  const int top = std::max(0, pixel(std::ceil(dot.y - radius), size.height));
  const int bottom = std::min(size.height - 1, pixel(std::floor(dot.y + radius), size.height));
  const int left = std::max(0, pixel(std::ceil(dot.x - radius), size.width));
  const int right = std::min(size.width - 1, pixel(std::floor(dot.x + radius), size.width));
  for (int row = top; row <= bottom; ++row)
    for (int column = left; column <= right; ++column) {
      const float dx = static_cast<float>(column) - dot.x;
      const float dy = static_cast<float>(row) - dot.y;
      if (const float square = dx * dx + dy * dy; square <= radius * radius)
        visit(row, column, square);
    }
}

// Per pixel the visible dot, -1 for background, and its depth. Among the dots of the foremost
// surface a pixel belongs to the one with the nearest centre, so that discs do not overlap.
struct Visible {
  cv::Mat1i dot;
  cv::Mat1f depth;
};

Visible visible_dots(const Dots& dots, cv::Size size, float thickness) {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  Visible result{cv::Mat1i(size, -1), cv::Mat1f(size, kFar)};
  for (const auto& dot : dots.dot)
    for_each_pixel(dot, dots.radius, size, [&](int row, int column, float) {
      result.depth(row, column) = std::min(result.depth(row, column), dot.depth);
    });
  cv::Mat1f nearest(size, kFar);
  for (std::size_t d = 0; d < dots.dot.size(); ++d)
    for_each_pixel(dots.dot[d], dots.radius, size, [&](int row, int column, float square) {
      if (dots.dot[d].depth > result.depth(row, column) + thickness) return;
      if (square >= nearest(row, column)) return;
      nearest(row, column) = square;
      result.dot(row, column) = static_cast<int>(d);
    });
  return result;
}

// Darkens pixels that lie behind the middle of their surroundings, as creases and depth steps do,
// which makes shapes readable without normals. A plane stays as it is.
float occlusion(const cv::Mat1f& depth, int row, int column, float range) {
  constexpr int kReach = 3 * kSupersampling;
  constexpr int kSteps[4][2] = {{0, 1}, {1, 1}, {1, 0}, {1, -1}};
  const auto depth_at = [&](int r, int c) {
    const bool inside = r >= 0 && c >= 0 && r < depth.rows && c < depth.cols;
    return inside ? depth(r, c) : std::numeric_limits<float>::infinity();
  };
  float sum = 0.0F;
  for (const auto& step : kSteps) {
    const int down = kReach * step[0];
    const int right = kReach * step[1];
    const float middle =
        0.5F * (depth_at(row + down, column + right) + depth_at(row - down, column - right));
    sum += std::clamp((depth(row, column) - middle) / range, 0.0F, 0.04F);
  }
  return std::exp(-6.0F * sum);
}

// Colours for groups 0 .. count-1 of which no two that touch in the image are alike, as far as the
// palette reaches: each group in turn takes the colour that is least used among those free.
std::vector<std::int32_t> distinct_colours(const Dots& dots, const Visible& visible,
                                           std::size_t count) {
  constexpr std::size_t kColours = 12;
  std::vector<std::set<std::size_t>> touch(count);  // groups of smaller number
  const auto meet = [&](int first, int second) {
    if (first < 0 || second < 0) return;
    const std::int32_t a = dots.dot[static_cast<std::size_t>(first)].group;
    const std::int32_t b = dots.dot[static_cast<std::size_t>(second)].group;
    if (a < 0 || b < 0) return;
    if (a != b)
      touch[static_cast<std::size_t>(std::max(a, b))].insert(
          static_cast<std::size_t>(std::min(a, b)));
  };
  for (int row = 0; row + 1 < visible.dot.rows; ++row)
    for (int column = 0; column + 1 < visible.dot.cols; ++column) {
      meet(visible.dot(row, column), visible.dot(row, column + 1));
      meet(visible.dot(row, column), visible.dot(row + 1, column));
    }
  std::vector<std::int32_t> result;
  std::vector<int> used(kColours, 0);
  for (std::size_t group = 0; group < count; ++group) {
    std::vector<int> cost = used;
    for (const std::size_t other : touch[group]) {
      int& of_colour = cost[static_cast<std::size_t>(result[other])];
      of_colour = std::min(of_colour + (1 << 20), 1 << 30);
    }
    const auto colour = std::ranges::min_element(cost) - cost.begin();
    result.push_back(static_cast<std::int32_t>(colour));
    ++used[static_cast<std::size_t>(colour)];
  }
  return result;
}

// `colours` maps the groups of a named panel to the palette.
cv::Mat3b draw_points(const Panel& panel, std::vector<std::int32_t> colours, cv::Size pixels) {
  const cv::Size size = pixels * kSupersampling;
  cv::Mat3f image(size, cv::Vec3f::all(255.0F));
  const Dots dots = project(panel, size);
  if (!dots.dot.empty()) {
    std::vector<float> depths;
    for (const auto& dot : dots.dot) depths.push_back(dot.depth);
    const auto [nearest, farthest] = extent(std::move(depths));
    const float range = std::max(farthest - nearest, 1e-3F * nearest);
    const Visible visible = visible_dots(dots, size, 0.02F * range);
    if (panel.names.empty()) {
      const std::int32_t last = *std::ranges::max_element(panel.group);
      colours = distinct_colours(dots, visible, static_cast<std::size_t>(last + 1));
    }
    for (int row = 0; row < size.height; ++row)
      for (int column = 0; column < size.width; ++column) {
        if (visible.dot(row, column) < 0) continue;
        const Dot& dot = dots.dot[static_cast<std::size_t>(visible.dot(row, column))];
        const auto colour =
            palette(dot.group < 0 ? kNoLabel : colours[static_cast<std::size_t>(dot.group)]);
        image(row, column) = dot.shade * occlusion(visible.depth, row, column, range) * bgr(colour);
      }
  }
  cv::Mat3f small;
  cv::resize(image, small, pixels, 0, 0, cv::INTER_AREA);
  cv::Mat3b result;
  small.convertTo(result, CV_8UC3);
  return result;
}

struct Font {
  int face;
  double size;
  cv::Scalar ink;
};
const Font kTitleFont{cv::FONT_HERSHEY_DUPLEX, 0.62, kInk};
const Font kSubtitleFont{cv::FONT_HERSHEY_SIMPLEX, 0.46, kFaintInk};
const Font kLegendFont{cv::FONT_HERSHEY_SIMPLEX, 0.5, kInk};

// Somewhat smaller over narrow panels.
Font fitted(Font font, int panel_width) {
  font.size *= std::clamp(panel_width / 320.0, 0.8, 1.0);
  return font;
}

int text_width(const std::string& text, const Font& font) {
  int baseline = 0;
  return cv::getTextSize(text, font.face, font.size, 1, &baseline).width;
}

// Shortened at the end to fit into `width`. `at` is the left end of the base line.
void put_text(cv::Mat3b& image, std::string text, cv::Point at, const Font& font, int width) {
  text.resize(std::min(text.size(), kMostText));
  while (text.size() > 3 && text_width(text, font) > width)
    text = text.substr(0, text.size() - 4) + "...";
  cv::putText(image, text, at, font.face, font.size, font.ink, 1, cv::LINE_AA);
}

// All names of all panels in order of appearance; a name's position is its colour.
std::vector<std::string> legend_names(std::span<const Panel> panels) {
  std::vector<std::string> result;
  std::set<std::string> known;
  for (const auto& panel : panels)
    for (const auto& name : panel.names)
      if (known.insert(name).second) result.push_back(name);
  return result;
}

struct LegendEntry {
  cv::Point at;  // top left, relative to the legend
  std::string name;
};

std::vector<LegendEntry> legend_layout(const std::vector<std::string>& names, int width) {
  std::vector<LegendEntry> result;
  cv::Point at(0, 0);
  for (const auto& name : std::span(names).first(std::min(names.size(), kMostEntries))) {
    const int wide = kSwatch + 8 + text_width(name.substr(0, kMostText), kLegendFont) + 24;
    if (at.x > 0 && at.x + wide > width) at = {0, at.y + kLegendHeight};
    result.push_back({at, name});
    at.x += wide;
  }
  return result;
}

void draw_legend(cv::Mat3b& image, const std::vector<LegendEntry>& entries, cv::Point corner,
                 int width) {
  for (std::size_t e = 0; e < entries.size(); ++e) {
    const cv::Point at = corner + entries[e].at;
    const cv::Vec3f colour = bgr(palette(static_cast<std::int32_t>(e)));
    cv::rectangle(image, {at.x, at.y + 5, kSwatch, kSwatch},
                  cv::Scalar(colour[0], colour[1], colour[2]), cv::FILLED);
    put_text(image, entries[e].name, {at.x + kSwatch + 8, at.y + 17}, kLegendFont,
             width - entries[e].at.x - kSwatch - 8);
  }
}

void check_panels(std::span<const Panel> panels, const Layout& layout) {
  if (panels.empty()) throw InputError("a picture needs at least one panel");
  if (layout.columns < 1) throw ParameterError("columns: a picture needs at least one");
  if (layout.panel_width < kMinWidth)
    throw ParameterError("panel_width: at least " + std::to_string(kMinWidth) + " pixels");
  for (const auto& panel : panels) {
    if (panel.cloud == nullptr) throw InputError("panel '" + panel.title + "' has no cloud");
    if (panel.group.size() != panel.cloud->size())
      throw InputError("panel '" + panel.title + "' has " + std::to_string(panel.group.size()) +
                       " groups for " + std::to_string(panel.cloud->size()) + " points");
    for (const std::int32_t group : panel.group)
      if (group < kNoLabel ||
          (!panel.names.empty() && group >= static_cast<std::int32_t>(panel.names.size())))
        throw InputError("panel '" + panel.title + "' has no name for group " +
                         std::to_string(group));
  }
}

void draw_panel(cv::Mat3b& image, const Panel& panel, cv::Point corner, cv::Size size,
                const std::vector<std::string>& names) {
  std::map<std::string, std::int32_t> place;
  for (const auto& name : names) place.emplace(name, static_cast<std::int32_t>(place.size()));
  std::vector<std::int32_t> colours;
  for (const auto& name : panel.names) colours.push_back(place.at(name));
  put_text(image, panel.title, corner + cv::Point(0, 21), fitted(kTitleFont, size.width),
           size.width);
  put_text(image, panel.subtitle, corner + cv::Point(0, kTitleHeight + 13),
           fitted(kSubtitleFont, size.width), size.width);
  const cv::Rect frame(corner + cv::Point(0, kTitleHeight + kSubtitleHeight), size);
  draw_points(panel, std::move(colours), size).copyTo(image(frame));
}

}  // namespace

std::string draw_png(std::span<const Panel> panels, const Layout& layout) {
  check_panels(panels, layout);
  const int count = static_cast<int>(panels.size());
  const int across = std::min(layout.columns, count);
  const cv::Size size(layout.panel_width, layout.panel_width * 5 / 6);
  const int rows = (count + across - 1) / across;
  const cv::Size cell(size.width + kMargin, kTitleHeight + kSubtitleHeight + size.height + kMargin);
  const int width = across * cell.width - kMargin;
  const auto names = legend_names(panels);
  const auto entries = layout.legend ? legend_layout(names, width) : std::vector<LegendEntry>{};
  const int legend_height = entries.empty() ? 0 : entries.back().at.y + kLegendHeight;
  cv::Mat3b image(rows * cell.height + legend_height + kMargin, width + 2 * kMargin,
                  cv::Vec3b::all(255));
  for (int p = 0; p < count; ++p)
    draw_panel(image, panels[static_cast<std::size_t>(p)],
               {kMargin + p % across * cell.width, kMargin + p / across * cell.height}, size,
               names);
  draw_legend(image, entries, {kMargin, kMargin + rows * cell.height - kMargin / 2}, width);
  std::vector<unsigned char> bytes;
  cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 6});
  return {bytes.begin(), bytes.end()};
}

}  // namespace cosegraph::sink
