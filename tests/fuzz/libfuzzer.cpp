// libFuzzer's side of a target: every third mutation is one of bytes, the others know the messages.
#include <algorithm>
#include <cstring>

#include "core/error.hpp"
#include "fuzz/target.hpp"

// Of libFuzzer.
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace {

using namespace cosegraph;

std::size_t put(const idl::Bytes& bytes, std::uint8_t* data) {
  std::memcpy(data, bytes.data(), bytes.size());
  return bytes.size();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::run(fuzz::unpack({data, size}));
  return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned seed) {
  Random random(seed);
  if (random.below(3) > 0) {
    fuzz::Bundle bundle = fuzz::unpack({data, size});
    fuzz::mutate(bundle, random);
    const idl::Bytes bytes = fuzz::pack(bundle);
    if (bytes.size() <= max_size && !std::ranges::equal(bytes, std::span(data, size)))
      return put(bytes, data);
  }
  return LLVMFuzzerMutate(data, size, max_size);
}

// Takes a message of one bundle for that of the other: each is valid, but they may not fit.
extern "C" std::size_t LLVMFuzzerCustomCrossOver(const std::uint8_t* data1, std::size_t size1,
                                                 const std::uint8_t* data2, std::size_t size2,
                                                 std::uint8_t* out, std::size_t max_size,
                                                 unsigned seed) {
  Random random(seed);
  fuzz::Bundle bundle = fuzz::unpack({data1, size1});
  const fuzz::Bundle other = fuzz::unpack({data2, size2});
  const std::size_t count = std::min(bundle.messages.size(), other.messages.size());
  if (count > 0) {
    const std::size_t at = random.below(count);
    bundle.messages[at] = other.messages[at];
  }
  if (random.below(4) == 0) bundle.choice = other.choice;
  const idl::Bytes bytes = fuzz::pack(bundle);
  return bytes.size() <= max_size ? put(bytes, out) : 0;
}
