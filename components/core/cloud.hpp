// Point clouds and labelled meshes.
//
// Structures of arrays, as on the wire. A point's three numbers are adjacent: xyz[3 i + axis].
// All coordinates of one frame are in the sensor's frame and in the input's own length unit.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/error.hpp"

namespace cosegraph {

constexpr std::int32_t kNoLabel = -1;
constexpr std::int32_t kNoPoint = -1;

struct Cloud {
  std::vector<float> xyz;     // 3N; in the `input` cloud of a frame a removed point may be NaN
  std::vector<float> normal;  // 3N unit vectors toward the sensor, or empty
  std::vector<float> rgb;     // 3N in [0, 1], or empty
  std::vector<std::int32_t> label;       // N indices into label_names or kNoLabel, or empty
  std::vector<std::string> label_names;  // empty exactly if `label` is empty
  std::array<float, 3> origin{};         // where the sensor is

  // Length of one "scale" in the input's unit. Every parameter with unit "scale" is multiplied by
  // it, which makes clouds of different objects comparable. Estimated from the visible points.
  float scale = 1.0F;
  // How scale, points and normals were made: recipe text of source::Params. Empty for raw input.
  std::string recipe;

  // For each point the point of the frame's `dense` cloud that stands for it, kNoPoint if it was
  // removed. Empty in `dense` itself.
  std::vector<std::int32_t> dense_index;

  // What a user should know of how the cloud came about ("2000000 points reduced to 19873").
  std::vector<std::string> notes;

  // Grid of the sensor: width * height == N; height == 1 for an unorganised cloud.
  std::uint32_t width = 0;
  std::uint32_t height = 1;

  // Of a sensor's cloud: the name of its coordinate frame, and when it was taken in ns since 1970.
  std::string frame_id;
  std::int64_t stamp = 0;

  std::size_t size() const { return xyz.size() / 3; }
};

// Throws InputError if the arrays of `cloud` do not fit together (lengths, label indices, width x
// height). Does not look at coordinates.
void check_sizes(const Cloud& cloud);

// The points of `cloud` with finite coordinates, in order, as an unorganised cloud.
Cloud finite_points(const Cloud& cloud);

// A triangle mesh with one label per face.
struct Mesh {
  std::vector<float> vertex;             // 3V
  std::vector<std::int32_t> face;        // 3F vertex indices, counter-clockwise from outside
  std::vector<std::int32_t> face_label;  // F, or empty
  std::vector<std::string> label_names;  // empty exactly if face_label is empty

  std::size_t vertex_count() const { return vertex.size() / 3; }
  std::size_t face_count() const { return face.size() / 3; }
};

// Throws InputError if indices or lengths of `mesh` do not fit together.
void check_sizes(const Mesh& mesh);

// Surface area, in the mesh's unit squared.
double surface_area(const Mesh& mesh);

}  // namespace cosegraph
