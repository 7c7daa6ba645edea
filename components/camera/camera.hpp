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
  double pitch = 0.005;    // distance of neighbouring rays on the object; 1 = sqrt(surface area)
  double distance = 4.0;   // sensor to the middle of the object, in its bounding radii
  int directions = 80;     // Fibonacci directions that are tried
  double visible = 0.20;   // fraction of each part's area that a valid view shows
  int count = 8;           // views that are chosen
  std::uint64_t seed = 1;  // of the roll about the optical axis and the first view chosen
};

Fields describe(Params& params);

// An ideal camera: pixel (column, row) looks along ((column - cx) / fx, (row - cy) / fy, 1).
struct Pinhole {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  double fx = 0.0;
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
};

// Where a camera is: in the camera's frame (x right, y down, z forward) a point p of the world is
// rotation p + translation. The rotation is in row order.
struct Pose {
  std::array<double, 9> rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> translation{};
};

// The camera at `eye` that looks at `target` (another point), turned by `roll` radians about its
// optical axis. Without roll the world's z axis points up in the image (along y if it is the
// optical axis).
Pose look_at(const std::array<double, 3>& eye, const std::array<double, 3>& target, double roll);

// What every pixel of a camera hits first.
struct DepthImage {
  Pinhole camera;
  std::vector<double> depth;       // width x height, row by row; along z; infinity: nothing hit
  std::vector<std::int32_t> face;  // the face that is hit, -1: nothing
};

// Both sides of a face are hit; faces with a corner that is not in front of the camera are left
// out. Of faces at exactly the same depth the one with the smaller label, then the smaller index,
// is hit, so labels do not depend on the order of the faces.
DepthImage cast(const Mesh& mesh, const Pinhole& camera, const Pose& pose);

// The organised cloud of `image`, an image of `mesh`, in the camera's frame. Pixels that hit
// nothing are NaN and without label.
Cloud to_cloud(const DepthImage& image, const Mesh& mesh);

// `count` directions spread evenly over the sphere (Fibonacci lattice), 3 numbers each.
std::vector<std::array<double, 3>> fibonacci_directions(int count);

// The organised single view of `mesh` seen from `direction` (from the object's middle toward the
// sensor), by z-buffer. Coordinates in the camera's frame: x right, y down, z forward, sensor at
// the origin. Pixels that see nothing are NaN. Labels are the faces' labels. Both sides of a face
// are visible (benchmark meshes are not consistently oriented); surfaces hide what is behind them.
Cloud render(const Mesh& mesh, const std::array<double, 3>& direction, double roll,
             const Params& params);

// Per label the fraction of its area that is visible from `direction`; 0 for labels without faces.
// Estimated from rays of a fixed, fine pitch, not params.pitch: about .01 from the truth.
std::vector<double> visible_fractions(const Mesh& mesh, const std::array<double, 3>& direction,
                                      const Params& params);

struct View {
  std::array<double, 3> direction;
  double roll;
};

// At most params.count valid views of maximum spread (farthest-point order from a seeded start).
// Where fewer of params.directions are valid, four times as many are tried; fewer views, or none,
// where that does not help. Labels without any face are ignored. An unlabelled mesh: every
// direction is valid.
std::vector<View> choose_views(const Mesh& mesh, const Params& params);

}  // namespace cosegraph::camera
