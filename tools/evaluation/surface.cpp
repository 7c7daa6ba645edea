#include "tools/evaluation/surface.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <numeric>
#include <vector>

namespace cosegraph::evaluation {
namespace {

using Index = std::int32_t;
using Corners = std::array<Index, 3>;

// Per vertex the first vertex at its position.
std::vector<Index> welded(const Mesh& mesh) {
  std::map<std::array<float, 3>, Index> at;
  std::vector<Index> result;
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    const float* p = &mesh.vertex[3 * v];
    result.push_back(at.try_emplace({p[0], p[1], p[2]}, static_cast<Index>(v)).first->second);
  }
  return result;
}

// The faces that have three different corners.
std::vector<Corners> faces_of(const Mesh& mesh) {
  const auto vertex = welded(mesh);
  std::vector<Corners> faces;
  for (std::size_t f = 0; f < mesh.face_count(); ++f) {
    Corners corners;
    for (std::size_t c = 0; c < 3; ++c)
      corners[c] = vertex[static_cast<std::size_t>(mesh.face[3 * f + c])];
    if (corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0])
      faces.push_back(corners);
  }
  return faces;
}

// An edge of a face: its two ends in ascending order, and the face's corners there.
struct Side {
  std::array<Index, 2> edge;
  std::array<std::size_t, 2> corner;
};

std::vector<Side> sides_of(const std::vector<Corners>& faces) {
  std::vector<Side> sides;
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t next = (c + 1) % 3;
      Side side{{faces[f][c], faces[f][next]}, {3 * f + c, 3 * f + next}};
      if (side.edge[0] > side.edge[1]) {
        std::swap(side.edge[0], side.edge[1]);
        std::swap(side.corner[0], side.corner[1]);
      }
      sides.push_back(side);
    }
  std::ranges::sort(sides, {}, &Side::edge);
  return sides;
}

std::size_t root_of(std::vector<std::size_t>& parent, std::size_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

// Vertices around which the faces do not form one fan.
std::size_t pinched_vertices(const std::vector<Corners>& faces, const std::vector<Side>& sides) {
  std::vector<std::size_t> parent(3 * faces.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  for (std::size_t s = 1; s < sides.size(); ++s)
    if (sides[s].edge == sides[s - 1].edge)
      for (std::size_t end = 0; end < 2; ++end)
        parent[root_of(parent, sides[s].corner[end])] = root_of(parent, sides[s - 1].corner[end]);
  std::map<Index, std::size_t> fans;
  for (std::size_t corner = 0; corner < parent.size(); ++corner)
    if (root_of(parent, corner) == corner) ++fans[faces[corner / 3][corner % 3]];
  return static_cast<std::size_t>(
      std::ranges::count_if(fans, [](const auto& fan) { return fan.second > 1; }));
}

std::size_t unused_vertices(const Mesh& mesh) {
  std::vector<bool> used(mesh.vertex_count(), false);
  for (const Index v : mesh.face) used[static_cast<std::size_t>(v)] = true;
  return static_cast<std::size_t>(std::ranges::count(used, false));
}

}  // namespace

std::string flaws_of(const Mesh& mesh) {
  const auto faces = faces_of(mesh);
  const auto sides = sides_of(faces);
  std::size_t open = 0;
  std::size_t crowded = 0;
  for (std::size_t first = 0; first < sides.size();) {
    std::size_t end = first + 1;
    while (end < sides.size() && sides[end].edge == sides[first].edge) ++end;
    if (end - first == 1) ++open;
    if (end - first > 2) ++crowded;
    first = end;
  }
  std::string flaws;
  const auto add = [&](std::size_t count, const char* what) {
    if (count > 0) flaws += (flaws.empty() ? "" : "; ") + std::to_string(count) + what;
  };
  add(open, " edges have a face on one side only (holes)");
  add(crowded, " edges have more than two faces (not a manifold)");
  // Where an edge is open or crowded the fans at its ends are broken anyway.
  if (open == 0 && crowded == 0)
    add(pinched_vertices(faces, sides), " vertices join surfaces in one point (not a manifold)");
  add(unused_vertices(mesh), " vertices belong to no face");
  return flaws;
}

}  // namespace cosegraph::evaluation
