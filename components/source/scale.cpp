#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/nearest.hpp"
#include "source/grid.hpp"
#include "source/source.hpp"

namespace cosegraph::source {
namespace {

using Eigen::Vector3d;

constexpr double kAreaToScale = 1.433;    // 1 / mean of sqrt(visible area / mesh area)
constexpr double kExtentToScale = 2.087;  // 1 / mean of percentile / sqrt(mesh area)
constexpr double kExtentPercentile = 0.9;
constexpr double kEvenCell = 1.0 / 12.0;  // lengths in median distances to the centroid
constexpr double kDisc = 1.0 / 5.0;

Vector3d point(const std::vector<float>& xyz, std::size_t i) {
  return Eigen::Map<const Eigen::Vector3f>(&xyz[3 * i]).cast<double>();
}

double percentile(std::vector<double> values, double fraction) {
  const auto rank = static_cast<std::size_t>(fraction * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(rank));
  return values[rank];
}

Vector3d middle(const std::vector<float>& xyz, const std::vector<double>& weight) {
  Vector3d sum = Vector3d::Zero();
  double total = 0.0;
  for (std::size_t i = 0; i < weight.size(); ++i) {
    sum += weight[i] * point(xyz, i);
    total += weight[i];
  }
  return sum / total;
}

std::vector<double> distances(const std::vector<float>& xyz, const Vector3d& from) {
  std::vector<double> result(xyz.size() / 3);
  for (std::size_t i = 0; i < result.size(); ++i) result[i] = (point(xyz, i) - from).norm();
  return result;
}

// Distances to the centroid of the points that are not far outliers (beyond twice the 90 %
// distance), all weighing the same.
std::vector<double> centroid_distances(const std::vector<float>& xyz) {
  std::vector<double> weight(xyz.size() / 3, 1.0);
  std::vector<double> result = distances(xyz, middle(xyz, weight));
  for (int repeat = 0; repeat < 3; ++repeat) {
    const double limit = 2.0 * percentile(result, 0.9);
    for (std::size_t i = 0; i < weight.size(); ++i) weight[i] = result[i] <= limit ? 1.0 : 0.0;
    result = distances(xyz, middle(xyz, weight));
  }
  return result;
}

double median_distance(const std::vector<float>& xyz) {
  const double result = percentile(centroid_distances(xyz), 0.5);
  if (!(result > 0.0)) throw InputError("the points have no extent: most of them coincide");
  return result;
}

// The points thinned to even density, whatever the sensor's.
std::vector<float> evened(const std::vector<float>& xyz) {
  std::vector<float> even = cell_means(xyz, group_by_cell(xyz, kEvenCell * median_distance(xyz)));
  return cell_means(xyz, group_by_cell(xyz, kEvenCell * median_distance(even)));
}

// Every point stands for its share of the disc around it: pi r^2 / (number of points within r).
// The sum is the area whatever the points' spacing, and half a disc too much along an edge. Points
// with hardly any neighbours are outliers.
double surface_area(const std::vector<float>& xyz, double radius) {
  const NearestNeighbours tree(xyz);
  std::vector<double> neighbours(xyz.size() / 3);
  for (std::size_t i = 0; i < neighbours.size(); ++i)
    neighbours[i] =
        static_cast<double>(tree.within(&xyz[3 * i], static_cast<float>(radius)).size());
  const double fewest = percentile(neighbours, 0.5) / 8.0;
  double area = 0.0;
  for (const double count : neighbours)
    if (count >= fewest) area += std::numbers::pi * radius * radius / count;
  return area;
}

}  // namespace

double estimate_scale(const std::vector<float>& xyz, ScaleRule rule) {
  if (xyz.empty()) throw InputError("no points to estimate a scale from");
  if (rule == ScaleRule::fixed) return 1.0;
  const std::vector<float> even = evened(xyz);
  if (rule == ScaleRule::extent)
    return kExtentToScale * percentile(centroid_distances(even), kExtentPercentile);
  return kAreaToScale * std::sqrt(surface_area(even, kDisc * median_distance(even)));
}

}  // namespace cosegraph::source
