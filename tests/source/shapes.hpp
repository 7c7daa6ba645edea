// Sampled surfaces as a sensor at the origin that looks along z would see them.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "core/cloud.hpp"
#include "core/random.hpp"

namespace cosegraph::test {

inline void add_point(Cloud& cloud, double x, double y, double z) {
  for (const double value : {x, y, z}) cloud.xyz.push_back(static_cast<float>(value));
  cloud.width = static_cast<std::uint32_t>(cloud.size());
}

// The half of a sphere that faces the sensor, `count` points evenly spread.
inline Cloud half_sphere(int count, double radius, double distance) {
  Cloud cloud;
  for (int i = 0; i < count; ++i) {
    const double depth = (i + 0.5) / count;  // equal areas
    const double turn = i * std::numbers::pi * (3.0 - std::sqrt(5.0));
    const double ring = std::sqrt(1.0 - depth * depth);
    add_point(cloud, radius * ring * std::cos(turn), radius * ring * std::sin(turn),
              distance - radius * depth);
  }
  return cloud;
}

// A square board across the optical axis, tilted about x; a regular grid of side x side points.
inline Cloud board(int side, double edge, double tilt, double distance) {
  Cloud cloud;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j) {
      const double u = edge * ((i + 0.5) / side - 0.5);
      const double v = edge * ((j + 0.5) / side - 0.5);
      add_point(cloud, u, v * std::cos(tilt), distance + v * std::sin(tilt));
    }
  return cloud;
}

inline Cloud with_noise(Cloud cloud, double sigma, std::uint64_t seed) {
  Random random(seed);
  for (float& value : cloud.xyz) value += static_cast<float>(sigma * random.normal());
  return cloud;
}

inline Cloud joined(const Cloud& a, const Cloud& b) {
  Cloud cloud = a;
  cloud.xyz.insert(cloud.xyz.end(), b.xyz.begin(), b.xyz.end());
  cloud.width = static_cast<std::uint32_t>(cloud.size());
  return cloud;
}

}  // namespace cosegraph::test
