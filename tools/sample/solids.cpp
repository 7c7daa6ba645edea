#include "sample/solids.hpp"

#include <cmath>
#include <numbers>

namespace cosegraph::sample {
namespace {

using Eigen::Vector3d;

std::int32_t add_vertex(Mesh& mesh, const Vector3d& p) {
  for (int axis = 0; axis < 3; ++axis) mesh.vertex.push_back(static_cast<float>(p[axis]));
  return static_cast<std::int32_t>(mesh.vertex_count()) - 1;
}

void add_face(Mesh& mesh, std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t label) {
  mesh.face.insert(mesh.face.end(), {a, b, c});
  mesh.face_label.push_back(label);
}

Vector3d vertex(const Mesh& mesh, std::size_t corner) {
  const auto v = static_cast<std::size_t>(mesh.face[corner]);
  return Eigen::Map<const Eigen::Vector3f>(&mesh.vertex[3 * v]).cast<double>();
}

// Six times the volume inside the faces from `first` on; negative if they are inside out.
double signed_volume(const Mesh& mesh, std::size_t first) {
  const Vector3d origin = vertex(mesh, 3 * first);
  double volume = 0.0;
  for (std::size_t f = first; f < mesh.face_count(); ++f)
    volume += (vertex(mesh, 3 * f) - origin)
                  .dot((vertex(mesh, 3 * f + 1) - origin).cross(vertex(mesh, 3 * f + 2) - origin));
  return volume;
}

void turn_outward(Mesh& mesh, std::size_t first) {
  if (signed_volume(mesh, first) >= 0.0) return;
  for (std::size_t f = first; f < mesh.face_count(); ++f)
    std::swap(mesh.face[3 * f + 1], mesh.face[3 * f + 2]);
}

Vector3d mean_of(const Ring& ring) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& p : ring) sum += p;
  return sum / static_cast<double>(ring.size());
}

// Sections that turn the flat end at `section` into a dome of the height of its smaller axis.
std::vector<Section> dome(const Section& section, const Vector3d& outward) {
  constexpr int kSteps = 5;
  std::vector<Section> result;
  for (int i = 1; i <= kSteps; ++i) {
    const double angle = 0.5 * std::numbers::pi * i / (kSteps + 0.5);
    const double height = std::min(section.a, section.b);
    Section ring = section;
    ring.centre += outward * height * std::sin(angle);
    const double inset = height * (1.0 - std::cos(angle));
    ring.a -= inset;
    ring.b -= inset;
    result.push_back(ring);
  }
  return result;
}

}  // namespace

Ring ring_of(const Section& section, int points) {
  Ring ring;
  for (int i = 0; i < points; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / points;
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    const double radius =
        std::pow(std::pow(std::abs(c), section.power) + std::pow(std::abs(s), section.power),
                 -1.0 / section.power);
    ring.push_back(section.centre + section.side * (section.a * radius * c) +
                   section.up * (section.b * radius * s));
  }
  return ring;
}

void add_loft(Mesh& mesh, std::span<const Ring> rings, std::int32_t label) {
  const std::size_t first_face = mesh.face_count();
  const auto n = static_cast<std::int32_t>(rings.front().size());
  const auto start = static_cast<std::int32_t>(mesh.vertex_count());
  for (const Ring& ring : rings)
    for (const Vector3d& p : ring) add_vertex(mesh, p);
  const std::int32_t last = start + n * (static_cast<std::int32_t>(rings.size()) - 1);
  const std::int32_t start_centre = add_vertex(mesh, mean_of(rings.front()));
  const std::int32_t last_centre = add_vertex(mesh, mean_of(rings.back()));
  for (std::int32_t i = 0; i < n; ++i) {
    const std::int32_t j = (i + 1) % n;
    for (std::int32_t base = start; base < last; base += n) {
      add_face(mesh, base + i, base + j, base + n + j, label);
      add_face(mesh, base + i, base + n + j, base + n + i, label);
    }
    add_face(mesh, start_centre, start + j, start + i, label);
    add_face(mesh, last_centre, last + i, last + j, label);
  }
  turn_outward(mesh, first_face);
}

void add_sweep(Mesh& mesh, const Sweep& sweep, std::int32_t label) {
  const std::size_t count = sweep.path.size();
  std::vector<Section> sections;
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d ahead = sweep.path[std::min(i + 1, count - 1)];
    const Vector3d tangent = (ahead - sweep.path[i > 0 ? i - 1 : 0]).normalized();
    const Vector3d side = (sweep.side - tangent * tangent.dot(sweep.side)).normalized();
    const Profile p = sweep.profile(static_cast<double>(i) / static_cast<double>(count - 1));
    sections.push_back({sweep.path[i], side, tangent.cross(side), p.a, p.b, p.power});
  }
  if (sweep.ends == Ends::round_both) {
    auto start = dome(sections.front(), (sweep.path[0] - sweep.path[1]).normalized());
    sections.insert(sections.begin(), start.rbegin(), start.rend());
  }
  if (sweep.ends != Ends::flat) {
    const auto end =
        dome(sections.back(), (sweep.path[count - 1] - sweep.path[count - 2]).normalized());
    sections.insert(sections.end(), end.begin(), end.end());
  }
  std::vector<Ring> rings;
  for (const Section& section : sections) rings.push_back(ring_of(section, sweep.points));
  add_loft(mesh, rings, label);
}

void add_lathe(Mesh& mesh, std::span<const Eigen::Vector2d> line, int points, std::int32_t label) {
  std::vector<Ring> rings;
  for (const Eigen::Vector2d& p : line)
    rings.push_back(ring_of({.centre = {0, 0, p.y()},
                             .side = Vector3d::UnitX(),
                             .up = Vector3d::UnitY(),
                             .a = p.x(),
                             .b = p.x()},
                            points));
  add_loft(mesh, rings, label);
}

std::vector<Vector3d> bezier(const Vector3d& a, const Vector3d& b, const Vector3d& c,
                             const Vector3d& d, int count) {
  std::vector<Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double t = static_cast<double>(i) / (count - 1);
    const double s = 1.0 - t;
    points.push_back(s * s * s * a + 3.0 * s * s * t * b + 3.0 * s * t * t * c + t * t * t * d);
  }
  return points;
}

std::vector<Vector3d> line(const Vector3d& a, const Vector3d& b, int count) {
  std::vector<Vector3d> points;
  for (int i = 0; i < count; ++i)
    points.push_back(a + (b - a) * (static_cast<double>(i) / (count - 1)));
  return points;
}

void deform(Mesh& mesh, std::size_t first, const std::function<Vector3d(const Vector3d&)>& move) {
  for (std::size_t v = first; v < mesh.vertex_count(); ++v) {
    Eigen::Map<Eigen::Vector3f> p(&mesh.vertex[3 * v]);
    p = move(p.cast<double>()).cast<float>();
  }
}

}  // namespace cosegraph::sample
