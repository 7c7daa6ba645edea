// A virtual depth camera around a mesh, and the choice of views (the paper's section 4.1): a view
// is valid if at least 20 % of the area of every part is visible; of the valid ones those of
// maximum spread are taken.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/cloud.hpp"
#include "core/fields.hpp"

namespace cosegraph::camera {

struct Params {
  double pitch = 0.005;     // distance of neighbouring rays on the object; 1 = sqrt(surface area)
  double distance = 4.0;    // sensor to the middle of the object, in its bounding radii
  int directions = 80;      // Fibonacci directions that are tried
  double visible = 0.20;    // fraction of each part's area that a valid view shows
  int count = 8;            // views that are chosen
  std::uint64_t seed = 1;   // of the roll about the optical axis and the first view chosen
};

Fields describe(Params& params);

// `count` directions spread evenly over the sphere (Fibonacci lattice), 3 numbers each.
std::vector<std::array<double, 3>> fibonacci_directions(int count);

// The organised single view of `mesh` seen from `direction` (from the object's middle toward the
// sensor), by z-buffer. Coordinates in the camera's frame: x right, y down, z forward, sensor at
// the origin. Pixels that see nothing are NaN. Labels are the faces' labels. Both sides of a face
// are visible (benchmark meshes are not consistently oriented); surfaces hide what is behind them.
Cloud render(const Mesh& mesh, const std::array<double, 3>& direction, double roll,
             const Params& params);

// Per label the fraction of its area that is visible from `direction`; 0 for labels without faces.
std::vector<double> visible_fractions(const Mesh& mesh, const std::array<double, 3>& direction,
                                      const Params& params);

struct View {
  std::array<double, 3> direction;
  double roll;
};

// At most params.count valid views of maximum spread (farthest-point order from a seeded start);
// fewer, or none, where fewer directions are valid. Labels without any face are ignored. An
// unlabelled mesh: every direction is valid.
std::vector<View> choose_views(const Mesh& mesh, const Params& params);

}  // namespace cosegraph::camera
