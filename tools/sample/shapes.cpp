#include "sample/shapes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/random.hpp"
#include "sample/solids.hpp"

namespace cosegraph::sample {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

double smooth_step(double t) {
  return t * t * (3.0 - 2.0 * t);
}

// A hollow vessel: its outer radius by height, and a wall of even thickness.
struct Vessel {
  double height;
  double wall;
  std::function<double(double)> radius;  // of the outside at a height

  // The closed line from the middle of the underside, up the outside, over a round rim and down
  // the inside to the middle of the floor.
  std::vector<Vector2d> line() const {
    constexpr int kSide = 36;
    constexpr int kRim = 6;
    constexpr int kFloor = 6;
    const double bend = 1.5 * wall;  // radius of the edge around the underside
    std::vector<Vector2d> points;
    for (int i = 1; i <= kFloor; ++i) points.emplace_back((radius(bend) - bend) * i / kFloor, 0.0);
    for (int i = 1; i < kRim; ++i) {
      const double angle = 0.5 * std::numbers::pi * i / kRim;
      points.emplace_back(radius(bend) - bend * (1.0 - std::sin(angle)),
                          bend * (1.0 - std::cos(angle)));
    }
    const double top = height - 0.5 * wall;
    for (int i = 0; i <= kSide; ++i) {
      const double z = bend + (top - bend) * i / kSide;
      points.emplace_back(radius(z), z);
    }
    for (int i = 1; i < kRim; ++i) {
      const double angle = std::numbers::pi * i / kRim;
      points.emplace_back(radius(top) - 0.5 * wall * (1.0 - std::cos(angle)),
                          top + 0.5 * wall * std::sin(angle));
    }
    for (int i = kSide; i >= 0; --i) {
      const double z = wall + (top - wall) * i / kSide;
      points.emplace_back(radius(std::max(z, bend)) - wall, z);
    }
    const double floor_radius = points.back().x();
    for (int i = kFloor - 1; i >= 1; --i) points.emplace_back(floor_radius * i / kFloor, wall);
    return points;
  }

  // In the middle of the wall at an angle of 0 (+x) or pi (-x) about the axis.
  Vector3d in_wall(double z, double sign) const {
    return {sign * (radius(z) - 0.5 * wall), 0.0, z};
  }
};

// An ear from the wall at `high` to the wall at `low`, leaving it at right angles, so that its flat
// ends stay inside the wall.
std::vector<Vector3d> ear(const Vessel& vessel, double sign, double low, double high, double reach,
                          double squareness, double droop) {
  constexpr int kPoints = 40;
  std::vector<Vector3d> path;
  for (int i = 0; i < kPoints; ++i) {
    const double angle = std::numbers::pi * (0.5 - static_cast<double>(i) / (kPoints - 1));
    const double out = std::pow(std::max(std::cos(angle), 0.0), squareness);
    const double across = std::sin(angle);
    const double z = 0.5 * (low + high) + 0.5 * (high - low) * across - droop * out;
    const Vector3d foot = vessel.in_wall(std::clamp(z, low, high), sign);
    path.emplace_back(foot.x() + sign * reach * out, 0.0, z);
  }
  return path;
}

Mesh make_mug(Random& random) {
  enum Label : std::int32_t { kBody, kHandle };
  Mesh mesh;
  mesh.label_names = {"body", "handle"};

  const double foot = random.uniform(0.028, 0.042);
  const double taper = random.uniform(-0.05, 0.30);
  const double bulge = random.uniform(-0.08, 0.18);
  Vessel vessel{.height = random.uniform(0.075, 0.125), .wall = random.uniform(0.004, 0.006)};
  vessel.radius = [=, h = vessel.height](double z) {
    const double t = z / h;
    return foot * (1.0 + taper * t + bulge * std::sin(std::numbers::pi * t));
  };
  add_lathe(mesh, vessel.line(), 80, kBody);

  const double high = vessel.height * random.uniform(0.76, 0.88);
  const double low = vessel.height * random.uniform(0.14, 0.34);
  const double reach = random.uniform(0.022, 0.036);
  const double squareness = random.uniform(0.55, 1.0);
  const double droop = vessel.height * random.uniform(-0.04, 0.06);
  const double width = random.uniform(0.0045, 0.0075);
  const double thickness = random.uniform(0.0032, 0.0048);
  const double power = random.uniform(2.0, 3.5);
  const double flare = random.uniform(0.0, 0.3);
  add_sweep(mesh,
            {.path = ear(vessel, 1.0, low, high, reach, squareness, droop),
             .side = Vector3d::UnitY(),
             .profile =
                 [=](double t) {
                   const double end = 1.0 + flare * std::pow(std::abs(2.0 * t - 1.0), 6.0);
                   return Profile{width * end, thickness, power};
                 },
             .points = 28},
            kHandle);
  return mesh;
}

// Adds a spout out of the wall at +x: it leaves at right angles and bends upward.
void add_spout(Mesh& mesh, const Vessel& can, Random& random, std::int32_t label) {
  const Vector3d start = can.in_wall(can.height * random.uniform(0.2, 0.35), 1.0);
  const double length = can.height * random.uniform(0.75, 1.2);
  const double slope = random.uniform(0.7, 1.1);  // radians above the horizon
  const Vector3d tip =
      start + Vector3d(0.06 + length * std::cos(slope), 0.0, length * std::sin(slope));
  const Vector3d bend = start + Vector3d(random.uniform(0.05, 0.08), 0.0, 0.0);
  const Vector3d aim =
      tip - 0.45 * length * Vector3d(std::cos(slope * 0.85), 0.0, std::sin(slope * 0.85));
  const double root = random.uniform(0.013, 0.018);
  const double end = root * random.uniform(0.5, 0.75);
  const bool rose = random.uniform() < 0.6;
  const double flare = random.uniform(1.8, 2.8);
  add_sweep(mesh,
            {.path = bezier(start, bend, aim, tip, 48),
             .side = Vector3d::UnitY(),
             .profile =
                 [=](double t) {
                   const double widening =
                       rose ? smooth_step(std::clamp((t - 0.88) / 0.12, 0.0, 1.0)) : 0.0;
                   const double radius =
                       (root + (end - root) * t) * (1.0 + (flare - 1.0) * widening);
                   return Profile{radius, radius};
                 },
             .points = 32},
            label);
}

// Over the opening, from wall to wall.
std::vector<Vector3d> arch(const Vessel& can, double z, double rise) {
  const Vector3d front = can.in_wall(z, 1.0);
  const Vector3d back = can.in_wall(z, -1.0);
  const double out = 0.45 * front.x();
  const Vector3d top(0.0, 0.0, z + rise);
  auto path =
      bezier(front, front + Vector3d(out, 0, 0), top + Vector3d(1.2 * front.x(), 0, 0), top, 28);
  const auto rest =
      bezier(top, top + Vector3d(1.2 * back.x(), 0, 0), back - Vector3d(out, 0, 0), back, 28);
  path.insert(path.end(), rest.begin() + 1, rest.end());
  return path;
}

Mesh make_watering_can(Random& random) {
  enum Label : std::int32_t { kContainer, kHandle, kSpout };
  Mesh mesh;
  mesh.label_names = {"container", "handle", "spout"};

  const double foot = random.uniform(0.075, 0.105);
  const double taper = random.uniform(-0.15, 0.1);
  const double bulge = random.uniform(0.0, 0.15);
  const double neck = random.uniform(0.55, 0.85);
  const double shoulder = random.uniform(0.78, 0.86);
  Vessel can{.height = random.uniform(0.15, 0.24), .wall = random.uniform(0.006, 0.008)};
  can.radius = [=, h = can.height](double z) {
    const double t = z / h;
    const double closing = smooth_step(std::clamp((t - shoulder) / (0.96 - shoulder), 0.0, 1.0));
    return foot * (1.0 + taper * t + bulge * std::sin(std::numbers::pi * t)) *
           (1.0 - (1.0 - neck) * closing);
  };
  add_lathe(mesh, can.line(), 72, kContainer);

  const double width = random.uniform(0.008, 0.012);
  const double thickness = random.uniform(0.005, 0.008);
  const auto profile = [=](double) { return Profile{width, thickness, 2.5}; };
  const double high = can.height * (shoulder - 0.08);
  const bool over_the_top = random.uniform() < 0.5;
  const double reach = random.uniform(0.06, 0.09);
  const double low = can.height * random.uniform(0.2, 0.35);
  const double rise = can.height * random.uniform(0.55, 0.8);
  add_sweep(mesh,
            {.path = over_the_top ? arch(can, high, rise)
                                  : ear(can, -1.0, low, high, reach, random.uniform(0.55, 0.9),
                                        -0.1 * can.height),
             .side = Vector3d::UnitY(),
             .profile = profile},
            kHandle);
  add_spout(mesh, can, random, kSpout);
  return mesh;
}

// ---- Chair

struct Seat {
  double depth;  // half, along x (the front is at +x)
  double width;  // half, along y
  double top;    // height
  double thickness;
  double power;  // of the superellipse: how square it is

  // How far the seat reaches sideways where it is `x` before or behind the middle.
  double width_at(double x) const {
    return width * std::pow(1.0 - std::pow(std::abs(x) / depth, power), 1.0 / power);
  }
  // Where the diagonal meets the outline, as a share of depth and width.
  double corner() const { return std::pow(0.5, 1.0 / power); }
};

// A slab with rounded edges and a shallow hollow to sit in.
void add_seat(Mesh& mesh, const Seat& seat, double hollow, std::int32_t label) {
  constexpr int kInner = 8;
  constexpr int kEdge = 6;
  std::vector<Ring> rings;
  const double edge = 0.5 * seat.thickness;
  const auto ring = [&](double inset, double share, double z) {
    rings.push_back(ring_of({.centre = {0, 0, z},
                             .side = Vector3d::UnitX(),
                             .up = Vector3d::UnitY(),
                             .a = (seat.depth - inset) * share,
                             .b = (seat.width - inset) * share,
                             .power = seat.power},
                            64));
  };
  for (int i = 1; i <= kInner; ++i)
    ring(edge, static_cast<double>(i) / kInner, seat.top - seat.thickness);
  for (int i = 1; i < 2 * kEdge; ++i) {
    const double angle = 0.5 * std::numbers::pi * i / kEdge;
    ring(edge * (1.0 - std::sin(angle)), 1.0, seat.top - edge - edge * std::cos(angle));
  }
  for (int i = kInner; i >= 1; --i) {
    const double share = static_cast<double>(i) / kInner;
    ring(edge, share, seat.top - hollow * (1.0 - smooth_step(share)));
  }
  add_loft(mesh, rings, label);
}

void add_bar(Mesh& mesh, const Vector3d& from, const Vector3d& to, const Profile& start,
             const Profile& end, std::int32_t label) {
  const Vector3d along = (to - from).normalized();
  add_sweep(mesh,
            {.path = line(from, to, 16),
             .side = std::abs(along.y()) < 0.9 ? Vector3d::UnitY() : Vector3d::UnitX(),
             .profile =
                 [=](double t) {
                   return Profile{start.a + (end.a - start.a) * t, start.b + (end.b - start.b) * t,
                                  start.power};
                 },
             .points = 18,
             .ends = Ends::round_last},
            label);
}

void add_legs(Mesh& mesh, const Seat& seat, Random& random, std::int32_t label) {
  const double splay = random.uniform(0.0, 0.14);
  const double thick = random.uniform(0.016, 0.024);
  const double thin = thick * random.uniform(0.6, 1.0);
  const double power = random.uniform() < 0.5 ? 2.0 : 5.0;
  const bool stretchers = random.uniform() < 0.5;
  const double rung = seat.top * random.uniform(0.25, 0.45);
  const double head = seat.top - 0.55 * seat.thickness;
  const double inset = thick + 0.5 * seat.thickness;
  const auto on_leg = [&](double x_sign, double y_sign, double z) {
    const double outward = 1.0 + splay * (head - z) / seat.top;
    return Vector3d(x_sign * (seat.depth * seat.corner() - inset) * outward,
                    y_sign * (seat.width * seat.corner() - inset) * outward, z);
  };
  for (const double x : {-1.0, 1.0})
    for (const double y : {-1.0, 1.0})
      add_bar(mesh, on_leg(x, y, head), on_leg(x, y, thin), {thick, thick, power},
              {thin, thin, power}, label);
  if (!stretchers) return;
  const Profile profile{0.55 * thin, 0.55 * thin, 2.0};
  for (const double y : {-1.0, 1.0})
    add_bar(mesh, on_leg(-1.0, y, rung), on_leg(1.0, y, rung), profile, profile, label);
  for (const double x : {-1.0, 1.0})
    add_bar(mesh, on_leg(x, -1.0, 1.2 * rung), on_leg(x, 1.0, 1.2 * rung), profile, profile, label);
}

// Built upright above the rear edge of the seat, then leant back and bent around the sitter.
void add_back(Mesh& mesh, const Seat& seat, Random& random, std::int32_t label) {
  enum Style { kPanel, kSlats, kSpindles };
  const auto style = static_cast<Style>(random.below(3));
  const double height = random.uniform(0.34, 0.52);
  const double lean = random.uniform(0.08, 0.28);
  const double bend = random.uniform(0.01, 0.06);
  const double base = seat.top - 0.5 * seat.thickness;
  const double x = 0.018 + 0.5 * seat.thickness - seat.depth;
  const double half_width = (seat.width_at(x) - 0.02) * random.uniform(0.88, 1.0);
  const std::size_t first = mesh.vertex_count();
  if (style == kPanel) {
    const double narrowing = random.uniform(0.7, 1.0);
    const double thickness = random.uniform(0.010, 0.018);
    add_sweep(mesh,
              {.path = line({x, 0, base}, {x, 0, base + height}, 32),
               .side = Vector3d::UnitY(),
               .profile =
                   [=](double t) {
                     return Profile{half_width * (1.0 + (narrowing - 1.0) * t), thickness, 6.0};
                   },
               .points = 80,
               .ends = Ends::round_last},
              label);
  } else {
    const Profile post{0.017, 0.017, 2.5};
    for (const double y : {-half_width, half_width})
      add_bar(mesh, {x, y, base}, {x, y, base + height}, post, post, label);
    const int count = style == kSlats ? 2 + static_cast<int>(random.below(3))
                                      : 4 + static_cast<int>(random.below(4));
    const double rail = random.uniform(0.022, 0.04);
    const auto add_rail = [&](double z, double half_height) {
      add_sweep(mesh,
                {.path = line({x, -half_width, z}, {x, half_width, z}, 28),
                 .side = Vector3d::UnitZ(),
                 .profile =
                     [=](double) {
                       return Profile{half_height, 0.009, 3.5};
                     },
                 .points = 20},
                label);
    };
    add_rail(base + height - rail, rail);
    if (style == kSlats)
      for (int i = 0; i + 1 < count; ++i)
        add_rail(base + height * (0.35 + 0.5 * i / (count - 1)), 0.6 * rail);
    else
      for (int i = 0; i < count; ++i) {
        const double y = half_width * (2.0 * (i + 1) / (count + 1) - 1.0);
        add_bar(mesh, {x, y, base}, {x, y, base + height - rail}, {0.009, 0.009}, {0.009, 0.009},
                label);
      }
  }
  deform(mesh, first, [=](const Vector3d& p) {
    const double up = std::max(p.z() - base, 0.0);
    const double across = p.y() / half_width;
    const double reach = std::min(up / height, 1.0);
    return Vector3d(p.x() - lean * up - bend * (1.0 - across * across) * reach, p.y(), p.z());
  });
}

Mesh make_chair(Random& random) {
  enum Label : std::int32_t { kBack, kSeat, kLeg };
  Mesh mesh;
  mesh.label_names = {"back", "seat", "leg"};
  const Seat seat{.depth = random.uniform(0.19, 0.24),
                  .width = random.uniform(0.19, 0.25),
                  .top = random.uniform(0.40, 0.50),
                  .thickness = random.uniform(0.028, 0.05),
                  .power = random.uniform(3.5, 8.0)};
  add_back(mesh, seat, random, kBack);
  add_seat(mesh, seat, random.uniform(0.0, 0.012), kSeat);
  add_legs(mesh, seat, random, kLeg);
  return mesh;
}

// ---- Aeroplane

// A wing-like body: airfoil sections from `root` (leading edge) along `span`, flown along +x.
struct Airfoil {
  Vector3d root;
  Vector3d span;       // to the leading edge of the tip
  Vector3d thickness;  // unit vector across
  double root_chord;
  double tip_chord;
  double ratio;  // thickness to chord
};

void add_airfoil(Mesh& mesh, const Airfoil& wing, std::int32_t label) {
  constexpr int kHalf = 20;  // points per side of a section
  constexpr int kSpan = 28;
  constexpr double kRound = 0.96;  // from here the tip is rounded off
  // NACA four-digit thickness with a closed trailing edge.
  const auto half_thickness = [&](double x) {
    return 5.0 * wing.ratio *
           (0.2969 * std::sqrt(x) + x * (-0.1260 + x * (-0.3516 + x * (0.2843 - x * 0.1036))));
  };
  std::vector<Ring> rings;
  for (int i = 0; i <= kSpan; ++i) {
    const double t = static_cast<double>(i) / kSpan;
    const double beyond = std::max(t - kRound, 0.0) / (1.0 - kRound);
    const double shrink = std::sqrt(std::max(1.0 - 0.96 * beyond * beyond, 0.0));
    const double chord = wing.root_chord + (wing.tip_chord - wing.root_chord) * t;
    const Vector3d lead = wing.root + wing.span * t;
    Ring ring;
    for (int k = 0; k < 2 * kHalf; ++k) {
      const double x = 0.5 * (1.0 + std::cos(std::numbers::pi * k / kHalf));
      const double side = k < kHalf ? 1.0 : -1.0;
      const double back = 0.5 + (x - 0.5) * (1.0 - 0.3 * beyond);
      ring.push_back(lead - Vector3d(back * chord, 0.0, 0.0) +
                     wing.thickness * (side * half_thickness(x) * chord * shrink));
    }
    rings.push_back(std::move(ring));
  }
  add_loft(mesh, rings, label);
}

struct Fuselage {
  double length;  // from x = 0 (nose) back to x = -length
  double radius;
  double nose;  // share of the length
  double tail;
  double lift;  // how far the tail's axis rises

  double radius_at(double t) const {
    constexpr double kEnd = 0.16;
    if (t < nose) return radius * std::sqrt(1.0 - std::pow(1.0 - t / nose, 2.0));
    if (t < 1.0 - tail) return radius;
    return radius * (1.0 + (kEnd - 1.0) * smooth_step((t - 1.0 + tail) / tail));
  }
  Vector3d axis(double t) const {
    const double rise = std::max(t - 1.0 + tail, 0.0) / tail;
    return {-length * t, 0.0, lift * smooth_step(rise)};
  }
};

void add_fuselage(Mesh& mesh, const Fuselage& fuselage, double flatness, std::int32_t label) {
  constexpr int kRings = 84;
  std::vector<Ring> rings;
  for (int i = 0; i < kRings; ++i) {
    // Dense at the nose, where the radius changes fast.
    const double u = (i + 0.35) / (kRings - 0.65);
    const double t = 0.35 * u * u + 0.65 * u;
    const double r = fuselage.radius_at(t);
    rings.push_back(ring_of({.centre = fuselage.axis(t),
                             .side = Vector3d::UnitY(),
                             .up = Vector3d::UnitZ(),
                             .a = r * flatness,
                             .b = r},
                            44));
  }
  add_loft(mesh, rings, label);
}

void add_wings(Mesh& mesh, const Fuselage& body, Random& random, std::int32_t label) {
  const double span = body.length * random.uniform(0.40, 0.60);  // of one side
  const double sweep = span * random.uniform(0.0, 0.65);
  const double rise = span * random.uniform(-0.02, 0.12);
  const double chord = body.length * random.uniform(0.15, 0.24);
  const double tip = chord * random.uniform(0.3, 0.75);
  const double place = body.length * random.uniform(0.30, 0.38);
  const double level = body.radius * random.uniform(-0.65, 0.65);
  const double ratio = random.uniform(0.10, 0.14);
  for (const double side : {-1.0, 1.0})
    add_airfoil(mesh,
                {.root = {-place, side * 0.55 * body.radius, level},
                 .span = {-sweep, side * span, rise},
                 .thickness = Vector3d::UnitZ(),
                 .root_chord = chord,
                 .tip_chord = tip,
                 .ratio = ratio},
                label);
}

void add_tail(Mesh& mesh, const Fuselage& body, Random& random, std::int32_t label) {
  const double height = body.length * random.uniform(0.13, 0.20);
  const double chord = body.length * random.uniform(0.10, 0.15);
  const double fin_tip = chord * random.uniform(0.5, 0.8);
  const double fin_sweep = height * random.uniform(0.3, 0.9);
  const double half_span = body.length * random.uniform(0.14, 0.22);
  const double sweep = half_span * random.uniform(0.1, 0.6);
  const double taper = random.uniform(0.45, 0.8);
  const bool t_tail = random.uniform() < 0.35;
  const Vector3d foot = body.axis(0.98 - chord / body.length);
  add_airfoil(mesh,
              {.root = foot,
               .span = {-fin_sweep, 0.0, height},
               .thickness = Vector3d::UnitY(),
               .root_chord = chord,
               .tip_chord = fin_tip,
               .ratio = 0.12},
              label);
  const double width = t_tail ? std::min(0.9 * fin_tip, chord) : 0.85 * chord;
  const double up = t_tail ? 0.93 : 0.12;
  const Vector3d root = foot + up * Vector3d(-fin_sweep, 0.0, height);
  for (const double side : {-1.0, 1.0})
    add_airfoil(mesh,
                {.root = root - Vector3d(0.0, side * 0.002 * body.length, 0.0),
                 .span = {-sweep, side * half_span, 0.04 * half_span},
                 .thickness = Vector3d::UnitZ(),
                 .root_chord = width,
                 .tip_chord = width * taper,
                 .ratio = 0.11},
                label);
}

Mesh make_aeroplane(Random& random) {
  enum Label : std::int32_t { kBody, kWing, kTail };
  Mesh mesh;
  mesh.label_names = {"body", "wing", "tail"};
  Fuselage body{.length = random.uniform(0.5, 0.8)};  // a model aeroplane
  body.radius = body.length * random.uniform(0.06, 0.09);
  body.nose = random.uniform(0.10, 0.2);
  body.tail = random.uniform(0.35, 0.5);
  body.lift = body.radius * random.uniform(0.2, 0.7);
  add_fuselage(mesh, body, random.uniform(0.85, 1.05), kBody);
  add_wings(mesh, body, random, kWing);
  add_tail(mesh, body, random, kTail);
  return mesh;
}

void stand_on_ground(Mesh& mesh) {
  float lowest = mesh.vertex[2];
  for (std::size_t i = 2; i < mesh.vertex.size(); i += 3) lowest = std::min(lowest, mesh.vertex[i]);
  for (std::size_t i = 2; i < mesh.vertex.size(); i += 3) mesh.vertex[i] -= lowest;
}

Mesh build(Kind kind, Random& random) {
  switch (kind) {
    case Kind::mug:
      return make_mug(random);
    case Kind::watering_can:
      return make_watering_can(random);
    case Kind::chair:
      return make_chair(random);
    case Kind::aeroplane:
      return make_aeroplane(random);
  }
  throw ParameterError("no such kind of shape");
}

}  // namespace

Mesh make(Kind kind, std::uint64_t seed) {
  Random random(derive_seed(seed, static_cast<std::uint64_t>(kind)));
  Mesh mesh = build(kind, random);
  stand_on_ground(mesh);
  return mesh;
}

}  // namespace cosegraph::sample

template <>
cosegraph::Names<cosegraph::sample::Kind> cosegraph::names<cosegraph::sample::Kind>() {
  using cosegraph::sample::Kind;
  static constexpr std::pair<Kind, std::string_view> kTable[] = {
      {Kind::mug, "mug"},
      {Kind::watering_can, "watering_can"},
      {Kind::chair, "chair"},
      {Kind::aeroplane, "aeroplane"}};
  return kTable;
}
