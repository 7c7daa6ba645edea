// Numbers without their runs of zeros.
#include "idl/runs.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "core/error.hpp"
#include "core/random.hpp"

namespace cosegraph::idl {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

struct Packed {
  std::vector<std::int32_t> runs;
  std::vector<float> values;
};

Packed packed(const std::vector<float>& numbers) {
  Packed result;
  pack(numbers, result.runs, result.values);
  return result;
}

TEST(Runs, AreOfZerosAndNumbersInTurn) {
  const Packed some = packed({0, 0, 0, 0, 1, 2, 0, 0, 0, 0, 0, 3, 0});
  EXPECT_THAT(some.runs, ElementsAre(4, 2, 5, 1, 1, 0));
  EXPECT_THAT(some.values, ElementsAre(1, 2, 3));
  EXPECT_THAT(packed({}).runs, IsEmpty());
}

TEST(Runs, FewZerosTravelAsTheyAre) {
  const Packed some = packed({1, 0, 0, 0, 2});
  EXPECT_THAT(some.runs, ElementsAre(0, 5));
  EXPECT_THAT(some.values, ElementsAre(1, 0, 0, 0, 2));
}

TEST(Runs, GiveBackAnyNumbers) {
  Random random(1);
  for (int round = 0; round < 200; ++round) {
    std::vector<float> numbers(random.below(60));
    for (auto& number : numbers)
      if (random.below(3) == 0) number = random.below(2) == 0 ? -0.0F : 1.5F;
    const Packed some = packed(numbers);
    const auto got = Unpacker().unpack(some.runs, some.values);
    ASSERT_EQ(got, numbers);
    for (std::size_t i = 0; i < got.size(); ++i)
      ASSERT_EQ(std::signbit(got[i]), std::signbit(numbers[i]));
  }
}

TEST(Runs, ThatDoNotFitTheirValuesAreRefused) {
  using Values = std::vector<float>;
  using Numbers = std::vector<std::int32_t>;
  EXPECT_THROW(Unpacker().unpack(Numbers{1}, Values{}), InputError);
  EXPECT_THROW(Unpacker().unpack(Numbers{0, 2}, Values{1}), InputError);
  EXPECT_THROW(Unpacker().unpack(Numbers{0, 1}, Values{1, 2}), InputError);
  EXPECT_THROW(Unpacker().unpack(Numbers{-1, 1, 1, 0}, Values{1}), InputError);
  EXPECT_THROW(Unpacker().unpack(Numbers{0, 2, 0, -1}, Values{1}), InputError);
}

// They take no bytes.
TEST(Runs, OfTooManyZerosAreRefused) {
  const std::vector<std::int32_t> most{std::numeric_limits<std::int32_t>::max(), 0};
  EXPECT_THROW(Unpacker().unpack(most, {}), InputError);
  const std::vector<std::int32_t> half{1 << 24, 0};
  Unpacker unpacker;
  EXPECT_EQ(unpacker.unpack(half, {}).size(), std::size_t{1} << 24U);
  EXPECT_NO_THROW(unpacker.unpack(half, {}));
  EXPECT_THROW(unpacker.unpack(half, {}), InputError) << "all lists of a message count";
}

}  // namespace
}  // namespace cosegraph::idl
