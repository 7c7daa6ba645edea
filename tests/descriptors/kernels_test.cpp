// The kernels of our own against PCL's, and against themselves on other instruction sets.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "descriptors/own.hpp"
#include "descriptors/surfaces.hpp"
#include "io/cloud_io.hpp"
#include "support/data.hpp"

namespace cosegraph::descriptors {
namespace {

using test::all_of;
using test::Indices;

void add(Cloud& cloud, const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
  for (int axis = 0; axis < 3; ++axis) {
    cloud.xyz.push_back(static_cast<float>(point[axis]));
    cloud.normal.push_back(static_cast<float>(normal[axis]));
  }
}

// Points without any order, normals in all directions.
Cloud dust(int count) {
  Random random(7);
  const auto vector = [&random] {
    return Eigen::Vector3d(random.normal(), random.normal(), random.normal());
  };
  Cloud cloud;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d point = 0.1 * vector();
    add(cloud, point, vector().normalized());
  }
  return cloud;
}

// An egg whose lower half has few points, and some of those twice.
Cloud uneven_egg(int count) {
  const Cloud egg = test::bumpy_egg(count);
  Cloud cloud;
  for (std::size_t i = 0; i < egg.size(); ++i) {
    const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3f>(&egg.xyz[3 * i]).cast<double>();
    const Eigen::Vector3d normal =
        Eigen::Map<const Eigen::Vector3f>(&egg.normal[3 * i]).cast<double>();
    if (point.z() < 0.0 && i % 6 != 0) continue;
    add(cloud, point, normal);
    if (point.z() < 0.0 && i % 12 == 0) add(cloud, point, normal);
  }
  return cloud;
}

// Steps between flat tiles, all normals equal but for rounding: every pair is as good as a tie.
Cloud steps(int side) {
  Random random(3);
  const Eigen::Vector3d up = Eigen::Vector3d(0.3, -0.5, 0.8).normalized();
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), up);
  Cloud cloud;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j) {
      const double noise = 1e-7 * random.normal();
      add(cloud, turn * Eigen::Vector3d(0.01 * i, 0.01 * j, (i / 5 + j / 5) % 2 * 0.02),
          (up + Eigen::Vector3d(noise, -noise, noise)).normalized());
    }
  return cloud;
}

// Two sides of a thin sheet: opposite normals.
Cloud sheet(int side) {
  Cloud cloud;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      for (const double face : {-1.0, 1.0})
        add(cloud, {0.01 * i, 0.01 * j + 0.003 * face, 0.002 * face}, {0.0, 0.0, face});
  return cloud;
}

// Points of one line, normals along it.
Cloud rod(int count) {
  const Eigen::Vector3d along = Eigen::Vector3d(1.0, 2.0, -3.0).normalized();
  Cloud cloud;
  for (int i = 0; i < count; ++i) add(cloud, 0.01 * i * along, along);
  return cloud;
}

Cloud repeated(int count) {
  Cloud cloud;
  for (int i = 0; i < count; ++i) add(cloud, {0.1, 0.2, 0.3}, {0.6, 0.0, 0.8});
  return cloud;
}

Cloud scaled(Cloud cloud, float factor) {
  for (float& value : cloud.xyz) value *= factor;
  return cloud;
}

// How far rows lie apart; rows that are not finite have to be so in both.
struct Deviation {
  double bins = 0.0;  // share of those that differ by more than 1e-3 of what one may hold
  double mean = 0.0;  // per row, its length over that of PCL's row
  double worst = 0.0;
};

Deviation deviation(const std::vector<float>& own, const std::vector<float>& pcl, int width,
                    double range) {
  Deviation result;
  EXPECT_EQ(own.size(), pcl.size());
  for (std::size_t row = 0; row < pcl.size(); row += width) {
    double difference = 0.0;
    double length = 0.0;
    for (std::size_t i = row; i < row + width; ++i) {
      EXPECT_EQ(std::isfinite(own[i]), std::isfinite(pcl[i])) << "number " << i;
      if (!std::isfinite(own[i])) continue;
      const double d = static_cast<double>(own[i]) - pcl[i];
      difference += d * d;
      length += static_cast<double>(pcl[i]) * pcl[i];
      if (std::abs(d) > 1e-3 * range) result.bins += 1.0 / static_cast<double>(pcl.size());
    }
    if (length == 0.0) continue;
    result.mean += std::sqrt(difference / length) * width / static_cast<double>(pcl.size());
    result.worst = std::max(result.worst, std::sqrt(difference / length));
  }
  return result;
}

Deviation fpfh_deviation(const Cloud& cloud, const Indices& keypoint, double radius) {
  const Surface surface{cloud.xyz, cloud.normal};
  return deviation(fpfh(surface, keypoint, radius, 1, Kernel::own),
                   fpfh(surface, keypoint, radius, 1, Kernel::pcl), kFpfhSize, 100.0);
}

Deviation shot_deviation(const Cloud& cloud, const Indices& keypoint, double radius) {
  const Surface surface{cloud.xyz, cloud.normal};
  return deviation(shot(surface, keypoint, radius, 1, Kernel::own),
                   shot(surface, keypoint, radius, 1, Kernel::pcl), kShotSize, 1.0);
}

struct Case {
  const char* name;
  Cloud cloud;
  double radius;
  bool symmetric = false;  // so that rounding decides about SHOT's frames
};

std::vector<Case> cases() {
  return {{"egg", test::bumpy_egg(1500), 0.1},
          {"turned egg", test::moved(test::bumpy_egg(1500), 3), 0.07},
          {"egg, everything near", test::bumpy_egg(400), 5.0},
          {"egg, hardly anything near", test::bumpy_egg(1500), 0.02},
          {"egg, huge", scaled(test::bumpy_egg(800), 1e15F), 1e14},
          {"egg, tiny", scaled(test::bumpy_egg(800), 1e-9F), 1e-10},
          {"dust", dust(1000), 0.08},
          {"uneven egg", uneven_egg(3000), 0.09},
          {"steps", steps(30), 0.053, true},
          {"sheet", sheet(20), 0.053, true},
          {"turned sheet", test::moved(sheet(20), 5), 0.053, true},
          {"rod", rod(100), 0.053, true},
          {"two points", rod(2), 0.053},
          {"one point, often", repeated(20), 0.053}};
}

TEST(OwnFpfh, AgreesWithPcl) {
  for (const auto& [name, cloud, radius, symmetric] : cases()) {
    const Deviation found = fpfh_deviation(cloud, all_of(cloud), radius);
    EXPECT_LE(found.bins, 1e-4) << name;
    EXPECT_LE(found.mean, 1e-5) << name;
    EXPECT_LE(found.worst, 0.02) << name;
  }
}

TEST(OwnKernels, AgreeWithPclOnTheBunny) {
  COSEGRAPH_NEEDS_DATA("pcl/bun0.pcd");
  const Cloud bunny = io::read_cloud(test::data_folder() / "pcl/bun0.pcd");
  for (const auto deviation_of : {fpfh_deviation, shot_deviation}) {
    const Deviation found = deviation_of(bunny, all_of(bunny), 0.03);
    EXPECT_LE(found.bins, 1e-4);
    EXPECT_LE(found.mean, 1e-5);
  }
}

TEST(OwnFpfh, OfSomeKeypointsIsThatOfAll) {
  const Cloud egg = test::bumpy_egg(1500);
  const Surface surface{egg.xyz, egg.normal};
  const auto all = fpfh(surface, all_of(egg), 0.1, 1);
  const Indices some{1400, 3, 3, 77};
  const auto rows = fpfh(surface, some, 0.1, 1);
  for (std::size_t k = 0; k < some.size(); ++k)
    EXPECT_TRUE(std::equal(&rows[kFpfhSize * k], &rows[kFpfhSize * k] + kFpfhSize,
                           &all[kFpfhSize * static_cast<std::size_t>(some[k])]))
        << k;
}

TEST(OwnShot, AgreesWithPcl) {
  for (const auto& [name, cloud, radius, symmetric] : cases()) {
    const Deviation found = shot_deviation(cloud, all_of(cloud), radius);
    if (symmetric) continue;
    EXPECT_LE(found.bins, 1e-4) << name;
    EXPECT_LE(found.mean, 1e-5) << name;
    EXPECT_LE(found.worst, 0.02) << name;
  }
}

bool same_bytes(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

TEST(OwnKernels, GiveTheSameBytesOnEveryInstructionSet) {
  for (const auto& [name, cloud, radius, symmetric] : cases()) {
    const Surface surface{cloud.xyz, cloud.normal};
    EXPECT_TRUE(same_bytes(own_fpfh(surface, all_of(cloud), radius, 1, Instructions::baseline),
                           own_fpfh(surface, all_of(cloud), radius, 2, best_instructions())))
        << name;
    EXPECT_TRUE(same_bytes(own_shot(surface, all_of(cloud), radius, 1, Instructions::baseline),
                           own_shot(surface, all_of(cloud), radius, 2, best_instructions())))
        << name;
  }
}

// One point is so far out that cells cannot be counted up to it.
TEST(OwnFpfh, BearsPointsThatAreFarOut) {
  Cloud egg = test::bumpy_egg(1500);
  const auto without = fpfh({egg.xyz, egg.normal}, all_of(egg), 0.1, 1);
  add(egg, {1e18, -1e18, 1e18}, {0.0, 0.0, 1.0});
  auto with = fpfh({egg.xyz, egg.normal}, all_of(egg), 0.1, 1);
  EXPECT_TRUE(std::isnan(with.back()));
  with.resize(without.size());
  EXPECT_LT(deviation(with, without, kFpfhSize, 100.0).worst, 1e-5);
}

}  // namespace
}  // namespace cosegraph::descriptors
