#include "descriptors/place.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/nearest.hpp"
#include "descriptors/surfaces.hpp"

namespace cosegraph::descriptors {
namespace {

std::vector<float> rod(int count, double begin, double end) {
  std::vector<float> xyz;
  for (int i = 0; i < count; ++i)
    xyz.insert(xyz.end(),
               {static_cast<float>(begin + (end - begin) * i / (count - 1)), 0.0F, 0.0F});
  return xyz;
}

double path(const std::vector<float>& places, std::size_t i) {
  return places[2 * i];
}
double centroid_distance(const std::vector<float>& places, std::size_t i) {
  return places[2 * i + 1];
}

// On a rod of length 1 the mean distance of x to all others is (x^2 + (1-x)^2) / 2.
TEST(Place, OnARodIsTheMeanDistanceAlongIt) {
  const auto places = place(rod(401, 0.0, 1.0), 1.0);
  for (const std::size_t i : {0, 100, 200, 300, 400}) {
    const double x = static_cast<double>(i) / 400.0;
    EXPECT_NEAR(path(places, i), (x * x + (1.0 - x) * (1.0 - x)) / 2.0, 0.03) << x;
    EXPECT_NEAR(centroid_distance(places, i), std::abs(x - 0.5), 1e-4) << x;
  }
}

// With fewer points than sources the mean runs over all pairs: Floyd and Warshall's algorithm.
TEST(Place, AgreesWithABruteForceOverAllPairs) {
  Random random(3);
  std::vector<float> xyz;
  for (int i = 0; i < 3 * 28; ++i) xyz.push_back(static_cast<float>(random.uniform()));
  const std::size_t count = xyz.size() / 3;
  const NearestNeighbours tree(xyz);
  std::vector<std::vector<double>> length(count, std::vector<double>(count, 1e9));
  for (std::size_t i = 0; i < count; ++i)
    for (const auto& near : tree.nearest(&xyz[3 * i], 9)) {
      const double edge = std::sqrt(static_cast<double>(near.squared_distance));
      length[i][near.index] = edge;
      length[near.index][i] = edge;
    }
  for (std::size_t k = 0; k < count; ++k)
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j < count; ++j)
        length[i][j] = std::min(length[i][j], length[i][k] + length[k][j]);
  const auto places = place(xyz, 2.0);
  for (std::size_t i = 0; i < count; ++i) {
    const double mean =
        std::accumulate(length[i].begin(), length[i].end(), 0.0) / static_cast<double>(count);
    EXPECT_NEAR(path(places, i), mean / 2.0, 1e-5);
  }
}

TEST(Place, BridgesPiecesByTheirShortestGap) {
  // A rod with a gap of 0.3 is as long as one without.
  auto xyz = rod(100, 0.0, 0.35);
  const auto right = rod(100, 0.65, 1.0);
  xyz.insert(xyz.end(), right.begin(), right.end());
  const auto places = place(xyz, 1.0);
  EXPECT_TRUE(std::ranges::all_of(places, [](float value) { return std::isfinite(value); }));
  // Mean of |x - y| at x = 0 over y uniform on both pieces.
  EXPECT_NEAR(path(places, 0), 0.5, 0.05);
}

TEST(Place, BridgesManySmallPieces) {
  Random random(5);
  std::vector<float> xyz;
  for (int piece = 0; piece < 40; ++piece) {
    const auto x = static_cast<float>(piece);
    for (int i = 0; i < 12; ++i)
      xyz.insert(xyz.end(), {x + static_cast<float>(random.uniform(0.0, 0.1)),
                             static_cast<float>(random.uniform(0.0, 0.1)), 0.0F});
  }
  const auto places = place(xyz, 1.0);
  EXPECT_NEAR(path(places, 0), 19.5, 1.5);
  EXPECT_NEAR(path(places, 20 * 12), 10.0, 1.0);
}

TEST(Place, DoesNotDependOnThePose) {
  const Cloud egg = test::bumpy_egg(1200);
  const auto still = place(egg.xyz, 1.0);
  const auto turned = place(test::moved(egg, 4).xyz, 1.0);
  for (std::size_t i = 0; i < egg.size(); ++i) {
    ASSERT_NEAR(path(turned, i), path(still, i), 0.02);
    ASSERT_NEAR(centroid_distance(turned, i), centroid_distance(still, i), 1e-4);
  }
}

TEST(Place, IsInScales) {
  const auto metres = place(rod(100, 0.0, 1.0), 1.0);
  const auto scaled = place(rod(100, 0.0, 1.0), 0.5);
  for (std::size_t i = 0; i < metres.size(); ++i) ASSERT_FLOAT_EQ(scaled[i], 2.0F * metres[i]);
}

TEST(Place, OfFewPointsIsDefined) {
  EXPECT_TRUE(place({}, 1.0).empty());
  EXPECT_THAT(place(std::vector<float>{1, 2, 3}, 1.0), testing::ElementsAre(0.0F, 0.0F));
  const std::vector<float> same(60, 2.5F);
  EXPECT_THAT(place(same, 1.0), testing::Each(testing::FloatNear(0.0F, 1e-6F)));
}

}  // namespace
}  // namespace cosegraph::descriptors
