#include "descriptors/local.hpp"

#include <pcl/features/fpfh_omp.h>
#include <pcl/features/shot_omp.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>

#include <algorithm>
#include <limits>

#include "core/error.hpp"
#include "core/nearest.hpp"
#include "descriptors/own.hpp"
#include "pcl_console/pcl_console.hpp"

namespace cosegraph::descriptors {
namespace {

using Points = pcl::PointCloud<pcl::PointXYZ>;
using Normals = pcl::PointCloud<pcl::Normal>;

// Numbers are finite, and not so large that FLANN's sums of their squares are not.
void check(const Surface& surface) {
  if (!std::ranges::all_of(surface.xyz, NearestNeighbours::takes))
    throw InputError("a point is not finite, or too far out");
}

Points::Ptr points_of(std::span<const float> xyz) {
  Points::Ptr points(new Points);
  points->reserve(xyz.size() / 3);
  for (std::size_t i = 0; i < xyz.size(); i += 3)
    points->emplace_back(xyz[i], xyz[i + 1], xyz[i + 2]);
  return points;
}

Normals::Ptr normals_of(std::span<const float> normal) {
  Normals::Ptr normals(new Normals);
  normals->reserve(normal.size() / 3);
  for (std::size_t i = 0; i < normal.size(); i += 3)
    normals->emplace_back(normal[i], normal[i + 1], normal[i + 2]);
  return normals;
}

template <class Signature, class Estimation>
pcl::PointCloud<Signature> estimated(Estimation& estimation, const Surface& surface,
                                     std::span<const std::int32_t> keypoint, double radius) {
  silence_pcl();
  pcl::PointCloud<Signature> signatures;
  estimation.setInputCloud(points_of(surface.xyz));
  estimation.setInputNormals(normals_of(surface.normal));
  estimation.setIndices(pcl::IndicesPtr(new pcl::Indices(keypoint.begin(), keypoint.end())));
  estimation.setSearchMethod(
      pcl::search::KdTree<pcl::PointXYZ>::Ptr(new pcl::search::KdTree<pcl::PointXYZ>));
  estimation.setRadiusSearch(radius);
  estimation.compute(signatures);
  return signatures;
}

std::vector<float> pcl_fpfh(const Surface& surface, std::span<const std::int32_t> keypoint,
                            double radius, int threads) {
  using Signature = pcl::FPFHSignature33;
  pcl::FPFHEstimationOMP<pcl::PointXYZ, pcl::Normal, Signature> estimation(
      static_cast<unsigned>(threads));
  std::vector<float> rows;
  rows.reserve(kFpfhSize * keypoint.size());
  for (const auto& signature : estimated<Signature>(estimation, surface, keypoint, radius)) {
    rows.insert(rows.end(), signature.histogram, signature.histogram + kFpfhSize);
    const std::span row = std::span(rows).last(kFpfhSize);
    const auto zero = [](float bin) { return bin == 0.0F; };
    if (std::ranges::all_of(row, zero))  // no neighbour
      std::ranges::fill(row, std::numeric_limits<float>::quiet_NaN());
  }
  return rows;
}

std::vector<float> pcl_shot(const Surface& surface, std::span<const std::int32_t> keypoint,
                            double radius, int threads) {
  using Signature = pcl::SHOT352;
  pcl::SHOTEstimationOMP<pcl::PointXYZ, pcl::Normal, Signature> estimation(
      static_cast<unsigned>(threads));
  std::vector<float> rows;
  rows.reserve(kShotSize * keypoint.size());
  for (const auto& signature : estimated<Signature>(estimation, surface, keypoint, radius))
    rows.insert(rows.end(), signature.descriptor, signature.descriptor + kShotSize);
  return rows;
}

}  // namespace

std::vector<float> fpfh(const Surface& surface, std::span<const std::int32_t> keypoint,
                        double radius, int threads, Kernel kernel) {
  if (keypoint.empty()) return {};
  check(surface);
  if (kernel == Kernel::pcl) return pcl_fpfh(surface, keypoint, radius, threads);
  return own_fpfh(surface, keypoint, radius, threads, best_instructions());
}

std::vector<float> shot(const Surface& surface, std::span<const std::int32_t> keypoint,
                        double radius, int threads, Kernel kernel) {
  if (keypoint.empty()) return {};
  check(surface);
  if (kernel == Kernel::pcl) return pcl_shot(surface, keypoint, radius, threads);
  return own_shot(surface, keypoint, radius, threads, best_instructions());
}

}  // namespace cosegraph::descriptors

template <>
cosegraph::Names<cosegraph::descriptors::Kernel>
cosegraph::names<cosegraph::descriptors::Kernel>() {
  using cosegraph::descriptors::Kernel;
  static constexpr std::pair<Kernel, std::string_view> table[] = {{Kernel::own, "own"},
                                                                  {Kernel::pcl, "pcl"}};
  return table;
}
