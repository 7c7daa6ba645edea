// Clouds of surfaces whose Laplace-Beltrami spectrum is known.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>

#include "core/cloud.hpp"
#include "core/random.hpp"

namespace cosegraph::test {

inline void add_point(Cloud& cloud, double x, double y, double z) {
  for (const double coordinate : {x, y, z}) cloud.xyz.push_back(static_cast<float>(coordinate));
  cloud.width = static_cast<std::uint32_t>(cloud.size());
}

// `count` uniform random points of the unit sphere's part above `lowest`, from -1 to 1.
inline Cloud sphere(std::size_t count, double lowest, std::uint64_t seed) {
  Random random(seed);
  Cloud cloud;
  while (cloud.size() < count) {
    const double z = random.uniform(lowest, 1.0);
    const double angle = random.uniform(0.0, 2.0 * std::numbers::pi);
    const double radius = std::sqrt(1.0 - z * z);
    add_point(cloud, radius * std::cos(angle), radius * std::sin(angle), z);
  }
  return cloud;
}

// `count` evenly spread points of the unit sphere (a Fibonacci lattice).
inline Cloud even_sphere(int count) {
  Cloud cloud;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count;
    const double angle = i * std::numbers::pi * (3.0 - std::sqrt(5.0));
    const double radius = std::sqrt(1.0 - z * z);
    add_point(cloud, radius * std::cos(angle), radius * std::sin(angle), z);
  }
  return cloud;
}

// side x side points of the unit square: a grid with every point moved by up to a quarter of its
// spacing, so that no two neighbourhoods are alike.
inline Cloud even_square(int side, std::uint64_t seed) {
  Random random(seed);
  Cloud cloud;
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column) {
      const double x = (column + 0.5 + random.uniform(-0.25, 0.25)) / side;
      add_point(cloud, x, (row + 0.5 + random.uniform(-0.25, 0.25)) / side, 0.0);
    }
  return cloud;
}

// `count` uniform random points of the sheet [0, width] x [0, height], rolled onto a cylinder
// around the y axis of the given curvature (0: flat).
inline Cloud sheet(std::size_t count, double width, double height, double curvature,
                   std::uint64_t seed) {
  Random random(seed);
  Cloud cloud;
  while (cloud.size() < count) {
    const double u = random.uniform(0.0, width);
    const double y = random.uniform(0.0, height);
    if (curvature == 0.0)
      add_point(cloud, u, y, 0.0);
    else
      add_point(cloud, std::sin(u * curvature) / curvature, y,
                (1.0 - std::cos(u * curvature)) / curvature);
  }
  return cloud;
}

inline Cloud moved(Cloud cloud, double x, double y, double z) {
  for (std::size_t i = 0; i < cloud.xyz.size(); ++i)
    cloud.xyz[i] += static_cast<float>(i % 3 == 0 ? x : i % 3 == 1 ? y : z);
  return cloud;
}

inline Cloud together(Cloud first, const Cloud& second) {
  first.xyz.insert(first.xyz.end(), second.xyz.begin(), second.xyz.end());
  first.width = static_cast<std::uint32_t>(first.size());
  return first;
}

}  // namespace cosegraph::test
