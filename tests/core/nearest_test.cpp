#include "core/nearest.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

#include "core/error.hpp"
#include "core/random.hpp"

namespace cosegraph {
namespace {

using Neighbour = NearestNeighbours::Neighbour;
using Points = std::vector<float>;

float squared_distance(const float* a, const float* b) {
  float sum = 0.0F;
  for (int axis = 0; axis < 3; ++axis) sum += (a[axis] - b[axis]) * (a[axis] - b[axis]);
  return sum;
}

// Every point of the set, nearest first, ties by index.
std::vector<Neighbour> all_by_distance(const Points& xyz, const float* query) {
  std::vector<Neighbour> result;
  for (std::size_t i = 0; i < xyz.size() / 3; ++i)
    result.push_back({static_cast<std::int32_t>(i), squared_distance(query, &xyz[3 * i])});
  std::ranges::sort(result, {},
                    [](const Neighbour& n) { return std::tuple(n.squared_distance, n.index); });
  return result;
}

std::vector<std::pair<std::int32_t, float>> plain(const std::vector<Neighbour>& neighbours) {
  std::vector<std::pair<std::int32_t, float>> result;
  for (const auto& n : neighbours) result.emplace_back(n.index, n.squared_distance);
  return result;
}

Points uniform_points(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  Points xyz(3 * count);
  for (float& value : xyz) value = static_cast<float>(random.uniform(-1.0, 1.0));
  return xyz;
}

// Every place of a cubic grid twice, in random order: all distances are tied many times.
Points doubled_grid(int side, float spacing, std::uint64_t seed) {
  std::vector<std::array<float, 3>> place;
  for (int copy = 0; copy < 2; ++copy)
    for (int x = 0; x < side; ++x)
      for (int y = 0; y < side; ++y)
        for (int z = 0; z < side; ++z)
          place.push_back({static_cast<float>(x) * spacing, static_cast<float>(y) * spacing,
                           static_cast<float>(z) * spacing});
  Random(seed).shuffle(std::span(place));
  Points xyz;
  for (const auto& p : place) xyz.insert(xyz.end(), p.begin(), p.end());
  return xyz;
}

// Points whose distances to the origin differ by rounding only.
Points sphere_points(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  Points xyz;
  while (xyz.size() < 3 * count) {
    const double x = random.normal();
    const double y = random.normal();
    const double z = random.normal();
    const double length = std::sqrt(x * x + y * y + z * z);
    for (const double value : {x, y, z}) xyz.push_back(static_cast<float>(value / length));
  }
  return xyz;
}

void expect_same_as_brute_force(const Points& xyz, const Points& queries) {
  const NearestNeighbours tree(xyz);
  for (std::size_t q = 0; q < queries.size(); q += 3) {
    const float* query = &queries[q];
    const auto expected = plain(all_by_distance(xyz, query));
    for (const std::size_t k : {std::size_t{1}, std::size_t{2}, std::size_t{9}, std::size_t{64},
                                expected.size(), expected.size() + 5}) {
      const std::size_t count = std::min(k, expected.size());
      ASSERT_EQ(plain(tree.nearest(query, k)),
                std::vector(expected.begin(), expected.begin() + static_cast<long>(count)))
          << "k = " << k << ", query " << q / 3;
    }
    ASSERT_EQ(tree.nearest_index(query), expected.front().first);
    for (const float radius : {0.0F, 0.1F, 0.2F, 0.3F, 1.0F, 10.0F}) {
      auto inside = expected;
      std::erase_if(inside, [&](const auto& n) { return n.second > radius * radius; });
      ASSERT_EQ(plain(tree.within(query, radius)), inside) << "radius " << radius;
    }
  }
}

TEST(NearestNeighbours, EqualBruteForceOnScatteredPoints) {
  expect_same_as_brute_force(uniform_points(700, 1), uniform_points(60, 2));
}

TEST(NearestNeighbours, BreakTiesByIndexOnAGridWithDuplicates) {
  const Points grid = doubled_grid(7, 0.1F, 3);
  expect_same_as_brute_force(grid, Points(grid.begin(), grid.begin() + 90));
}

TEST(NearestNeighbours, BreakTiesByIndexFromFarAwayFromAGrid) {
  const Points grid = doubled_grid(6, 0.1F, 5);
  expect_same_as_brute_force(grid, {-0.3F, 0.25F, 0.25F, 0.25F, 7.0F, 0.25F, 100.0F, 100.0F, 0.0F,
                                    0.25F, 0.25F, 0.25F, 0.05F, 0.15F, 0.35F, 3.0F, 3.0F, 3.0F});
}

// Grid points are the corners of the tree's cells, where its bounds are tightest.
TEST(NearestNeighbours, AreExactOnGridsOfAnySpacing) {
  Random random(6);
  for (int i = 0; i < 100; ++i) {
    const auto spacing = static_cast<float>(random.uniform(0.01, 1.0));
    const NearestNeighbours tree(doubled_grid(9, spacing, 7));
    const Points grid = doubled_grid(9, spacing, 7);
    for (int q = 0; q < 10; ++q) {
      float query[3];
      for (float& value : query)
        value = (static_cast<float>(random.below(45)) / 5.0F - 1.0F) * 2.0F * spacing;
      const auto expected = plain(all_by_distance(grid, query));
      for (const std::size_t count : {1U, 6U, 12U, 40U, 600U}) {
        ASSERT_EQ(plain(tree.nearest(query, count)),
                  std::vector(expected.begin(), expected.begin() + static_cast<long>(count)));
        const float radius = std::sqrt(expected[count].second);
        auto inside = expected;
        std::erase_if(inside, [&](const auto& n) { return n.second > radius * radius; });
        ASSERT_EQ(plain(tree.within(query, radius)), inside);
      }
    }
  }
}

TEST(NearestNeighbours, AreExactWhereDistancesDifferByRoundingOnly) {
  for (std::uint64_t seed = 0; seed < 20; ++seed)
    expect_same_as_brute_force(sphere_points(400, seed), {0.0F, 0.0F, 0.0F});
}

TEST(NearestNeighbours, KnowCoincidentPointsApartByIndex) {
  const Points same(3 * 100, 0.7F);
  expect_same_as_brute_force(same, {0.7F, 0.7F, 0.7F, 0.0F, 0.0F, 0.0F});
}

TEST(NearestNeighbours, OfNoPointsAreNone) {
  const NearestNeighbours tree{std::span<const float>()};
  const float query[] = {0.0F, 0.0F, 0.0F};
  EXPECT_EQ(tree.size(), 0U);
  EXPECT_TRUE(tree.nearest(query, 3).empty());
  EXPECT_TRUE(tree.within(query, 100.0F).empty());
}

TEST(NearestNeighbours, AreNoneWhenNoneAreAskedFor) {
  const NearestNeighbours tree(uniform_points(10, 4));
  const float query[] = {0.0F, 0.0F, 0.0F};
  EXPECT_TRUE(tree.nearest(query, 0).empty());
  EXPECT_TRUE(tree.within(query, -1.0F).empty());
}

TEST(NearestNeighbours, KeepTheirPointsWhenMovedAndWhenTheInputGoes) {
  NearestNeighbours tree{std::span<const float>()};
  {
    Points xyz = {0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F};
    NearestNeighbours other(xyz);
    xyz.assign(xyz.size(), 50.0F);
    tree = std::move(other);
  }
  const float query[] = {0.9F, 0.0F, 0.0F};
  EXPECT_EQ(tree.size(), 2U);
  EXPECT_EQ(tree.nearest_index(query), 1);
}

TEST(NearestNeighbours, RefuseNumbersWhoseSquaresAreNotFinite) {
  for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity(), 1e19F, -1e30F}) {
    const Points points = {0.0F, 0.0F, 0.0F, 1.0F, bad, 0.0F};
    EXPECT_THROW(NearestNeighbours{points}, InputError) << bad;
    const NearestNeighbours tree(uniform_points(5, 1));
    EXPECT_THROW(tree.nearest(&points[3], 2), InputError) << bad;
    EXPECT_THROW(tree.within(&points[3], 1.0F), InputError) << bad;
  }
}

TEST(NearestNeighbours, AreFoundAsFarOutAsIsAllowed) {
  const float far = NearestNeighbours::kFarthest;
  const NearestNeighbours tree(Points{far, far, far, -far, -far, -far});
  const float query[] = {-far, far, -far};
  EXPECT_EQ(tree.nearest_index(query), 1);
  EXPECT_EQ(tree.nearest(query, 5).size(), 2U);
}

}  // namespace
}  // namespace cosegraph
