#include "core/random.hpp"

#include <bit>
#include <cmath>
#include <numbers>
#include <numeric>

namespace cosegraph {
namespace {

std::uint64_t splitmix64(std::uint64_t& state) {
  state += 0x9e3779b97f4a7c15ULL;
  std::uint64_t z = state;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

}  // namespace

Random::Random(std::uint64_t seed) {
  for (auto& word : state_) word = splitmix64(seed);
}

std::uint64_t Random::next() {
  const std::uint64_t result = std::rotl(state_[1] * 5, 7) * 9;
  const std::uint64_t t = state_[1] << 17;
  state_[2] ^= state_[0];
  state_[3] ^= state_[1];
  state_[1] ^= state_[2];
  state_[0] ^= state_[3];
  state_[2] ^= t;
  state_[3] = std::rotl(state_[3], 45);
  return result;
}

double Random::uniform() {
  return static_cast<double>(next() >> 11) * 0x1.0p-53;
}

std::size_t Random::below(std::size_t count) {
  const std::uint64_t n = count;
  const std::uint64_t reject_below = (0 - n) % n;  // 2^64 mod n
  std::uint64_t draw = next();
  while (draw < reject_below) draw = next();
  return static_cast<std::size_t>(draw % n);
}

double Random::normal() {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
  return radius * std::cos(2.0 * std::numbers::pi * uniform());
}

std::vector<std::int32_t> Random::sample(std::size_t size, std::size_t count) {
  std::vector<std::int32_t> indices(size);
  std::iota(indices.begin(), indices.end(), 0);
  count = std::min(size, count);
  for (std::size_t i = 0; i < count; ++i) std::swap(indices[i], indices[i + below(size - i)]);
  indices.resize(count);
  return indices;
}

std::uint64_t derive_seed(std::uint64_t seed, std::uint64_t a, std::uint64_t b) {
  std::uint64_t state = seed;
  state = splitmix64(state) ^ a;
  state = splitmix64(state) ^ b;
  return splitmix64(state);
}

}  // namespace cosegraph
