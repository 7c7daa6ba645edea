// Triangles against the pixels of a pinhole camera. Internal to camera.
//
// A pixel is hit if the ray through its centre r = (x, y, 1) has the three corners on the same
// side: (a x b).r, (b x c).r and (c x a).r agree in sign (Olano, Greer, "Triangle scan conversion
// using 2D homogeneous coordinates", 1997). The product of a shared edge has the same size in both
// faces to the last bit, so a closed surface has no cracks; on an edge both faces are hit.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "camera/camera.hpp"
#include "core/cloud.hpp"

namespace cosegraph::camera {

class Raster {
 public:
  // Keeps a reference to `mesh`.
  Raster(const Mesh& mesh, const Pinhole& camera, const Pose& pose);

  // Calls visit(pixel index, depth) for every pixel whose ray hits face `f`, row by row. A face
  // without area, seen edge-on, or with a corner that is not in front of the camera has no pixels.
  template <class Visit>
  void for_each_pixel(std::size_t f, const Visit& visit) const;

  // The nearest face at every pixel: what cast() promises.
  DepthImage draw() const;

  double area(std::size_t f) const { return 0.5 * normal(f).norm(); }

  // The area of the surface that one ray stands for which hits face `f` at `depth`: that of a pixel
  // thrown onto the face's plane.
  double footprint(std::size_t f, double depth) const {
    const Eigen::Vector3d n = normal(f);
    return depth * depth * depth * n.norm() /
           (std::abs(n.dot(corner(f, 0))) * camera_.fx * camera_.fy);
  }

 private:
  Eigen::Vector3d corner(std::size_t f, std::size_t c) const {
    return points_[static_cast<std::size_t>(mesh_->face[3 * f + c])];
  }
  // Twice the area long.
  Eigen::Vector3d normal(std::size_t f) const {
    return (corner(f, 1) - corner(f, 0)).cross(corner(f, 2) - corner(f, 0));
  }

  // First and last pixel centre between two image coordinates, cut to 0 .. size - 1.
  struct Range {
    int first;
    int last;
  };
  static Range pixels_between(double low, double high, std::uint32_t size) {
    constexpr double kMargin = 1e-9;  // of a pixel: rounding must not lose a centre on an edge
    const double last = std::min(std::floor(high + kMargin), static_cast<double>(size) - 1.0);
    const double first = std::max(std::ceil(low - kMargin), 0.0);
    if (!(first <= last)) return {0, -1};
    return {static_cast<int>(first), static_cast<int>(last)};
  }

  const Mesh* mesh_;
  Pinhole camera_;
  std::vector<Eigen::Vector3d> points_;  // the vertices in the camera's frame
};

template <class Visit>
void Raster::for_each_pixel(std::size_t f, const Visit& visit) const {
  const Eigen::Vector3d a = corner(f, 0);
  const Eigen::Vector3d b = corner(f, 1);
  const Eigen::Vector3d c = corner(f, 2);
  const double nearest = std::min({a.z(), b.z(), c.z()});
  if (!(nearest > 0.0)) return;
  const double farthest = std::max({a.z(), b.z(), c.z()});

  const Eigen::Array3d u(a.x() / a.z(), b.x() / b.z(), c.x() / c.z());
  const Eigen::Array3d v(a.y() / a.z(), b.y() / b.z(), c.y() / c.z());
  const Range columns = pixels_between(u.minCoeff() * camera_.fx + camera_.cx,
                                       u.maxCoeff() * camera_.fx + camera_.cx, camera_.width);
  const Range rows = pixels_between(v.minCoeff() * camera_.fy + camera_.cy,
                                    v.maxCoeff() * camera_.fy + camera_.cy, camera_.height);
  if (columns.last < 0 || rows.last < 0) return;

  const Eigen::Vector3d ab = a.cross(b);
  const Eigen::Vector3d bc = b.cross(c);
  const Eigen::Vector3d ca = c.cross(a);
  const Eigen::Vector3d n = normal(f);
  const double offset = n.dot(a);
  if (offset == 0.0) return;
  for (int row = rows.first; row <= rows.last; ++row) {
    const double y = (row - camera_.cy) / camera_.fy;
    for (int column = columns.first; column <= columns.last; ++column) {
      const Eigen::Vector3d ray((column - camera_.cx) / camera_.fx, y, 1.0);
      const double e0 = ab.dot(ray);
      const double e1 = bc.dot(ray);
      const double e2 = ca.dot(ray);
      const bool inside =
          (e0 >= 0.0 && e1 >= 0.0 && e2 >= 0.0) || (e0 <= 0.0 && e1 <= 0.0 && e2 <= 0.0);
      if (!inside) continue;
      // The clamp only matters for slivers, whose planes are ill-determined.
      const double depth = std::clamp(offset / n.dot(ray), nearest, farthest);
      visit(static_cast<std::size_t>(row) * camera_.width + static_cast<std::size_t>(column),
            depth);
    }
  }
}

}  // namespace cosegraph::camera
