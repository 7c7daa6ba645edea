#include "core/random.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

namespace cosegraph {
namespace {

using ::testing::ElementsAre;

// The expected numbers come from an independent implementation of the published algorithms, in
// unbounded integers (Python): splitmix64 gives four words of state, xoshiro256** runs on them.
TEST(Random, GivesThePublishedSequence) {
  const auto first_four = [](std::uint64_t seed) {
    Random random(seed);
    return std::array{random.next(), random.next(), random.next(), random.next()};
  };
  EXPECT_THAT(first_four(0), ElementsAre(0x99ec5f36cb75f2b4ULL, 0xbf6e1f784956452aULL,
                                         0x1a5f849d4933e6e0ULL, 0x6aa594f1262d2d2cULL));
  EXPECT_THAT(first_four(42), ElementsAre(0x15780b2e0c2ec716ULL, 0x6104d9866d113a7eULL,
                                          0xae17533239e499a1ULL, 0xecb8ad4703b360a1ULL));
  EXPECT_THAT(first_four(~0ULL), ElementsAre(0x8f5520d52a7ead08ULL, 0xc476a018caa1802dULL,
                                             0x81de31c0d260469eULL, 0xbf658d7e065f3c2fULL));
}

TEST(Random, StaysOnThePublishedSequenceForAThousandNumbers) {
  Random random(7);
  std::uint64_t mixed = 0;
  for (int i = 0; i < 1000; ++i) mixed ^= random.next();
  EXPECT_EQ(mixed, 0x03cf020024f905d6ULL);
}

TEST(Random, UniformNumbersStayInTheirRangeAndFillIt) {
  Random random(1);
  double least = 1.0;
  double most = 0.0;
  double sum = 0.0;
  constexpr int kCount = 100000;
  for (int i = 0; i < kCount; ++i) {
    const double value = random.uniform();
    least = std::min(least, value);
    most = std::max(most, value);
    sum += value;
  }
  EXPECT_GE(least, 0.0);
  EXPECT_LT(least, 1e-3);
  EXPECT_LT(most, 1.0);
  EXPECT_GT(most, 1.0 - 1e-3);
  EXPECT_NEAR(sum / kCount, 0.5, 5.0 / std::sqrt(12.0 * kCount));
  for (int i = 0; i < 1000; ++i) {
    const double value = random.uniform(-3.0, -2.0);
    EXPECT_GE(value, -3.0);
    EXPECT_LT(value, -2.0);
  }
}

TEST(Random, BelowIsUnbiased) {
  constexpr std::size_t kSides = 7;
  constexpr int kCount = 70000;
  std::vector<int> seen(kSides, 0);
  Random random(2);
  for (int i = 0; i < kCount; ++i) ++seen.at(random.below(kSides));
  double chi_squared = 0.0;
  for (const int count : seen) chi_squared += std::pow(count - 10000.0, 2.0) / 10000.0;
  EXPECT_LT(chi_squared, 27.9);  // 1 in 10000 for 6 degrees of freedom
}

// With 3 * 2^62 sides a plain remainder gives the lowest quarter twice as often as it should.
TEST(Random, BelowIsUnbiasedForHugeCounts) {
  constexpr std::size_t kSides = 3ULL << 62;
  constexpr int kCount = 30000;
  int low = 0;
  Random random(3);
  for (int i = 0; i < kCount; ++i) {
    const std::size_t draw = random.below(kSides);
    ASSERT_LT(draw, kSides);
    low += draw < kSides / 3 ? 1 : 0;
  }
  EXPECT_NEAR(low, kCount / 3, 5.0 * std::sqrt(kCount * 2.0 / 9.0));
}

TEST(Random, BelowOneIsZero) {
  Random random(4);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(random.below(1), 0U);
}

TEST(Random, NormalNumbersHaveTheMomentsOfTheStandardNormal) {
  Random random(5);
  constexpr int kCount = 200000;
  double moment[5] = {};
  for (int i = 0; i < kCount; ++i) {
    const double value = random.normal();
    ASSERT_TRUE(std::isfinite(value));
    for (int power = 1; power <= 4; ++power) moment[power] += std::pow(value, power) / kCount;
  }
  const double deviation = 1.0 / std::sqrt(kCount);  // of the mean; 15 and 96: of x^3, of x^4
  EXPECT_NEAR(moment[1], 0.0, 5.0 * deviation);
  EXPECT_NEAR(moment[2], 1.0, 5.0 * std::sqrt(2.0) * deviation);
  EXPECT_NEAR(moment[3], 0.0, 5.0 * std::sqrt(15.0) * deviation);
  EXPECT_NEAR(moment[4], 3.0, 5.0 * std::sqrt(96.0) * deviation);
}

TEST(Random, ShuffleMakesEveryOrderEquallyOften) {
  std::map<std::vector<int>, int> seen;
  Random random(6);
  constexpr int kCount = 24000;
  for (int i = 0; i < kCount; ++i) {
    std::vector<int> values = {1, 2, 3, 4};
    random.shuffle(std::span(values));
    ++seen[values];
  }
  EXPECT_EQ(seen.size(), 24U);
  for (const auto& [order, count] : seen) EXPECT_NEAR(count, 1000, 5.0 * std::sqrt(1000.0));
}

TEST(Random, ShuffleLeavesNothingAndOneAsTheyAre) {
  Random random(8);
  std::vector<int> values;
  random.shuffle(std::span(values));
  EXPECT_TRUE(values.empty());
  values = {3};
  random.shuffle(std::span(values));
  EXPECT_THAT(values, ElementsAre(3));
}

TEST(Random, SampleNeverRepeatsAnIndex) {
  Random random(9);
  for (std::size_t size = 0; size < 40; ++size) {
    for (std::size_t count = 0; count < 45; count += 3) {
      const auto sample = random.sample(size, count);
      ASSERT_EQ(sample.size(), std::min(size, count));
      const std::set<std::int32_t> different(sample.begin(), sample.end());
      ASSERT_EQ(different.size(), sample.size());
      for (const std::int32_t index : sample) ASSERT_LT(static_cast<std::size_t>(index), size);
    }
  }
}

TEST(Random, SampleTakesEveryIndexEquallyOftenAtEveryPlace) {
  Random random(10);
  constexpr int kCount = 20000;
  int seen[2][5] = {};
  for (int i = 0; i < kCount; ++i) {
    const auto sample = random.sample(5, 2);
    ++seen[0][sample[0]];
    ++seen[1][sample[1]];
  }
  for (const auto& place : seen)
    for (const int count : place) EXPECT_NEAR(count, 4000, 5.0 * std::sqrt(4000.0 * 0.8));
}

TEST(DeriveSeed, GivesEveryItemItsOwnSeed) {
  std::set<std::uint64_t> seeds;
  for (std::uint64_t seed = 0; seed < 10; ++seed)
    for (std::uint64_t a = 0; a < 30; ++a)
      for (std::uint64_t b = 0; b < 30; ++b) seeds.insert(derive_seed(seed, a, b));
  EXPECT_EQ(seeds.size(), 10U * 30U * 30U);
}

TEST(DeriveSeed, IsTheSameForTheSameItem) {
  EXPECT_EQ(derive_seed(1, 2, 3), derive_seed(1, 2, 3));
  EXPECT_EQ(derive_seed(1, 2), derive_seed(1, 2, 0));
}

}  // namespace
}  // namespace cosegraph
