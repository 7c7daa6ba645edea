#include "supervoxels/supervoxels.hpp"

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/segmentation/supervoxel_clustering.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "core/nearest.hpp"
#include "pcl_console/pcl_console.hpp"
#include "supervoxels/pieces.hpp"

namespace cosegraph::supervoxels {
namespace {

using Point = pcl::PointXYZRGBA;
using Clustering = pcl::SupervoxelClustering<Point>;
using Clusters = std::map<std::uint32_t, pcl::Supervoxel<Point>::Ptr>;

constexpr std::int32_t kNone = -1;
constexpr double kMostVoxels = 1 << 20;  // from the sensor: float tells them apart just so

std::uint8_t to_byte(float value) {
  return static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(value, 0.0F, 1.0F)));
}

// The points with the sensor at (0,0,0).
pcl::PointCloud<Point>::Ptr to_pcl(const Cloud& dense) {
  pcl::PointCloud<Point>::Ptr cloud(new pcl::PointCloud<Point>);
  cloud->resize(dense.size());
  for (std::size_t i = 0; i < dense.size(); ++i) {
    Point& point = (*cloud)[i];
    point.x = dense.xyz[3 * i] - dense.origin[0];
    point.y = dense.xyz[3 * i + 1] - dense.origin[1];
    point.z = dense.xyz[3 * i + 2] - dense.origin[2];
    if (!std::isfinite(point.x) || !std::isfinite(point.y) || !std::isfinite(point.z))
      throw InputError("point " + std::to_string(i) + " of the dense cloud is not finite");
    if (dense.rgb.empty()) continue;
    point.r = to_byte(dense.rgb[3 * i]);
    point.g = to_byte(dense.rgb[3 * i + 1]);
    point.b = to_byte(dense.rgb[3 * i + 2]);
  }
  return cloud;
}

void check_extent(const pcl::PointCloud<Point>& cloud, double voxel) {
  float farthest = 0.0F;
  for (const Point& p : cloud)
    farthest = std::max({farthest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  if (farthest > kMostVoxels * voxel)
    throw InputError("the dense cloud is " + std::to_string(farthest) +
                     " away from its sensor, too far for voxels of " + std::to_string(voxel));
}

// PCL's label per point, 0 where it gave none.
std::vector<std::uint32_t> point_labels(const Clustering& clustering) {
  const auto labelled = clustering.getLabeledCloud();
  std::vector<std::uint32_t> labels(labelled->size());
  std::ranges::transform(*labelled, labels.begin(), &pcl::PointXYZL::label);
  return labels;
}

void label_the_rest(const Cloud& dense, std::vector<std::uint32_t>& labels) {
  std::vector<float> labelled_xyz;
  std::vector<std::size_t> labelled;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    if (labels[i] == 0) continue;
    labelled.push_back(i);
    labelled_xyz.insert(labelled_xyz.end(), &dense.xyz[3 * i], &dense.xyz[3 * i] + 3);
  }
  if (labelled.empty()) throw InputError("the dense cloud yields no supervoxel");
  if (labelled.size() == labels.size()) return;
  const NearestNeighbours tree(labelled_xyz);
  std::vector<std::uint32_t> all = labels;
  for (std::size_t i = 0; i < labels.size(); ++i)
    if (labels[i] == 0) all[i] = labels[labelled[tree.nearest_index(&dense.xyz[3 * i])]];
  labels = std::move(all);
}

std::array<float, 3> unit(float x, float y, float z) {
  const float length = std::sqrt(x * x + y * y + z * z);
  return {x / length, y / length, z / length};
}

// The normal turned to the sensor at (0,0,0); straight to it where PCL has none.
std::array<float, 3> facing_normal(const pcl::Supervoxel<Point>& supervoxel) {
  const Point& c = supervoxel.centroid_;
  const pcl::Normal& n = supervoxel.normal_;
  std::array<float, 3> normal = unit(n.normal_x, n.normal_y, n.normal_z);
  if (!std::isfinite(normal[0])) normal = unit(-c.x, -c.y, -c.z);
  if (!std::isfinite(normal[0])) normal = {0.0F, 0.0F, -1.0F};
  if (normal[0] * c.x + normal[1] * c.y + normal[2] * c.z > 0.0F)
    for (float& component : normal) component = -component;
  return normal;
}

void append(Supervoxels& result, const pcl::Supervoxel<Point>& supervoxel,
            const std::array<float, 3>& sensor) {
  const Point& c = supervoxel.centroid_;
  const std::array<float, 3> centroid{c.x + sensor[0], c.y + sensor[1], c.z + sensor[2]};
  const std::array<float, 3> normal = facing_normal(supervoxel);
  result.centroid.insert(result.centroid.end(), centroid.begin(), centroid.end());
  result.normal.insert(result.normal.end(), normal.begin(), normal.end());
  result.point_count.push_back(0);
}

std::vector<std::array<std::int32_t, 2>> voxel_adjacency(
    const Clustering& clustering, const std::vector<std::int32_t>& id_of_label) {
  std::multimap<std::uint32_t, std::uint32_t> neighbours;
  clustering.getSupervoxelAdjacency(neighbours);
  std::vector<std::array<std::int32_t, 2>> adjacency;
  for (const auto& [from, to] : neighbours) {
    const auto [a, b] = std::minmax({id_of_label[from], id_of_label[to]});
    if (a != kNone && a != b) adjacency.push_back({a, b});
  }
  return adjacency;
}

}  // namespace

Fields describe(Params& params) {
  return {
      number_field("voxel", params.voxel, 1e-3, 1.0, "scale",
                   "Edge of a voxel; supervoxels are adjacent where their voxels touch."),
      number_field("seed", params.seed, 1e-2, 2.0, "scale",
                   "Distance of the seeds, about the diameter of a supervoxel."),
      number_field("color_weight", params.color_weight, 0.0, 100.0, "",
                   "Weight of the colour difference when supervoxels grow."),
      number_field("spatial_weight", params.spatial_weight, 0.0, 100.0, "",
                   "Weight of the distance to the supervoxel's centre."),
      number_field("normal_weight", params.normal_weight, 0.0, 100.0, "",
                   "Weight of the difference of normals."),
  };
}

Supervoxels compute(const Cloud& dense, const Params& params) {
  silence_pcl();
  if (dense.size() == 0) throw InputError("the dense cloud is empty");
  if (!(dense.scale > 0.0F)) throw InputError("the scale of the dense cloud is not positive");
  if (params.seed < params.voxel)
    throw ParameterError("seed: the seeds are closer than the voxels are wide");

  const auto seed = static_cast<float>(params.seed * dense.scale);
  Clustering clustering(static_cast<float>(params.voxel * dense.scale), seed);
  clustering.setUseSingleCameraTransform(false);
  clustering.setColorImportance(static_cast<float>(params.color_weight));
  clustering.setSpatialImportance(static_cast<float>(params.spatial_weight));
  clustering.setNormalImportance(static_cast<float>(params.normal_weight));
  const auto cloud = to_pcl(dense);
  check_extent(*cloud, params.voxel * dense.scale);
  clustering.setInputCloud(cloud);
  Clusters clusters;
  clustering.extract(clusters);

  std::vector<std::uint32_t> labels = point_labels(clustering);
  label_the_rest(dense, labels);
  std::vector<std::int32_t> id_of_label(clusters.empty() ? 1 : clusters.rbegin()->first + 1, kNone);
  Supervoxels result{.seed_resolution = seed};
  result.of_point.reserve(labels.size());
  for (const std::uint32_t label : labels) {
    std::int32_t& id = id_of_label[label];
    if (id == kNone) {
      id = static_cast<std::int32_t>(result.count());
      append(result, *clusters.at(label), dense.origin);
    }
    ++result.point_count[id];
    result.of_point.push_back(id);
  }
  result.adjacency = voxel_adjacency(clustering, id_of_label);
  link_small_pieces(dense, seed, result);
  std::ranges::sort(result.adjacency);
  const auto repeated = std::ranges::unique(result.adjacency);
  result.adjacency.erase(repeated.begin(), repeated.end());
  return result;
}

}  // namespace cosegraph::supervoxels
