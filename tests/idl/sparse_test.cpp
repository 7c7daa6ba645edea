// Numbers without their zeros.
#include "idl/sparse.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "core/error.hpp"
#include "core/random.hpp"

namespace cosegraph::idl {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

using Words = std::vector<std::uint32_t>;
using Values = std::vector<float>;

struct Packed {
  Words present;
  Values values;
};

Packed packed(const Values& numbers) {
  Packed result;
  pack(numbers, result.present, result.values);
  return result;
}

TEST(Sparse, HasABitForEachNumber) {
  const Packed some = packed({0, 0, 0, 1, 2, 0, 3});
  EXPECT_THAT(some.present, ElementsAre(7, 0b1, 0b1011000));
  EXPECT_THAT(some.values, ElementsAre(1, 2, 3));
  EXPECT_THAT(packed({}).present, ElementsAre(0));
}

TEST(Sparse, HasNoBitsForGroupsOfZeros) {
  Values numbers(3000);
  numbers[40] = 1;
  numbers[2999] = 2;
  const Packed some = packed(numbers);
  EXPECT_THAT(some.present, ElementsAre(3000, 0b10, 1U << 8U, 0, 1U << 29U, 1U << 23U));
  EXPECT_THAT(some.values, ElementsAre(1, 2));
  EXPECT_THAT(packed(Values(1025)).present, ElementsAre(1025, 0, 0));
  EXPECT_THAT(packed(Values(1025)).values, IsEmpty());
}

TEST(Sparse, GivesBackAnyNumbers) {
  Random random(1);
  for (int round = 0; round < 300; ++round) {
    Values numbers(random.below(round % 3 == 0 ? 5000 : 70));
    const std::uint64_t rarity = 1 + random.below(100);
    for (auto& number : numbers)
      if (random.below(rarity) == 0) number = random.below(2) == 0 ? -0.0F : 1.5F;
    const Packed some = packed(numbers);
    const auto got = Unpacker().unpack(some.present, some.values);
    ASSERT_EQ(got, numbers);
    for (std::size_t i = 0; i < got.size(); ++i)
      ASSERT_EQ(std::signbit(got[i]), std::signbit(numbers[i]));
  }
}

TEST(Sparse, WhatDoesNotFitItsValuesIsRefused) {
  const auto unpacked = [](const Words& present, const Values& values) {
    return Unpacker().unpack(present, values);
  };
  EXPECT_THAT(unpacked({2, 1, 0b10}, {5}), ElementsAre(0, 5));
  EXPECT_THROW(unpacked({}, {}), InputError);
  EXPECT_THROW(unpacked({2}, {5}), InputError) << "no word of groups";
  EXPECT_THROW(unpacked({2, 1}, {5}), InputError) << "no word of numbers";
  EXPECT_THROW(unpacked({2, 1, 0b11}, {5}), InputError) << "a value too few";
  EXPECT_THROW(unpacked({2, 1, 0b10}, {5, 6}), InputError) << "a value too many";
  EXPECT_THROW(unpacked({1, 1, 0b1}, {5, 6}), InputError) << "more values than numbers";
  EXPECT_THROW(unpacked({2, 1, 0b100}, {5}), InputError) << "a number behind the last";
  EXPECT_THROW(unpacked({2, 0b10, 0b1}, {5}), InputError) << "a group behind the last";
  EXPECT_THROW(unpacked({2, 1, 0b10, 0}, {5}), InputError) << "a word too many";
}

// They take no bytes.
TEST(Sparse, TooManyZerosAreRefused) {
  EXPECT_THROW(Unpacker().unpack(Words{std::numeric_limits<std::uint32_t>::max()}, {}), InputError);
  const Words half = packed(Values(std::size_t{1} << 24U)).present;
  Unpacker unpacker;
  EXPECT_EQ(unpacker.unpack(half, {}).size(), std::size_t{1} << 24U);
  EXPECT_NO_THROW(unpacker.unpack(half, {}));
  EXPECT_THROW(unpacker.unpack(half, {}), InputError) << "all lists of a message count";
}

}  // namespace
}  // namespace cosegraph::idl
