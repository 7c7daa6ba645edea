// Closed smooth surfaces out of cross-sections. Internal to sample.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>
#include <span>
#include <vector>

#include "core/cloud.hpp"

namespace cosegraph::sample {

// A closed curve of at least three points.
using Ring = std::vector<Eigen::Vector3d>;

// A superellipse about `centre` in the plane of `side` and `up` (orthogonal unit vectors), with
// half axes `a` and `b`: power 2 is an ellipse, more is closer to a rectangle.
struct Section {
  Eigen::Vector3d centre;
  Eigen::Vector3d side;
  Eigen::Vector3d up;
  double a;
  double b;
  double power = 2.0;
};

Ring ring_of(const Section& section, int points);

// Half axes and power of a section at a place 0 .. 1 along a path.
struct Profile {
  double a;
  double b;
  double power = 2.0;
};

// Adds the closed surface through `rings` (equally many points each), its ends closed with flat
// fans. Normals point outward whichever way the rings turn.
void add_loft(Mesh& mesh, std::span<const Ring> rings, std::int32_t label);

enum class Ends { flat, round_last, round_both };

// Adds the loft of sections perpendicular to `path`, with axis `a` along `side` (made orthogonal
// to the path). A round end bulges beyond the path by the smaller half axis.
struct Sweep {
  std::vector<Eigen::Vector3d> path;
  Eigen::Vector3d side;
  std::function<Profile(double)> profile;
  int points = 24;
  Ends ends = Ends::flat;
};
void add_sweep(Mesh& mesh, const Sweep& sweep, std::int32_t label);

// Adds the surface of revolution about z of the line through (radius, height) pairs; it is closed
// at the axis on both ends.
void add_lathe(Mesh& mesh, std::span<const Eigen::Vector2d> line, int points, std::int32_t label);

// `count` points of a cubic Bezier curve, ends included.
std::vector<Eigen::Vector3d> bezier(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                    const Eigen::Vector3d& c, const Eigen::Vector3d& d, int count);

// `count` points of a straight line, ends included.
std::vector<Eigen::Vector3d> line(const Eigen::Vector3d& a, const Eigen::Vector3d& b, int count);

// Moves the vertices from index `first` on.
void deform(Mesh& mesh, std::size_t first,
            const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& move);

}  // namespace cosegraph::sample
