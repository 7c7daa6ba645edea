// A benchmark folder of simple two-part objects, made in a temporary folder.
#pragma once

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>

#include "core/cloud.hpp"
#include "io/file.hpp"
#include "io/mesh_io.hpp"

namespace cosegraph::test {

using io::TemporaryFolder;

// Adds a surface of revolution about the z axis as part `label`: `radius(t)` and `height(t)` for t
// from 0 to 1.
template <class Radius, class Height>
void add_revolved(Mesh& mesh, std::int32_t label, Radius radius, Height height) {
  constexpr int kRings = 24;
  constexpr int kSides = 32;
  const auto first = static_cast<std::int32_t>(mesh.vertex_count());
  for (int ring = 0; ring <= kRings; ++ring)
    for (int side = 0; side < kSides; ++side) {
      const double t = static_cast<double>(ring) / kRings;
      const double angle = 2.0 * std::numbers::pi * side / kSides;
      for (const double c : {radius(t) * std::cos(angle), radius(t) * std::sin(angle), height(t)})
        mesh.vertex.push_back(static_cast<float>(c));
    }
  const auto vertex = [&](int ring, int side) { return first + ring * kSides + side % kSides; };
  for (int ring = 0; ring < kRings; ++ring)
    for (int side = 0; side < kSides; ++side) {
      const std::int32_t a = vertex(ring, side);
      const std::int32_t b = vertex(ring, side + 1);
      const std::int32_t c = vertex(ring + 1, side + 1);
      const std::int32_t d = vertex(ring + 1, side);
      mesh.face.insert(mesh.face.end(), {a, b, c, a, c, d});
      mesh.face_label.insert(mesh.face_label.end(), 2, label);
    }
}

inline void add_sphere(Mesh& mesh, std::int32_t label, double radius, double at) {
  const auto angle = [](double t) { return std::numbers::pi * t; };
  add_revolved(
      mesh, label,
      [=](double t) { return t == 0.0 || t == 1.0 ? 0.0 : radius * std::sin(angle(t)); },
      [=](double t) { return at - radius * std::cos(angle(t)); });
}

inline void add_rod(Mesh& mesh, std::int32_t label, double radius, double from, double to) {
  add_revolved(
      mesh, label, [=](double t) { return t == 0.0 || t == 1.0 ? 0.0 : radius; },
      [=](double t) { return from + (to - from) * t; });
}

// A ball on a stick.
inline Mesh lollipop(double head) {
  Mesh mesh{.label_names = {"head", "stick"}};
  add_sphere(mesh, 0, head, 0.0);
  add_rod(mesh, 1, 0.1, -head - 1.5, -0.9 * head);
  return mesh;
}

// Two balls on a bar; with a `ring` a small third ball, of a part of its own, in the middle.
inline Mesh dumbbell(double weight, bool ring) {
  Mesh mesh{.label_names = {"weight", "bar"}};
  add_sphere(mesh, 0, weight, -1.2);
  add_sphere(mesh, 0, weight, 1.2);
  add_rod(mesh, 1, 0.12, 0.9 * weight - 1.2, 1.2 - 0.9 * weight);
  if (!ring) return mesh;
  mesh.label_names.push_back("ring");
  add_sphere(mesh, 2, 0.22, 0.0);
  return mesh;
}

inline void write_shape(const std::filesystem::path& category, const std::string& name,
                        const Mesh& mesh) {
  std::filesystem::create_directories(category);
  io::write_off(category / (name + ".off"), mesh);
  io::write_labels(category / (name + "_labels.txt"), mesh);
}

inline void write_text(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

// Two categories of three shapes; Dumbbell/9 shows a part that the other two lack.
inline void write_benchmark(const std::filesystem::path& folder) {
  write_shape(folder / "Lollipop", "2", lollipop(0.5));
  write_shape(folder / "Lollipop", "10", lollipop(0.55));
  write_shape(folder / "Lollipop", "11", lollipop(0.6));
  write_shape(folder / "Dumbbell", "7", dumbbell(0.5, false));
  write_shape(folder / "Dumbbell", "8", dumbbell(0.45, false));
  write_shape(folder / "Dumbbell", "9", dumbbell(0.55, true));
}

}  // namespace cosegraph::test
