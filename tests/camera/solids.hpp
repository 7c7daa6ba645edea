// Small meshes with known geometry.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "core/cloud.hpp"
#include "core/random.hpp"

namespace cosegraph::test {

using Point = std::array<double, 3>;

inline std::int32_t add_vertex(Mesh& mesh, const Point& p) {
  for (const double x : p) mesh.vertex.push_back(static_cast<float>(x));
  return static_cast<std::int32_t>(mesh.vertex_count()) - 1;
}

inline void add_triangle(Mesh& mesh, std::int32_t a, std::int32_t b, std::int32_t c,
                         std::int32_t label) {
  mesh.face.insert(mesh.face.end(), {a, b, c});
  mesh.face_label.push_back(label);
}

// The parallelogram from `corner` along `u` and `v`, as two triangles.
inline void add_plate(Mesh& mesh, const Point& corner, const Point& u, const Point& v,
                      std::int32_t label) {
  const auto at = [&](double s, double t) {
    return add_vertex(mesh, {corner[0] + s * u[0] + t * v[0], corner[1] + s * u[1] + t * v[1],
                             corner[2] + s * u[2] + t * v[2]});
  };
  const std::array corners{at(0, 0), at(1, 0), at(1, 1), at(0, 1)};
  add_triangle(mesh, corners[0], corners[1], corners[2], label);
  add_triangle(mesh, corners[0], corners[2], corners[3], label);
}

// The cube [-1, 1]^3 with the labels 0 .. 5 for -x, +x, -y, +y, -z, +z.
inline Mesh cube() {
  Mesh mesh;
  mesh.label_names = {"-x", "+x", "-y", "+y", "-z", "+z"};
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      Point corner{-1, -1, -1};
      corner[axis] = side == 0 ? -1.0 : 1.0;
      Point u{};
      Point v{};
      u[(axis + 1) % 3] = 2.0;
      v[(axis + 2) % 3] = 2.0;
      add_plate(mesh, corner, u, v, 2 * axis + side);
    }
  }
  return mesh;
}

// A sphere in 2 (n - 1) 2n triangles; the corners lie on it.
inline Mesh sphere(int n, double radius = 1.0) {
  Mesh mesh;
  mesh.label_names = {"sphere"};
  const int around = 2 * n;
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j < around; ++j) {
      const double theta = std::numbers::pi * i / n;
      const double phi = 2.0 * std::numbers::pi * j / around;
      add_vertex(mesh, {radius * std::sin(theta) * std::cos(phi),
                        radius * std::sin(theta) * std::sin(phi), radius * std::cos(theta)});
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < around; ++j) {
      const int a = i * around + j;
      const int b = i * around + (j + 1) % around;
      if (i + 1 < n) add_triangle(mesh, a, a + around, b + around, 0);
      if (i > 0) add_triangle(mesh, a, b + around, b, 0);
    }
  }
  return mesh;
}

// Triangles anywhere in [-1, 1]^3, every one with its own label.
inline Mesh triangle_soup(int count, std::uint64_t seed) {
  Random random(seed);
  Mesh mesh;
  for (int f = 0; f < count; ++f) {
    mesh.label_names.push_back(std::to_string(f));
    std::array<std::int32_t, 3> corner{};
    for (auto& c : corner)
      c = add_vertex(mesh, {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)});
    add_triangle(mesh, corner[0], corner[1], corner[2], f);
  }
  return mesh;
}

// The same mesh with its faces in another order.
inline Mesh shuffled(const Mesh& mesh, std::uint64_t seed) {
  Mesh result = mesh;
  const auto order = Random(seed).sample(mesh.face_count(), mesh.face_count());
  for (std::size_t f = 0; f < order.size(); ++f) {
    const auto from = static_cast<std::size_t>(order[f]);
    result.face_label[f] = mesh.face_label[from];
    for (std::size_t c = 0; c < 3; ++c) result.face[3 * f + c] = mesh.face[3 * from + c];
  }
  return result;
}

}  // namespace cosegraph::test
