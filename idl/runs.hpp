// Numbers of which many are 0, as they travel: without the runs of zeros among them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace cosegraph::idl {

// Of `runs` two at a time: so many numbers are 0, so many are the next of `values`.
void pack(std::span<const float> numbers, std::vector<std::int32_t>& runs,
          std::vector<float>& values);

// For all lists of a message, which zeros that travel for nothing must not make large beyond
// measure.
class Unpacker {
 public:
  // Throws InputError if runs and values do not fit together, or there are too many zeros.
  std::vector<float> unpack(std::span<const std::int32_t> runs, std::span<const float> values);

 private:
  std::uint64_t zeros_ = 0;  // more than the values account for
};

}  // namespace cosegraph::idl
