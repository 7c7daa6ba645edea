#include "idl/runs.hpp"

#include <algorithm>
#include <bit>

#include "core/error.hpp"

namespace cosegraph::idl {
namespace {

constexpr std::uint64_t kMostZeros = 1U << 25U;
constexpr std::uint64_t kZerosPerValue = 20;

}  // namespace

void pack(std::span<const float> numbers, std::vector<std::int32_t>& runs,
          std::vector<float>& values) {
  constexpr std::size_t kLeast = 4;  // zeros that are worth a run
  const auto is_zero = [&](std::size_t i) { return std::bit_cast<std::uint32_t>(numbers[i]) == 0; };
  const std::size_t count = numbers.size();
  values.resize(count);
  float* to = values.data();
  for (std::size_t at = 0; at < count;) {
    std::size_t begin = at;
    while (begin < count && is_zero(begin)) ++begin;
    std::size_t end = begin;
    for (std::size_t i = begin; i < count && i - end < kLeast; ++i)
      if (!is_zero(i)) end = i + 1;
    runs.push_back(static_cast<std::int32_t>(begin - at));
    runs.push_back(static_cast<std::int32_t>(end - begin));
    // Most runs are short: a loop is quicker than a call.
    for (at = begin; at < end; ++at) *to++ = numbers[at];
  }
  values.resize(static_cast<std::size_t>(to - values.data()));
}

std::vector<float> Unpacker::unpack(std::span<const std::int32_t> runs,
                                    std::span<const float> values) {
  std::uint64_t zeros = 0;
  std::uint64_t given = 0;
  bool fits = runs.size() % 2 == 0;
  for (std::size_t r = 0; fits && r < runs.size(); r += 2) {
    fits = runs[r] >= 0 && runs[r + 1] >= 0;
    zeros += static_cast<std::uint64_t>(runs[r]);
    given += static_cast<std::uint64_t>(runs[r + 1]);
  }
  if (!fits || given != values.size()) throw InputError("runs do not fit their values");
  zeros_ += zeros - std::min(zeros, kZerosPerValue * given);
  if (zeros_ > kMostZeros) throw InputError("there are too many zeros");
  std::vector<float> result(zeros + given);
  float* to = result.data();
  const float* from = values.data();
  for (std::size_t r = 0; r < runs.size(); r += 2) {
    to += runs[r];
    for (std::int32_t left = runs[r + 1]; left > 0; --left) *to++ = *from++;
  }
  return result;
}

}  // namespace cosegraph::idl
