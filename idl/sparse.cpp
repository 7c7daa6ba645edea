#include "idl/sparse.hpp"

#include <algorithm>
#include <bit>

#include "core/error.hpp"

namespace cosegraph::idl {
namespace {

constexpr std::size_t kGroup = 32;           // numbers of a word
constexpr std::size_t kBlock = 32 * kGroup;  // numbers of a word of groups
constexpr std::uint64_t kMostZeros = 1U << 25U;
constexpr std::uint64_t kZerosPerValue = 20;

// Calls `use` with the place of each bit that is set, from the lowest on.
template <class Use>
void for_each_bit(std::uint32_t word, Use use) {
  for (; word != 0; word &= word - 1) use(static_cast<std::size_t>(std::countr_zero(word)));
}

[[noreturn]] void fail() {
  throw InputError("numbers do not fit what is told of their zeros");
}

}  // namespace

void pack(std::span<const float> numbers, std::vector<std::uint32_t>& present,
          std::vector<float>& values) {
  const std::size_t count = numbers.size();
  present.push_back(static_cast<std::uint32_t>(count));
  values.resize(count);
  float* to = values.data();
  for (std::size_t block = 0; block < count; block += kBlock) {
    const std::size_t groups = present.size();
    present.push_back(0);
    for (std::size_t begin = block; begin < std::min(block + kBlock, count); begin += kGroup) {
      const auto group = numbers.subspan(begin, std::min(kGroup, count - begin));
      std::uint32_t word = 0;
      for (std::size_t i = 0; i < group.size(); ++i)
        word |= static_cast<std::uint32_t>(std::bit_cast<std::uint32_t>(group[i]) != 0) << i;
      if (word == 0) continue;
      present[groups] |= 1U << ((begin - block) / kGroup);
      present.push_back(word);
      for_each_bit(word, [&](std::size_t i) { *to++ = group[i]; });
    }
  }
  values.resize(static_cast<std::size_t>(to - values.data()));
}

std::vector<float> Unpacker::unpack(std::span<const std::uint32_t> present,
                                    std::span<const float> values) {
  if (present.empty() || values.size() > present[0]) fail();
  const std::uint64_t zeros = present[0] - values.size();
  zeros_ += zeros - std::min(zeros, kZerosPerValue * values.size());
  if (zeros_ > kMostZeros) throw InputError("there are too many zeros");
  std::vector<float> result(present[0]);
  std::size_t at = 1;
  const auto next = [&] {
    if (at == present.size()) fail();
    return present[at++];
  };
  std::size_t from = 0;
  for (std::size_t block = 0; block < result.size(); block += kBlock)
    for_each_bit(next(), [&](std::size_t which) {
      const std::size_t begin = block + which * kGroup;
      const std::uint32_t word = next();
      const auto given = static_cast<std::size_t>(std::popcount(word));
      const std::size_t size = kGroup - static_cast<std::size_t>(std::countl_zero(word));
      if (begin + size > result.size() || given > values.size() - from) fail();
      for_each_bit(word, [&](std::size_t i) { result[begin + i] = values[from++]; });
    });
  if (at != present.size() || from != values.size()) fail();
  return result;
}

}  // namespace cosegraph::idl
