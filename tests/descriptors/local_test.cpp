#include "descriptors/local.hpp"

#include <gmock/gmock.h>
#include <pcl/features/normal_3d.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>

#include <cmath>
#include <limits>

#include "descriptors/surfaces.hpp"
#include "io/cloud_io.hpp"
#include "support/data.hpp"

namespace cosegraph::descriptors {
namespace {

using test::all_of;
using test::Indices;

// The normals that PCL's own tests use for SHOT.
std::vector<float> pcl_normals(const std::vector<float>& xyz, double radius) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr points(new pcl::PointCloud<pcl::PointXYZ>);
  for (std::size_t i = 0; i < xyz.size(); i += 3)
    points->emplace_back(xyz[i], xyz[i + 1], xyz[i + 2]);
  pcl::NormalEstimation<pcl::PointXYZ, pcl::Normal> estimation;
  estimation.setInputCloud(points);
  estimation.setSearchMethod(
      pcl::search::KdTree<pcl::PointXYZ>::Ptr(new pcl::search::KdTree<pcl::PointXYZ>(false)));
  estimation.setRadiusSearch(radius);
  pcl::PointCloud<pcl::Normal> normals;
  estimation.compute(normals);
  std::vector<float> result;
  for (const auto& normal : normals) result.insert(result.end(), normal.normal, normal.normal + 3);
  return result;
}

// Point 0 of bun0.pcd with all points as neighbours and the file's normals, as published by the
// Point Cloud Library (its test of FPFH).
TEST(Fpfh, AgreesWithThePublishedValuesOnTheBunny) {
  COSEGRAPH_NEEDS_DATA("pcl/bun0.pcd");
  const Cloud bunny = io::read_cloud(test::data_folder() / "pcl/bun0.pcd");
  ASSERT_EQ(bunny.size(), 397U);
  ASSERT_EQ(bunny.normal.size(), bunny.xyz.size());
  const auto rows = fpfh({bunny.xyz, bunny.normal}, all_of(bunny), 1e3, 1);
  const std::vector<double> published{1.58591, 1.68365, 6.71,    23.0717, 33.3844, 20.4002, 7.31067,
                                      1.02635, 0.48591, 1.47069, 2.87061, 1.78321, 4.30795, 7.05514,
                                      9.37615, 17.963,  18.2801, 14.2766, 10.8542, 6.07925, 5.28565,
                                      4.73887, 0.56984, 3.29826, 5.28156, 5.26939, 3.13191, 1.74453,
                                      9.41971, 21.5894, 24.6302, 17.7764, 7.28878};
  for (std::size_t bin = 0; bin < published.size(); ++bin)
    EXPECT_NEAR(rows[bin], published[bin], 1e-2) << "bin " << bin;
}

// Point 103 of bun0.pcd at 20 times its mesh resolution of 2 mm, as published by the Point Cloud
// Library (its test of SHOT352).
TEST(Shot, AgreesWithThePublishedValuesOnTheBunny) {
  COSEGRAPH_NEEDS_DATA("pcl/bun0.pcd");
  const Cloud bunny = io::read_cloud(test::data_folder() / "pcl/bun0.pcd");
  const double radius = 20 * 0.002;
  const auto normals = pcl_normals(bunny.xyz, radius);
  const auto row = shot({bunny.xyz, normals}, Indices{103}, radius, 1);
  const std::vector<std::pair<std::size_t, double>> published{
      {9, 0.0072018504}, {10, 0.0023103887}, {11, 0.0024724449}, {19, 0.0031367359},
      {20, 0.17439659},  {21, 0.06542316},   {42, 0.013304681},  {53, 0.0073520984},
      {54, 0.013584172}, {55, 0.0050609680}};
  for (const auto& [bin, value] : published) EXPECT_NEAR(row[bin], value, 1e-4) << "bin " << bin;
}

TEST(Fpfh, HasThreeHistogramsThatSumToHundred) {
  const Cloud egg = test::bumpy_egg(1500);
  const auto rows = fpfh({egg.xyz, egg.normal}, all_of(egg), 0.1, 1);
  ASSERT_EQ(rows.size(), egg.size() * kFpfhSize);
  for (auto part = rows.begin(); part != rows.end(); part += 11)
    ASSERT_NEAR(std::accumulate(part, part + 11, 0.0), 100.0, 1e-3);
}

TEST(Fpfh, OfAPlaneFillsTheMiddleBins) {
  Cloud plane;
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 20; ++j) {
      plane.xyz.insert(plane.xyz.end(),
                       {0.01F * static_cast<float>(i), 0.01F * static_cast<float>(j), 1.0F});
      plane.normal.insert(plane.normal.end(), {0.0F, 0.0F, -1.0F});
    }
  // No angle between normals, and no normal leans: all three features are 0.
  const auto row = fpfh({plane.xyz, plane.normal}, Indices{210}, 0.05, 1);
  for (int bin = 0; bin < kFpfhSize; ++bin)
    EXPECT_NEAR(row[bin], bin % 11 == 5 ? 100.0 : 0.0, 1e-3) << "bin " << bin;
}

TEST(Shot, HasUnitLength) {
  const Cloud egg = test::bumpy_egg(1500);
  const auto rows = shot({egg.xyz, egg.normal}, Indices{10, 400, 900}, 0.15, 1);
  for (auto row = rows.begin(); row != rows.end(); row += kShotSize)
    EXPECT_NEAR(std::inner_product(row, row + kShotSize, row, 0.0), 1.0, 1e-4);
}

TEST(LocalDescriptors, AreNotFiniteWherePointsHaveNoNeighbours) {
  const Cloud egg = test::bumpy_egg(1500);
  const auto undescribed = [](const std::vector<float>& rows) {
    return std::ranges::all_of(rows, [](float value) { return std::isnan(value); });
  };
  for (const Kernel kernel : {Kernel::own, Kernel::pcl}) {
    EXPECT_TRUE(undescribed(fpfh({egg.xyz, egg.normal}, Indices{3}, 1e-4, 1, kernel)));
    EXPECT_TRUE(undescribed(shot({egg.xyz, egg.normal}, Indices{3}, 1e-4, 1, kernel)));
    EXPECT_TRUE(fpfh({egg.xyz, egg.normal}, {}, 0.1, 1, kernel).empty());
    EXPECT_TRUE(shot({egg.xyz, egg.normal}, {}, 0.1, 1, kernel).empty());
  }
}

TEST(LocalDescriptors, RefusePointsWithWhichNothingCanBeComputed) {
  for (const float x :
       {3e38F, -std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    Cloud egg = test::bumpy_egg(200);
    egg.xyz[7] = x;
    for (const Kernel kernel : {Kernel::own, Kernel::pcl}) {
      EXPECT_THROW(fpfh({egg.xyz, egg.normal}, Indices{3}, 0.1, 1, kernel), InputError) << x;
      EXPECT_THROW(shot({egg.xyz, egg.normal}, Indices{3}, 0.1, 1, kernel), InputError) << x;
    }
  }
}

}  // namespace
}  // namespace cosegraph::descriptors
