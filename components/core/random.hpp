// Seeded random numbers, the same on every platform: xoshiro256** (Blackman, Vigna 2018) seeded by
// splitmix64. The distributions of the standard library are not used, as their results differ
// between implementations.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace cosegraph {

class Random {
 public:
  explicit Random(std::uint64_t seed);

  std::uint64_t next();
  // Uniform in [0, 1).
  double uniform();
  // Uniform in [low, high).
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  // Uniform in 0 .. count-1 without bias; count > 0.
  std::size_t below(std::size_t count);
  // Standard normal deviate (Box-Muller).
  double normal();

  // Fisher-Yates.
  template <class T>
  void shuffle(std::span<T> values) {
    for (std::size_t i = values.size(); i > 1; --i) std::swap(values[i - 1], values[below(i)]);
  }

  // `count` different indices out of 0 .. size-1, in random order; all of them when count >= size.
  std::vector<std::int32_t> sample(std::size_t size, std::size_t count);

 private:
  std::array<std::uint64_t, 4> state_;
};

// A seed for item `a` (and `b`) of a run with `seed`: makes results independent of the order, and
// the thread, in which items are worked on.
std::uint64_t derive_seed(std::uint64_t seed, std::uint64_t a, std::uint64_t b = 0);

}  // namespace cosegraph
