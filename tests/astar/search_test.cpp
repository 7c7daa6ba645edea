#include "astar/search.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.hpp"
#include "core/random.hpp"
#include "core/values.hpp"

namespace cosegraph::astar {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::int64_t kPlenty = 1'000'000;

Energy empty_energy(int nodes, int states) {
  Energy energy{.nodes = nodes, .states = states};
  energy.unary.assign(static_cast<std::size_t>(nodes * states), 0.0);
  energy.pairwise.assign(static_cast<std::size_t>(nodes * (nodes + 1) / 2 * states * states), 0.0);
  return energy;
}

// Sets every pairwise term to what `term(i, j, xi, xj)` returns, i > j.
void set_pairs(Energy& energy, auto term) {
  for (int i = 0; i < energy.nodes; ++i)
    for (int j = 0; j < i; ++j)
      for (int xi = 0; xi < energy.states; ++xi)
        for (int xj = 0; xj < energy.states; ++xj) energy.pair(i, j, xi, xj) = term(i, j, xi, xj);
}

Energy random_energy(Random& random, int nodes, int states, double pairwise) {
  Energy energy = empty_energy(nodes, states);
  for (double& value : energy.unary) value = random.normal();
  set_pairs(energy, [&](int, int, int, int) { return pairwise * random.normal(); });
  return energy;
}

// Calls `visit` with every labelling.
void for_all_states(const Energy& energy, auto visit) {
  std::vector<std::int32_t> state(static_cast<std::size_t>(energy.nodes), 0);
  while (true) {
    visit(state);
    std::size_t node = 0;
    while (node < state.size() && ++state[node] == energy.states) state[node++] = 0;
    if (node == state.size()) return;
  }
}

double brute_force_minimum(const Energy& energy) {
  double lowest = kInfinity;
  for_all_states(energy,
                 [&](const auto& state) { lowest = std::min(lowest, energy.value(state)); });
  return lowest;
}

TEST(Energy, CountsEveryTermOnce) {
  Energy energy = empty_energy(3, 2);
  energy.unary = {1, 2, 4, 8, 16, 32};
  energy.pair(0, 1, 1, 0) = 100;
  energy.pair(2, 1, 1, 0) = 1000;
  energy.pair(0, 2, 0, 1) = 10000;
  EXPECT_DOUBLE_EQ(energy.pair(1, 0, 0, 1), 100.0);
  EXPECT_DOUBLE_EQ(energy.value({1, 0, 1}), 2.0 + 4.0 + 32.0 + 100.0 + 1000.0);
  EXPECT_DOUBLE_EQ(energy.value({0, 1, 1}), 1.0 + 8.0 + 32.0 + 10000.0);
}

TEST(Search, FindsTheBruteForceMinimum) {
  Random random(1);
  for (int run = 0; run < 400; ++run) {
    const int nodes = 1 + static_cast<int>(random.below(8));
    const int states = 1 + static_cast<int>(random.below(nodes > 6 ? 3 : 4));
    const auto energy = random_energy(random, nodes, states, std::pow(10.0, random.uniform(-2, 2)));
    const auto solution = minimise(energy, kPlenty);
    ASSERT_TRUE(solution.proven_optimal);
    EXPECT_DOUBLE_EQ(solution.gap, 0.0);
    EXPECT_NEAR(solution.energy, brute_force_minimum(energy), 1e-5);
    EXPECT_DOUBLE_EQ(solution.energy, energy.value(solution.state));
  }
}

TEST(Search, FindsTheMinimumUnderLargePenalties) {
  Random random(2);
  for (int run = 0; run < 100; ++run) {
    auto energy = random_energy(random, 6, 4, 0.5);
    for (double& value : energy.pairwise)
      if (random.uniform() < 0.4) value += 1e4;
    const auto solution = minimise(energy, kPlenty);
    EXPECT_TRUE(solution.proven_optimal);
    EXPECT_NEAR(solution.energy, brute_force_minimum(energy), 1e-5);
  }
}

TEST(Search, NeverTakesAForbiddenStateWhereThereIsAnother) {
  Random random(3);
  for (int run = 0; run < 100; ++run) {
    auto energy = random_energy(random, 5, 3, 1.0);
    for (double& value : energy.pairwise)
      if (random.uniform() < 0.3) value = kInfinity;
    energy.unary[random.below(energy.unary.size())] = kInfinity;
    const double expected = brute_force_minimum(energy);
    const auto solution = minimise(energy, kPlenty);
    if (std::isinf(expected))
      EXPECT_EQ(solution.energy, expected);
    else
      EXPECT_NEAR(solution.energy, expected, 1e-5);
  }
}

TEST(Search, GapBoundsTheDistanceToTheMinimumWhenTheHeapIsFull) {
  Random random(4);
  int unproven = 0;
  for (int run = 0; run < 150; ++run) {
    const auto energy = random_energy(random, 6, 4, 2.0);
    const double minimum = brute_force_minimum(energy);
    for (const std::int64_t max_open : {1, 3, 10, 40}) {
      const auto solution = minimise(energy, max_open);
      EXPECT_GE(solution.gap, 0.0);
      EXPECT_EQ(solution.proven_optimal, solution.gap == 0.0);
      EXPECT_GE(solution.energy, minimum - 1e-9);
      // The lowest f on the heap is a lower bound: the heuristic is admissible at any depth.
      EXPECT_LE(solution.energy - solution.gap, minimum + 1e-9);
      unproven += solution.proven_optimal ? 0 : 1;
    }
  }
  EXPECT_GT(unproven, 100);  // otherwise nothing was tested
}

TEST(Search, IsExactOnAPlantedLabellingOfManyNodes) {
  Random random(5);
  for (int run = 0; run < 5; ++run) {
    Energy energy = empty_energy(25, 8);
    std::vector<std::int32_t> planted(25);
    for (auto& state : planted) state = static_cast<std::int32_t>(random.below(8));
    for (double& value : energy.unary) value = random.uniform();
    set_pairs(energy, [&](int i, int j, int xi, int xj) {
      const bool right =
          xi == planted[static_cast<std::size_t>(i)] && xj == planted[static_cast<std::size_t>(j)];
      return right ? 0.0 : 1.0 + random.uniform();
    });
    const auto solution = minimise(energy, kPlenty);
    EXPECT_TRUE(solution.proven_optimal);
    EXPECT_EQ(solution.state, planted);
  }
}

TEST(Search, AddingAConstantChangesTheEnergyOnly) {
  Random random(6);
  auto energy = random_energy(random, 7, 3, 1.0);
  const auto before = minimise(energy, kPlenty);
  for (std::size_t x = 0; x < 3; ++x) energy.unary[6 + x] += 5.0;
  const auto after = minimise(energy, kPlenty);
  EXPECT_EQ(after.state, before.state);
  EXPECT_NEAR(after.energy, before.energy + 5.0, 1e-9);
}

TEST(Search, WithoutPairsTakesEachNodesBestState) {
  const Energy energy{.nodes = 3, .states = 2, .unary = {1.0, 0.5, 0.0, 2.0, 3.0, 3.0}};
  const auto solution = minimise(energy, 1);
  EXPECT_THAT(solution.state, testing::ElementsAre(1, 0, 0));
  EXPECT_DOUBLE_EQ(solution.energy, 3.5);
  EXPECT_TRUE(solution.proven_optimal);
}

TEST(Search, OfNoNodesIsEmptyAndOptimal) {
  const auto solution = minimise({}, kPlenty);
  EXPECT_TRUE(solution.state.empty());
  EXPECT_TRUE(solution.proven_optimal);
  EXPECT_DOUBLE_EQ(solution.energy, 0.0);
}

TEST(Search, RefusesBrokenEnergies) {
  Energy energy = empty_energy(3, 2);
  energy.unary.pop_back();
  EXPECT_THROW(minimise(energy, kPlenty), InputError);
  energy = empty_energy(3, 2);
  energy.pairwise.pop_back();
  EXPECT_THROW(minimise(energy, kPlenty), InputError);
  energy = empty_energy(3, 2);
  energy.unary[1] = std::nan("");
  EXPECT_THROW(minimise(energy, kPlenty), InputError);
  energy = empty_energy(3, 2);
  energy.pairwise[1] = -kInfinity;
  EXPECT_THROW(minimise(energy, kPlenty), InputError);
  EXPECT_THROW(minimise({.nodes = 2}, kPlenty), InputError);
}

}  // namespace
}  // namespace cosegraph::astar
