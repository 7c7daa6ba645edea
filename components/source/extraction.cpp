#include "source/extraction.hpp"

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/sample_consensus/ransac.h>
#include <pcl/sample_consensus/sac_model_plane.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/extract_clusters.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <ranges>

#include "core/nearest.hpp"
#include "pcl_console/pcl_console.hpp"
#include "source/grid.hpp"

namespace cosegraph::source {
namespace {

using Indices = std::vector<std::int32_t>;

constexpr std::size_t kMaximumCells = 60000;
constexpr double kFinestCell = 0.0005;  // m
constexpr double kCellsPerTolerance = 4.0;
constexpr double kSmallestPlaneShare = 0.2;
constexpr int kPlaneTrials = 1000;
constexpr std::size_t kPlanePoints = 20000;  // that the plane is estimated from

std::string counted(std::size_t part, std::size_t whole) {
  return std::to_string(part) + " of " + std::to_string(whole) + " points";
}

std::array<double, 6> parse_box(const std::vector<std::string>& text) {
  std::array<double, 6> box{};
  for (std::size_t i = 0; i < box.size(); ++i) {
    Field number = number_field("crop", box[i], -1e9, 1e9, "m", "");
    number.set({text[i]});
  }
  for (int axis = 0; axis < 3; ++axis)
    if (!(box[axis] < box[axis + 3]))
      throw ParameterError("crop: its lower corner is not below its upper corner");
  return box;
}

Indices inside_box(std::span<const float> xyz, const std::vector<std::string>& crop) {
  Indices inside(xyz.size() / 3);
  std::iota(inside.begin(), inside.end(), 0);
  if (crop.empty()) return inside;
  if (crop.size() != 6)
    throw ParameterError("crop: expected six numbers, not " + std::to_string(crop.size()));
  const auto box = parse_box(crop);
  std::erase_if(inside, [&](std::int32_t i) {
    for (int axis = 0; axis < 3; ++axis) {
      const float value = xyz[3 * i + axis];
      if (value < box[axis] || value > box[axis + 3]) return true;
    }
    return false;
  });
  return inside;
}

std::vector<float> gathered(std::span<const float> xyz, const Indices& indices) {
  std::vector<float> result;
  result.reserve(3 * indices.size());
  for (const std::int32_t i : indices) result.insert(result.end(), &xyz[3 * i], &xyz[3 * i] + 3);
  return result;
}

double scene_cell(const Extraction& extraction) {
  double smallest = 0.0;
  for (const double tolerance : {extraction.plane_tolerance, extraction.cluster_tolerance})
    if (tolerance > 0.0) smallest = smallest > 0.0 ? std::min(smallest, tolerance) : tolerance;
  return std::max(smallest / kCellsPerTolerance, kFinestCell);
}

// Flags the cells whose mean distance to their nearest neighbours is usual.
std::vector<char> without_outliers(const std::vector<float>& xyz, const Extraction& extraction) {
  const std::size_t count = xyz.size() / 3;
  std::vector<char> keep(count, 1);
  const auto wanted = static_cast<std::size_t>(extraction.outlier_neighbours);
  if (wanted == 0 || count < 2) return keep;
  const NearestNeighbours tree(xyz);
  std::vector<double> distance(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto found = tree.nearest(&xyz[3 * i], wanted + 1);
    for (const auto& neighbour : found)
      distance[i] += std::sqrt(static_cast<double>(neighbour.squared_distance));
    distance[i] /= static_cast<double>(found.size() - 1);  // the cell itself adds nothing
  }
  const Eigen::Map<const Eigen::ArrayXd> all(distance.data(), static_cast<Eigen::Index>(count));
  const double deviation = std::sqrt((all - all.mean()).square().mean());
  const double limit = all.mean() + extraction.outlier_sigma * deviation;
  for (std::size_t i = 0; i < count; ++i) keep[i] = distance[i] <= limit;
  return keep;
}

pcl::PointCloud<pcl::PointXYZ>::Ptr to_pcl(const std::vector<float>& xyz) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  cloud->reserve(xyz.size() / 3);
  for (std::size_t i = 0; i < xyz.size(); i += 3)
    cloud->emplace_back(xyz[i], xyz[i + 1], xyz[i + 2]);
  return cloud;
}

// Twice the signed area of a triangle: positive if `c` lies to the left of the line from a to b.
double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

struct Plane {
  Eigen::Vector4d coefficients;
  double tolerance;

  double height(const float* p) const {
    return coefficients.dot(Eigen::Vector4d(p[0], p[1], p[2], 1.0));
  }
  bool holds(const float* p) const { return std::abs(height(p)) <= tolerance; }
};

// At most kPlanePoints of the points in candidate cells, evenly picked in their order.
std::vector<float> picked_points(const std::vector<float>& xyz, const Cells& cells,
                                 const std::vector<char>& candidate) {
  Indices points;
  for (std::size_t i = 0; i < cells.of_point.size(); ++i)
    if (candidate[cells.of_point[i]]) points.push_back(static_cast<std::int32_t>(i));
  const std::size_t step = points.size() / kPlanePoints + 1;
  Indices picked;
  for (std::size_t i = 0; i < points.size(); i += step) picked.push_back(points[i]);
  return gathered(xyz, picked);
}

// The plane with most points: RANSAC with PCL's fixed seed, then least squares over the inliers.
std::optional<Plane> dominant_plane(const std::vector<float>& xyz, double tolerance) {
  if (!(tolerance > 0.0) || xyz.size() < 9) return std::nullopt;
  silence_pcl();
  const auto cloud = to_pcl(xyz);
  pcl::SampleConsensusModelPlane<pcl::PointXYZ>::Ptr model(
      new pcl::SampleConsensusModelPlane<pcl::PointXYZ>(cloud));
  pcl::RandomSampleConsensus<pcl::PointXYZ> ransac(model, tolerance);
  ransac.setMaxIterations(kPlaneTrials);
  if (!ransac.computeModel()) return std::nullopt;
  pcl::Indices inliers;
  Eigen::VectorXf coefficients;
  Eigen::VectorXf refined;
  ransac.getInliers(inliers);
  ransac.getModelCoefficients(coefficients);
  if (static_cast<double>(inliers.size()) <
      kSmallestPlaneShare * static_cast<double>(cloud->size()))
    return std::nullopt;
  model->optimizeModelCoefficients(inliers, coefficients, refined);
  return Plane{refined.cast<double>(), tolerance};
}

// Clusters of cells, largest first, ties by the first cell.
std::vector<pcl::PointIndices> clusters_of(const std::vector<float>& xyz, double tolerance) {
  const auto cloud = to_pcl(xyz);
  pcl::search::KdTree<pcl::PointXYZ>::Ptr tree(new pcl::search::KdTree<pcl::PointXYZ>(false));
  pcl::EuclideanClusterExtraction<pcl::PointXYZ> extraction;
  extraction.setClusterTolerance(tolerance);
  extraction.setSearchMethod(tree);
  extraction.setInputCloud(cloud);
  std::vector<pcl::PointIndices> clusters;
  extraction.extract(clusters);
  for (auto& cluster : clusters) std::ranges::sort(cluster.indices);
  std::ranges::sort(clusters, [](const auto& a, const auto& b) {
    if (a.indices.size() != b.indices.size()) return a.indices.size() > b.indices.size();
    return a.indices.front() < b.indices.front();
  });
  return clusters;
}

// The cells of a scene that are still candidates.
class Scene {
 public:
  explicit Scene(std::vector<float> xyz) : xyz_(std::move(xyz)), cell_(xyz_.size() / 3) {
    std::iota(cell_.begin(), cell_.end(), 0);
  }

  const std::vector<float>& xyz() const { return xyz_; }
  std::size_t size() const { return cell_.size(); }

  void keep(const std::vector<char>& flags) {
    Indices kept;
    for (std::size_t i = 0; i < flags.size(); ++i)
      if (flags[i]) kept.push_back(static_cast<std::int32_t>(i));
    xyz_ = gathered(xyz_, kept);
    for (auto& i : kept) i = cell_[i];
    cell_ = std::move(kept);
  }
  // Per cell of the whole scene whether it is still a candidate.
  std::vector<char> candidates(std::size_t cell_count) const {
    std::vector<char> flags(cell_count, 0);
    for (const std::int32_t i : cell_) flags[i] = 1;
    return flags;
  }

 private:
  std::vector<float> xyz_;
  Indices cell_;
};

std::vector<char> on_plane(const std::vector<float>& xyz, const Plane& plane) {
  std::vector<char> flags(xyz.size() / 3);
  for (std::size_t i = 0; i < flags.size(); ++i) flags[i] = plane.holds(&xyz[3 * i]);
  return flags;
}

// The convex outline of points in a plane: Andrew's monotone chain, counter-clockwise.
std::vector<Eigen::Vector2d> convex_hull(std::vector<Eigen::Vector2d> points) {
  std::ranges::sort(points, [](const auto& a, const auto& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  std::vector<Eigen::Vector2d> hull;
  const auto add_chain = [&hull](const auto& chain) {
    const std::size_t base = hull.size();
    for (const auto& point : chain) {
      while (hull.size() >= base + 2 && cross(hull[hull.size() - 2], hull.back(), point) <= 0.0)
        hull.pop_back();
      hull.push_back(point);
    }
    hull.pop_back();  // the first of the other chain
  };
  add_chain(points);
  add_chain(points | std::views::reverse);
  return hull;
}

// Which cells stand on the plane: on the sensor's side of it (the sensor is at the origin), over
// the outline of its largest connected piece. What is behind the table's edge does not.
std::vector<char> over_plane(const std::vector<float>& xyz, const Plane& plane,
                             const std::vector<char>& in_plane, double tolerance) {
  const Eigen::Vector3d normal = plane.coefficients.head<3>();
  const Eigen::Vector3d first = normal.unitOrthogonal();
  const Eigen::Vector3d second = normal.cross(first);
  const auto projected = [&](std::size_t i) -> Eigen::Vector2d {
    const Eigen::Vector3d p(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]);
    return {first.dot(p), second.dot(p)};
  };
  Indices support;
  for (std::size_t i = 0; i < in_plane.size(); ++i)
    if (in_plane[i]) support.push_back(static_cast<std::int32_t>(i));
  const auto pieces = clusters_of(gathered(xyz, support), tolerance);
  std::vector<Eigen::Vector2d> table;
  for (const auto i : pieces.front().indices)
    table.push_back(projected(static_cast<std::size_t>(support[static_cast<std::size_t>(i)])));
  const auto hull = convex_hull(std::move(table));

  const float origin[3] = {0.0F, 0.0F, 0.0F};
  const double sensor_side = plane.height(origin) < 0.0 ? -1.0 : 1.0;
  std::vector<char> flags(in_plane.size(), 0);
  for (std::size_t i = 0; i < flags.size(); ++i) {
    const Eigen::Vector2d p = projected(i);
    flags[i] = !in_plane[i] && sensor_side * plane.height(&xyz[3 * i]) > 0.0;
    for (std::size_t k = 0; flags[i] && k < hull.size(); ++k)
      flags[i] = cross(hull[k], hull[(k + 1) % hull.size()], p) >= 0.0;
  }
  return flags;
}

void keep_cluster(Scene& scene, const Extraction& extraction, std::vector<std::string>& notes) {
  const auto clusters = clusters_of(scene.xyz(), extraction.cluster_tolerance);
  const auto wanted = static_cast<std::size_t>(extraction.cluster);
  if (wanted >= clusters.size())
    throw InputError("cluster " + std::to_string(wanted) + " is wanted, but the scene has " +
                     std::to_string(clusters.size()) + " (the first is 0)");
  std::vector<char> flags(scene.size(), 0);
  for (const auto i : clusters[wanted].indices) flags[i] = 1;
  scene.keep(flags);
  notes.push_back("cluster " + std::to_string(wanted) + " of " + std::to_string(clusters.size()) +
                  " kept");
}

}  // namespace

std::vector<std::int32_t> object_points(std::span<const float> xyz, const Extraction& extraction,
                                        std::vector<std::string>& notes) {
  Indices kept = inside_box(xyz, extraction.crop);
  if (kept.empty()) throw InputError("no point lies inside the crop box");
  const std::vector<float> cropped = gathered(xyz, kept);
  const Cells cells = group_by_cell(cropped, scene_cell(extraction), kMaximumCells);
  Scene scene(cell_means(cropped, cells));

  scene.keep(without_outliers(scene.xyz(), extraction));
  const auto plane = dominant_plane(picked_points(cropped, cells, scene.candidates(cells.count)),
                                    extraction.plane_tolerance);
  if (plane) {
    std::vector<char> flags = on_plane(scene.xyz(), *plane);
    if (extraction.standing && extraction.cluster_tolerance > 0.0) {
      flags = over_plane(scene.xyz(), *plane, flags, extraction.cluster_tolerance);
    } else {
      for (auto& flag : flags) flag = !flag;
    }
    scene.keep(flags);
    notes.emplace_back(extraction.standing ? "only what stands on the dominant plane was kept"
                                           : "the dominant plane was removed");
  }
  if (scene.size() == 0) throw InputError("nothing stands on the dominant plane of the scene");
  if (extraction.cluster_tolerance > 0.0) keep_cluster(scene, extraction, notes);

  const std::vector<char> candidate = scene.candidates(cells.count);
  Indices object;
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (candidate[cells.of_point[i]] && !(plane && plane->holds(&cropped[3 * i])))
      object.push_back(kept[i]);
  notes.push_back("the object has " + counted(object.size(), xyz.size() / 3));
  return object;
}

}  // namespace cosegraph::source
