#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <set>

#include "core/random.hpp"
#include "cpc/boundary.hpp"
#include "cpc/cpc.hpp"

namespace cosegraph::cpc {
namespace {

using ::testing::ElementsAre;
using Ids = std::vector<std::int32_t>;

// Supervoxels in a row along x that look up, each leaning by `lean`: two neighbours meet in a
// concave edge if the left one leans more to the right.
Supervoxels row(const std::vector<float>& lean) {
  Supervoxels result;
  for (std::size_t i = 0; i < lean.size(); ++i) {
    const auto x = static_cast<float>(i);
    result.centroid.insert(result.centroid.end(), {x, 0.0F, 0.0F});
    result.normal.insert(result.normal.end(), {lean[i], 0.0F, -1.0F});
    if (i > 0)
      result.adjacency.push_back({static_cast<std::int32_t>(i) - 1, static_cast<std::int32_t>(i)});
  }
  return result;
}

Supervoxels random_mesh(int count, std::uint64_t seed) {
  Random random(seed);
  Supervoxels result;
  for (int i = 0; i < 3 * count; ++i) {
    result.centroid.push_back(static_cast<float>(random.normal()));
    result.normal.push_back(static_cast<float>(random.normal()));
  }
  std::set<std::array<std::int32_t, 2>> edges;
  for (int i = 0; i < 3 * count; ++i) {
    const auto a = static_cast<std::int32_t>(random.below(count));
    const auto b = static_cast<std::int32_t>(random.below(count));
    if (a != b) edges.insert({std::min(a, b), std::max(a, b)});
  }
  result.adjacency.assign(edges.begin(), edges.end());
  return result;
}

TEST(ConcaveEdges, AreThoseOfAValleyAndNotOfARidge) {
  const Supervoxels valley = row({0.3F, -0.3F});
  const Supervoxels ridge = row({-0.3F, 0.3F});
  EXPECT_TRUE(is_concave(valley, 0, 1));
  EXPECT_TRUE(is_concave(valley, 1, 0));
  EXPECT_FALSE(is_concave(ridge, 0, 1));
  EXPECT_FALSE(is_concave(row({0.2F, 0.2F}), 0, 1));
}

TEST(Boundaries, AgreeWithABruteForceCount) {
  const Supervoxels supervoxels = random_mesh(60, 3);
  Random random(4);
  Ids segment(60);
  for (auto& id : segment) id = static_cast<std::int32_t>(random.below(7));
  const auto boundaries = boundaries_of(supervoxels, segment);
  for (std::int32_t a = 0; a < 7; ++a)
    for (std::int32_t b = a + 1; b < 7; ++b) {
      int edges = 0;
      int concave = 0;
      for (const auto& [i, j] : supervoxels.adjacency) {
        if (std::minmax({segment[i], segment[j]}) != std::pair(a, b)) continue;
        ++edges;
        double turn = 0.0;
        double length = 0.0;
        for (int axis = 0; axis < 3; ++axis)
          length +=
              std::pow(supervoxels.centroid[3 * i + axis] - supervoxels.centroid[3 * j + axis], 2);
        for (int axis = 0; axis < 3; ++axis) {
          const double d =
              (supervoxels.centroid[3 * i + axis] - supervoxels.centroid[3 * j + axis]) /
              std::sqrt(length);
          turn += supervoxels.normal[3 * i + axis] * d - supervoxels.normal[3 * j + axis] * d;
        }
        concave += turn < 0.0;
      }
      const auto found = std::ranges::find_if(
          boundaries, [&](const Boundary& at) { return at.a == a && at.b == b; });
      ASSERT_EQ(found == boundaries.end(), edges == 0);
      if (edges == 0) continue;
      EXPECT_EQ(found->edges, edges);
      EXPECT_EQ(found->concave, concave);
    }
}

// The paper's Fig. 2a: |B| < |C| < |A|, and the cut between A and B is the more concave one.
class Figure2a : public ::testing::Test {
 protected:
  const Supervoxels supervoxels = row({0, 0, 0, 0, 0.5F, -0.3F, -0.3F, 0, 0, 0});
  Ids segment{0, 0, 0, 0, 0, 1, 1, 2, 2, 2};  // A A A A A B B C C C
};

TEST_F(Figure2a, ConcavityMergesBWithC) {
  merge_by_concavity(supervoxels, 3, segment);
  EXPECT_THAT(segment, ElementsAre(0, 0, 0, 0, 0, 2, 2, 2, 2, 2));
}

TEST_F(Figure2a, SizeMergesBWithA) {
  merge_by_size(supervoxels, 3, segment);
  EXPECT_THAT(segment, ElementsAre(0, 0, 0, 0, 0, 0, 0, 2, 2, 2));
}

TEST(MergeByConcavity, TakesTheSmallerSegmentThenTheSmallerNeighbourOnATie) {
  const Supervoxels supervoxels = row({0, 0, 0, 0, 0});
  Ids segment{0, 0, 1, 2, 2};
  merge_by_concavity(supervoxels, 2, segment);
  EXPECT_THAT(segment, ElementsAre(0, 0, 0, 2, 2));
  Ids two_small{0, 0, 1, 2, 3};  // 1 goes first, to 0; then 2, to 0; then 3
  merge_by_concavity(supervoxels, 2, two_small);
  EXPECT_THAT(two_small, ElementsAre(0, 0, 0, 0, 0));
}

TEST(MergeByConcavity, ScoresTheSegmentsAsTheyAreNow) {
  // Of the edges from 0 those to 1 and 3 are concave, the one to 2 is not: alone 1 scores 1/1
  // toward 0, but {1, 2} scores 1/2, which comes before 3.
  Supervoxels supervoxels;
  supervoxels.centroid = {0, 0, 0, 1, 0, 0, 0, 1, 0, -1, 0, 0};
  supervoxels.normal = {0, 0, -1, -0.3F, -0.1F, -1, -0.1F, 0.3F, -1, 0.3F, 0, -1};
  supervoxels.adjacency = {{0, 1}, {0, 2}, {0, 3}, {1, 2}};
  ASSERT_TRUE(is_concave(supervoxels, 0, 1));
  ASSERT_FALSE(is_concave(supervoxels, 0, 2));
  ASSERT_TRUE(is_concave(supervoxels, 0, 3));
  ASSERT_FALSE(is_concave(supervoxels, 1, 2));
  const auto score_of = [&](const Ids& segment, std::int32_t a, std::int32_t b) {
    for (const Boundary& boundary : boundaries_of(supervoxels, segment))
      if (boundary.a == a && boundary.b == b) return boundary.score();
    return -1.0;
  };
  EXPECT_EQ(score_of({0, 1, 2, 3}, 0, 1), 1.0);
  EXPECT_EQ(score_of({0, 1, 1, 3}, 0, 1), 0.5);
  Ids segment{0, 1, 1, 3};
  merge_by_concavity(supervoxels, 3, segment);  // 0 into {1, 2} at 1/2, then 3 at 1/1
  EXPECT_THAT(segment, ElementsAre(1, 1, 1, 1));
}

TEST(Merging, LeavesNoSmallSegmentThatHasANeighbour) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Supervoxels supervoxels = random_mesh(50, seed);
    Random random(seed);
    Ids before(50);
    for (auto& id : before) id = static_cast<std::int32_t>(random.below(25));
    for (const auto merge : {merge_by_concavity, merge_by_size}) {
      Ids after = before;
      merge(supervoxels, 4, after);
      std::map<std::int32_t, int> size;
      for (const std::int32_t id : after) ++size[id];
      for (const Boundary& boundary : boundaries_of(supervoxels, after)) {
        EXPECT_GE(size[boundary.a], 4);
        EXPECT_GE(size[boundary.b], 4);
      }
      for (std::size_t i = 0; i < before.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
          ASSERT_TRUE(before[i] != before[j] || after[i] == after[j]) << "a segment was split";
    }
  }
}

TEST(Merging, LeavesASmallSegmentWithoutNeighbours) {
  Supervoxels supervoxels = row({0, 0, 0, 0});
  supervoxels.adjacency = {{0, 1}, {1, 2}};
  for (const auto merge : {merge_by_concavity, merge_by_size}) {
    Ids segment{0, 0, 0, 1};
    merge(supervoxels, 3, segment);
    EXPECT_THAT(segment, ElementsAre(0, 0, 0, 1));
  }
}

TEST(Merging, DoesNothingWithoutAMinimum) {
  const Supervoxels supervoxels = row({0, 0, 0, 0});
  for (const auto merge : {merge_by_concavity, merge_by_size}) {
    Ids segment{0, 1, 2, 3};
    merge(supervoxels, 0, segment);
    EXPECT_THAT(segment, ElementsAre(0, 1, 2, 3));
  }
}

TEST(MergeNames, RoundTrip) {
  for (const auto merge : {Merge::concavity, Merge::size})
    EXPECT_EQ(from_name<Merge>(to_name(merge)), merge);
  EXPECT_THROW(from_name<Merge>("largest"), ParameterError);
}

}  // namespace
}  // namespace cosegraph::cpc
