#include <pcl/features/fpfh.h>
#include <pcl/features/shot.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/cpc_segmentation.h>
#include <pcl/segmentation/supervoxel_clustering.h>

#include <cstdio>

#include "pipeline/pipeline.hpp"
#include "tools/benchmarks/bench.hpp"

namespace cosegraph::bench {
namespace {

using CloudPtr = pcl::PointCloud<pcl::PointXYZRGBA>::Ptr;

CloudPtr to_pcl(const Cloud& cloud) {
  auto result = std::make_shared<pcl::PointCloud<pcl::PointXYZRGBA>>();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    pcl::PointXYZRGBA point;
    point.x = cloud.xyz[3 * i];
    point.y = cloud.xyz[3 * i + 1];
    point.z = cloud.xyz[3 * i + 2];
    result->push_back(point);
  }
  return result;
}

pcl::PointCloud<pcl::Normal>::Ptr normals_of(const Cloud& cloud) {
  auto result = std::make_shared<pcl::PointCloud<pcl::Normal>>();
  for (std::size_t i = 0; i < cloud.size(); ++i)
    result->push_back(
        pcl::Normal(cloud.normal[3 * i], cloud.normal[3 * i + 1], cloud.normal[3 * i + 2]));
  return result;
}

void stock_supervoxels(const CloudPtr& cloud, float scale, const supervoxels::Params& params) {
  pcl::SupervoxelClustering<pcl::PointXYZRGBA> clustering(static_cast<float>(params.voxel) * scale,
                                                          static_cast<float>(params.seed) * scale);
  clustering.setUseSingleCameraTransform(false);
  clustering.setInputCloud(cloud);
  clustering.setColorImportance(static_cast<float>(params.color_weight));
  clustering.setSpatialImportance(static_cast<float>(params.spatial_weight));
  clustering.setNormalImportance(static_cast<float>(params.normal_weight));
  std::map<std::uint32_t, pcl::Supervoxel<pcl::PointXYZRGBA>::Ptr> clusters;
  clustering.extract(clusters);
}

template <class Signature, class Estimation>
void stock_descriptor(const Cloud& cloud, double radius) {
  Estimation estimation;
  estimation.setInputCloud(to_pcl(cloud));
  estimation.setInputNormals(normals_of(cloud));
  estimation.setSearchMethod(std::make_shared<pcl::search::KdTree<pcl::PointXYZRGBA>>());
  estimation.setRadiusSearch(radius * cloud.scale);
  pcl::PointCloud<Signature> output;
  estimation.compute(output);
}

template <class Ours, class Stock>
void compare(const char* name, int repeats, Ours&& ours, Stock&& stock) {
  std::vector<double> our_times;
  std::vector<double> stock_times;
  std::vector<double> ratios;
  for (int i = 0; i < repeats; ++i) {
    our_times.push_back(measure(ours).cpu);
    stock_times.push_back(measure(stock).cpu);
    ratios.push_back(our_times.back() / stock_times.back());
  }
  std::printf("  %-26s ours %8.2f ms   PCL %8.2f ms   ratio %.3f\n", name, median(our_times),
              median(stock_times), median(ratios));
}

}  // namespace

int bench_peers(int repeats) {
  const Subject subject = load_subject();
  const pipeline::Config config = pipeline::config_from_name("fpfh+fv");
  const pipeline::Features features = pipeline::extract(subject.queries.at(0), config);
  const Cloud& dense = features.frame.dense;
  const Cloud& cloud = features.frame.cloud;
  const float scale = dense.scale;
  std::printf("peers: %s, %zu dense points, %zu points; CPU ms, medians of %d\n",
              subject.name.c_str(), dense.size(), cloud.size(), repeats);

  const CloudPtr dense_pcl = to_pcl(dense);
  compare(
      "supervoxels", repeats, [&] { supervoxels::compute(dense, config.supervoxels); },
      [&] { stock_supervoxels(dense_pcl, scale, config.supervoxels); });
  for (const double radius : {0.08, 0.13}) {
    descriptors::Params params{.channels = {"fpfh:" + std::to_string(radius)}, .threads = 1};
    compare(
        params.channels[0].c_str(), repeats, [&] { descriptors::compute(cloud, params); },
        [&] {
          stock_descriptor<pcl::FPFHSignature33, pcl::FPFHEstimation<pcl::PointXYZRGBA, pcl::Normal,
                                                                     pcl::FPFHSignature33>>(cloud,
                                                                                            radius);
        });
  }
  descriptors::Params params{.channels = {"shot:0.13:0"}, .threads = 1};
  compare(
      "shot:0.13, every point", repeats, [&] { descriptors::compute(cloud, params); },
      [&] {
        stock_descriptor<pcl::SHOT352,
                         pcl::SHOTEstimation<pcl::PointXYZRGBA, pcl::Normal, pcl::SHOT352>>(cloud,
                                                                                            0.13);
      });
  return 0;
}

}  // namespace cosegraph::bench
