#include "tools/evaluation/surface.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "evaluation/world.hpp"

namespace cosegraph::evaluation {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Mesh tetrahedron() {
  return {.vertex = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1},
          .face = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2}};
}

TEST(Flaws, AClosedSurfaceHasNone) {
  EXPECT_EQ(flaws_of(tetrahedron()), "");
  EXPECT_EQ(flaws_of(test::lollipop(0.5)), "");  // of patches, with faces without area at the poles
}

TEST(Flaws, AMissingFaceIsAHole) {
  Mesh mesh = tetrahedron();
  mesh.face.resize(9);
  EXPECT_EQ(flaws_of(mesh), "3 edges have a face on one side only (holes)");
}

TEST(Flaws, AFinOnAnEdgeIsNoManifold) {
  Mesh mesh = tetrahedron();
  mesh.vertex.insert(mesh.vertex.end(), {-1, -1, 0});
  mesh.face.insert(mesh.face.end(), {0, 1, 4});
  EXPECT_THAT(flaws_of(mesh), HasSubstr("1 edges have more than two faces"));
}

TEST(Flaws, SurfacesThatTouchInAPointAreNoManifold) {
  Mesh mesh = tetrahedron();
  mesh.vertex.insert(mesh.vertex.end(), {-1, 0, 0, 0, -1, 0, 0, 0, -1});
  for (const std::int32_t v : {0, 5, 4, 0, 4, 6, 4, 5, 6, 0, 6, 5}) mesh.face.push_back(v);
  EXPECT_EQ(flaws_of(mesh), "1 vertices join surfaces in one point (not a manifold)");
}

TEST(Flaws, AVertexWithoutAFaceIsNamed) {
  Mesh mesh = tetrahedron();
  mesh.vertex.insert(mesh.vertex.end(), {5, 5, 5});
  EXPECT_EQ(flaws_of(mesh), "1 vertices belong to no face");
}

}  // namespace
}  // namespace cosegraph::evaluation
