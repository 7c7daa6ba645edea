// Numbers of which many are 0, as they travel: only the others, and which ones they are.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace cosegraph::idl {

// `present`: how many numbers there are; then for each 1024 of them a word that tells in which
// groups of 32 there are others than 0, and for each of these groups a word that tells which. The
// first is the lowest bit. `values`: the numbers told of.
void pack(std::span<const float> numbers, std::vector<std::uint32_t>& present,
          std::vector<float>& values);

// For all lists of a message, which zeros that travel for nothing must not make large beyond
// measure.
class Unpacker {
 public:
  // Throws InputError if the two do not fit together, or there are too many zeros.
  std::vector<float> unpack(std::span<const std::uint32_t> present, std::span<const float> values);

 private:
  std::uint64_t zeros_ = 0;  // more than the values account for
};

}  // namespace cosegraph::idl
