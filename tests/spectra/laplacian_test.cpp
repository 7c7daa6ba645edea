#include "spectra/laplacian.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <numeric>

#include "spectra/surfaces.hpp"

namespace cosegraph::spectra {
namespace {

std::vector<double> points_of(const Cloud& cloud) {
  return {cloud.xyz.begin(), cloud.xyz.end()};
}

// A triangular lattice over [0, 1] x [0, 1].
std::vector<double> lattice(int side) {
  std::vector<double> xyz;
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column) {
      xyz.push_back((column + 0.5 * (row % 2)) / side);
      xyz.push_back(row * std::sqrt(0.75) / side);
      xyz.push_back(0.0);
    }
  return xyz;
}

std::vector<double> applied(const WeakLaplacian& laplacian, const std::vector<double>& f) {
  std::vector<double> result(f.size(), 0.0);
  for (const auto& [a, b, weight] : laplacian.edge) {
    const auto i = static_cast<std::size_t>(a);
    const auto j = static_cast<std::size_t>(b);
    result[i] += weight * (f[i] - f[j]);
    result[j] += weight * (f[j] - f[i]);
  }
  return result;
}

TEST(WeakLaplacian, MassesSumToTheArea) {
  const auto sphere = weak_laplacian(points_of(test::even_sphere(1000)), 16);
  EXPECT_NEAR(std::accumulate(sphere.mass.begin(), sphere.mass.end(), 0.0), 4.0 * std::numbers::pi,
              0.1);
  const auto square = weak_laplacian(points_of(test::even_square(40, 2)), 16);
  EXPECT_NEAR(std::accumulate(square.mass.begin(), square.mass.end(), 0.0), 1.0 - 2.0 / 40,
              0.02);  // the outermost half spacing has no points
}

TEST(WeakLaplacian, OfATriangularLatticeHasTheTextbookWeights) {
  const int side = 9;
  const auto laplacian = weak_laplacian(lattice(side), 14);
  const std::int32_t centre = (side / 2) * side + side / 2;
  int edges = 0;
  for (const auto& [a, b, weight] : laplacian.edge)
    if (a == centre || b == centre) {
      EXPECT_NEAR(weight, 1.0 / std::sqrt(3.0), 1e-9);  // cot 60 deg, from two triangles
      ++edges;
    }
  EXPECT_EQ(edges, 6);
  EXPECT_NEAR(laplacian.mass[static_cast<std::size_t>(centre)], std::sqrt(0.75) / (side * side),
              1e-9);
}

TEST(WeakLaplacian, KillsLinearFunctionsInsideAFlatPatch) {
  const auto xyz = points_of(test::even_square(30, 4));
  const auto laplacian = weak_laplacian(xyz, 20);
  std::vector<double> f;
  for (std::size_t i = 0; i < xyz.size(); i += 3) f.push_back(2.0 * xyz[i] - 3.0 * xyz[i + 1]);
  const auto image = applied(laplacian, f);
  for (std::size_t i = 0; i < f.size(); ++i) {
    const double x = xyz[3 * i];
    const double y = xyz[3 * i + 1];
    if (x > 0.2 && x < 0.8 && y > 0.2 && y < 0.8) {
      EXPECT_NEAR(image[i], 0.0, 1e-6) << i;
    }
  }
}

TEST(WeakLaplacian, IsPositiveSemidefinite) {
  const auto xyz = points_of(test::sphere(300, -0.3, 5));
  const auto laplacian = weak_laplacian(xyz, 12);
  Random random(6);
  for (int run = 0; run < 200; ++run) {
    std::vector<double> f(xyz.size() / 3);
    for (double& value : f) value = random.normal();
    const auto image = applied(laplacian, f);
    EXPECT_GE(std::inner_product(f.begin(), f.end(), image.begin(), 0.0), 0.0);
  }
}

TEST(WeakLaplacian, LeavesAWideGapOpen) {
  const auto left = test::even_square(30, 7);
  const auto right = test::moved(test::even_square(30, 8), 1.3, 0.0, 0.0);
  const auto xyz = points_of(test::together(left, right));
  const auto laplacian = weak_laplacian(xyz, 16);
  for (const auto& [a, b, weight] : laplacian.edge) EXPECT_EQ(a < 900, b < 900);
}

TEST(WeakLaplacian, BridgesJoinAllPieces) {
  auto cloud = test::even_sphere(200);
  for (int piece = 1; piece < 4; ++piece)
    cloud = test::together(cloud, test::moved(test::even_sphere(200), 3.0 * piece, 0.0, 0.0));
  const auto xyz = points_of(cloud);
  auto laplacian = weak_laplacian(xyz, 16);
  EXPECT_EQ(laplacian.component.front(), 0);
  EXPECT_EQ(laplacian.component.back(), 3);
  const std::size_t before = laplacian.edge.size();
  add_bridges(xyz, 0.5, laplacian);
  ASSERT_EQ(laplacian.edge.size(), before + 3);
  for (const auto& [a, b, weight] : laplacian.edge)
    if (a / 200 != b / 200) {
      EXPECT_DOUBLE_EQ(weight, 0.5);
      EXPECT_EQ(b / 200 - a / 200, 1);  // neighbours in the row of spheres
    }
}

TEST(WeakLaplacian, PointsWithoutTrianglesArePiecesWithAMass) {
  std::vector<double> line;
  for (int i = 0; i < 20; ++i) line.insert(line.end(), {0.1 * i, 0.0, 0.0});
  const auto laplacian = weak_laplacian(line, 8);
  EXPECT_TRUE(laplacian.edge.empty());
  EXPECT_EQ(laplacian.component.back(), 19);
  EXPECT_THAT(laplacian.mass, testing::Each(testing::Gt(0.0)));
}

TEST(WeakLaplacian, OfNothingIsEmpty) {
  auto laplacian = weak_laplacian({}, 8);
  add_bridges({}, 1.0, laplacian);
  EXPECT_TRUE(laplacian.edge.empty());
  EXPECT_TRUE(laplacian.mass.empty());
}

TEST(MlsLaplacian, KillsConstantsAndDifferentiatesOnASphere) {
  const auto xyz = points_of(test::even_sphere(2000));
  const auto laplacian = mls_laplacian(xyz, 16);
  std::vector<double> of_constant(xyz.size() / 3, 0.0);
  std::vector<double> of_height(xyz.size() / 3, 0.0);
  for (const auto& [row, column, value] : laplacian.entry) {
    of_constant[static_cast<std::size_t>(row)] += value;
    of_height[static_cast<std::size_t>(row)] +=
        value * xyz[3 * static_cast<std::size_t>(column) + 2];
  }
  double error = 0.0;
  for (std::size_t i = 0; i < of_height.size(); ++i) {
    EXPECT_NEAR(of_constant[i], 0.0, 1e-6);
    error += std::abs(of_height[i] - 2.0 * xyz[3 * i + 2]);  // z is an eigenfunction of 2
  }
  EXPECT_LT(error / static_cast<double>(of_height.size()), 0.03);
}

}  // namespace
}  // namespace cosegraph::spectra
