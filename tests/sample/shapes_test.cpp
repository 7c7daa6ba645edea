#include "sample/shapes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <set>

#include "camera/camera.hpp"

namespace cosegraph::sample {
namespace {

constexpr std::array kKinds{Kind::mug, Kind::watering_can, Kind::chair, Kind::aeroplane};
constexpr std::uint64_t kSeeds = 6;

Eigen::Vector3d vertex(const Mesh& mesh, std::int32_t v) {
  return Eigen::Map<const Eigen::Vector3f>(&mesh.vertex[3 * static_cast<std::size_t>(v)])
      .cast<double>();
}

std::array<std::int32_t, 3> face(const Mesh& mesh, std::size_t f) {
  return {mesh.face[3 * f], mesh.face[3 * f + 1], mesh.face[3 * f + 2]};
}

// For each vertex the smallest vertex that it is connected with through faces.
std::vector<std::int32_t> components(const Mesh& mesh) {
  std::vector<std::int32_t> parent(mesh.vertex_count());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t v) {
    while (parent[static_cast<std::size_t>(v)] != v) v = parent[static_cast<std::size_t>(v)];
    return v;
  };
  for (std::size_t f = 0; f < mesh.face_count(); ++f)
    for (const std::int32_t v : face(mesh, f)) {
      const std::int32_t a = root(v);
      const std::int32_t b = root(mesh.face[3 * f]);
      parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }
  for (std::size_t v = 0; v < parent.size(); ++v) parent[v] = root(static_cast<std::int32_t>(v));
  return parent;
}

// Solid angle of all faces but those of component `except`, over 4 pi: how often they enclose `p`.
double winding(const Mesh& mesh, const std::vector<std::int32_t>& component, std::int32_t except,
               const Eigen::Vector3d& p) {
  double angle = 0.0;
  for (std::size_t f = 0; f < mesh.face_count(); ++f) {
    const auto corner = face(mesh, f);
    if (component[static_cast<std::size_t>(corner[0])] == except) continue;
    const Eigen::Vector3d a = vertex(mesh, corner[0]) - p;
    const Eigen::Vector3d b = vertex(mesh, corner[1]) - p;
    const Eigen::Vector3d c = vertex(mesh, corner[2]) - p;
    const double x = a.norm() * b.norm() * c.norm() + a.dot(b) * c.norm() + b.dot(c) * a.norm() +
                     c.dot(a) * b.norm();
    angle += 2.0 * std::atan2(a.dot(b.cross(c)), x);
  }
  return angle / (4.0 * std::numbers::pi);
}

class Shapes : public testing::TestWithParam<Kind> {};

TEST_P(Shapes, AreLabelledMeshesOfHandySizeThatStandOnTheGround) {
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const Mesh mesh = make(GetParam(), seed);
    check_sizes(mesh);
    EXPECT_GE(mesh.face_count(), 5000U);
    EXPECT_LE(mesh.face_count(), 20000U);
    const std::set<std::int32_t> used(mesh.face_label.begin(), mesh.face_label.end());
    EXPECT_EQ(used.size(), mesh.label_names.size());
    EXPECT_FALSE(used.contains(kNoLabel));
    float lowest = 1.0F;
    for (std::size_t i = 2; i < mesh.vertex.size(); i += 3)
      lowest = std::min(lowest, mesh.vertex[i]);
    EXPECT_EQ(lowest, 0.0F);
  }
}

TEST_P(Shapes, EveryEdgeHasTwoFacesThatAgreeOnTheOutside) {
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const Mesh mesh = make(GetParam(), seed);
    std::set<std::pair<std::int32_t, std::int32_t>> edges;
    for (std::size_t f = 0; f < mesh.face_count(); ++f) {
      const auto corner = face(mesh, f);
      for (std::size_t c = 0; c < 3; ++c)
        ASSERT_TRUE(edges.emplace(corner[c], corner[(c + 1) % 3]).second) << "face " << f;
    }
    for (const auto& [from, to] : edges) ASSERT_TRUE(edges.contains({to, from}));
  }
}

TEST_P(Shapes, EveryClosedPieceHasItsNormalsOutward) {
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const Mesh mesh = make(GetParam(), seed);
    const auto component = components(mesh);
    std::map<std::int32_t, double> volume;
    for (std::size_t f = 0; f < mesh.face_count(); ++f) {
      const auto [a, b, c] = face(mesh, f);
      volume[component[static_cast<std::size_t>(a)]] +=
          vertex(mesh, a).dot(vertex(mesh, b).cross(vertex(mesh, c))) / 6.0;
    }
    EXPECT_GE(volume.size(), mesh.label_names.size());
    for (const auto& [piece, size] : volume) EXPECT_GT(size, 1e-7) << "piece of vertex " << piece;
  }
}

TEST_P(Shapes, FacesAreNeitherDegenerateNorHuge) {
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const Mesh mesh = make(GetParam(), seed);
    const double scale = std::sqrt(surface_area(mesh));
    for (std::size_t f = 0; f < mesh.face_count(); ++f) {
      const auto [a, b, c] = face(mesh, f);
      const Eigen::Vector3d cross =
          (vertex(mesh, b) - vertex(mesh, a)).cross(vertex(mesh, c) - vertex(mesh, a));
      ASSERT_GT(cross.norm(), 0.0) << "face " << f;
      ASSERT_LT((vertex(mesh, b) - vertex(mesh, a)).norm(), 0.25 * scale) << "face " << f;
    }
  }
}

TEST_P(Shapes, EveryPieceReachesIntoAnother) {
  const Mesh mesh = make(GetParam(), 3);
  const auto component = components(mesh);
  std::set<std::int32_t> joined;
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    // From the back: the centres of a piece's flat ends come last.
    const std::size_t i = mesh.vertex_count() - 1 - v;
    if (joined.contains(component[i])) continue;
    if (winding(mesh, component, component[i], vertex(mesh, static_cast<std::int32_t>(i))) > 0.5)
      joined.insert(component[i]);
    else if (component[i] == 0)
      break;  // the first piece: the others reach into it
  }
  std::set<std::int32_t> all(component.begin(), component.end());
  all.erase(0);
  joined.erase(0);
  EXPECT_EQ(joined, all);
}

TEST_P(Shapes, TheSameSeedGivesTheSameMeshAndAnotherSeedAnother) {
  EXPECT_EQ(make(GetParam(), 5).vertex, make(GetParam(), 5).vertex);
  EXPECT_EQ(make(GetParam(), 5).face, make(GetParam(), 5).face);
  EXPECT_NE(make(GetParam(), 5).vertex, make(GetParam(), 6).vertex);
}

TEST_P(Shapes, HaveEightViewsThatShowEveryPart) {
  for (std::uint64_t seed = 0; seed < 2; ++seed)
    EXPECT_EQ(camera::choose_views(make(GetParam(), seed), {}).size(), 8U) << seed;
}

INSTANTIATE_TEST_SUITE_P(Kinds, Shapes, testing::ValuesIn(kKinds),
                         [](const auto& info) { return std::string(to_name(info.param)); });

// What is seen from high above within a quarter of the width of the opening.
std::set<std::string> seen_inside(const Mesh& mesh) {
  const camera::Pinhole camera{
      .width = 201, .height = 201, .fx = 4000, .fy = 4000, .cx = 100, .cy = 100};
  const double height = 4.0;
  const auto image = camera::cast(mesh, camera, camera::look_at({0, 0, height}, {0, 0, 0}, 0.0));
  std::set<std::string> labels;
  for (std::size_t i = 0; i < image.face.size(); ++i) {
    const double radius =
        height / camera.fx *
        std::hypot(static_cast<double>(i % 201) - 100.0, static_cast<double>(i / 201) - 100.0);
    if (image.face[i] >= 0 && radius < 0.02)
      labels.insert(mesh.label_names[static_cast<std::size_t>(
          mesh.face_label[static_cast<std::size_t>(image.face[i])])]);
  }
  return labels;
}

// Largest radius of the label's vertices within `band` of height `z`.
double outer_radius(const Mesh& mesh, std::int32_t label, double z, double band) {
  double radius = 0.0;
  for (std::size_t i = 0; i < mesh.face.size(); ++i) {
    const Eigen::Vector3d p = vertex(mesh, mesh.face[i]);
    if (mesh.face_label[i / 3] == label && std::abs(p.z() - z) < band)
      radius = std::max(radius, std::hypot(p.x(), p.y()));
  }
  return radius;
}

TEST(Mug, IsHollowAndItsHandleStaysOutOfTheHollow) {
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    const Mesh mesh = make(Kind::mug, seed);
    EXPECT_EQ(seen_inside(mesh), std::set<std::string>{"body"}) << seed;
    const auto component = components(mesh);
    for (std::size_t f = 0; f < mesh.face_count(); f += 40) {
      if (mesh.face_label[f] != 1) continue;
      const std::int32_t v = mesh.face[3 * f];
      const Eigen::Vector3d p = vertex(mesh, v);
      const bool in_wall =
          winding(mesh, component, component[static_cast<std::size_t>(v)], p) > 0.5;
      // The wall is at least .004 thick: nearer to the outside than this is not the hollow.
      const double outside = outer_radius(mesh, 0, p.z(), 0.004) - 0.003;
      EXPECT_TRUE(in_wall || std::hypot(p.x(), p.y()) > outside) << seed << " face " << f;
    }
  }
}

TEST(Kinds, SurviveTheirNames) {
  for (const Kind kind : kKinds) EXPECT_EQ(from_name<Kind>(to_name(kind)), kind);
  EXPECT_EQ(names<Kind>().size(), kKinds.size());
  EXPECT_THROW(from_name<Kind>("teapot"), ParameterError);
}

TEST(Kinds, NameTheirPartsInOrder) {
  using testing::ElementsAre;
  EXPECT_THAT(make(Kind::mug, 1).label_names, ElementsAre("body", "handle"));
  EXPECT_THAT(make(Kind::watering_can, 1).label_names, ElementsAre("container", "handle", "spout"));
  EXPECT_THAT(make(Kind::chair, 1).label_names, ElementsAre("back", "seat", "leg"));
  EXPECT_THAT(make(Kind::aeroplane, 1).label_names, ElementsAre("body", "wing", "tail"));
  EXPECT_THROW(make(static_cast<Kind>(99), 1), ParameterError);
}

}  // namespace
}  // namespace cosegraph::sample
