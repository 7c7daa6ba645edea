// Surfaces with known normals, and rigid motions of them.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <vector>

#include "core/cloud.hpp"
#include "core/random.hpp"

namespace cosegraph::test {

using Indices = std::vector<std::int32_t>;

inline Indices all_of(const Cloud& cloud) {
  Indices indices(cloud.size());
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

// A bumpy egg, about 0.6 wide: no two of its places look quite the same.
inline Cloud bumpy_egg(int count) {
  Cloud cloud;
  cloud.scale = 1.0F;
  const auto point_at = [](double height, double turn) -> Eigen::Vector3d {
    const double ring = std::sqrt(1.0 - height * height);
    const double bump = 1.0 + 0.12 * std::sin(3.0 * turn) * ring + 0.1 * std::sin(4.0 * height);
    return 0.3 * bump *
           Eigen::Vector3d(ring * std::cos(turn), 0.8 * ring * std::sin(turn), 1.3 * height);
  };
  for (int i = 0; i < count; ++i) {
    const double height = 2.0 * (i + 0.5) / count - 1.0;
    const double turn = i * std::numbers::pi * (3.0 - std::sqrt(5.0));
    const double step = 1e-5;
    const Eigen::Vector3d point = point_at(height, turn);
    Eigen::Vector3d normal = (point_at(height, turn + step) - point)
                                 .cross(point_at(height + step / 10.0, turn) - point)
                                 .normalized();
    if (normal.dot(point) < 0.0) normal = -normal;
    for (int axis = 0; axis < 3; ++axis) {
      cloud.xyz.push_back(static_cast<float>(point[axis]));
      cloud.normal.push_back(static_cast<float>(normal[axis]));
    }
  }
  cloud.width = static_cast<std::uint32_t>(cloud.size());
  return cloud;
}

inline Cloud moved(Cloud cloud, std::uint64_t seed) {
  Random random(seed);
  const auto component = [&random] { return static_cast<float>(random.normal()); };
  const Eigen::Quaternionf turn =
      Eigen::Quaternionf(component(), component(), component(), component()).normalized();
  const Eigen::Vector3f shift(component(), component(), component());
  for (std::size_t i = 0; i < cloud.xyz.size(); i += 3) {
    Eigen::Map<Eigen::Vector3f> point(&cloud.xyz[i]);
    Eigen::Map<Eigen::Vector3f> normal(&cloud.normal[i]);
    point = (turn * point + shift).eval();
    normal = (turn * normal).eval();
  }
  return cloud;
}

}  // namespace cosegraph::test
