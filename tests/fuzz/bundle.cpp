#include <algorithm>

#include "fuzz/target.hpp"

namespace cosegraph::fuzz {
namespace {

constexpr std::size_t kLengthSize = 4;

}  // namespace

Bundle unpack(std::span<const std::uint8_t> bytes) {
  Bundle bundle;
  if (bytes.empty()) return bundle;
  bundle.choice = bytes[0];
  bytes = bytes.subspan(1);
  while (bytes.size() >= kLengthSize) {
    const std::size_t wanted =
        bytes[0] | bytes[1] << 8U | bytes[2] << 16U | std::size_t{bytes[3]} << 24U;
    bytes = bytes.subspan(kLengthSize);
    const std::size_t length = std::min(wanted, bytes.size());
    bundle.messages.emplace_back(bytes.begin(),
                                 bytes.begin() + static_cast<std::ptrdiff_t>(length));
    bytes = bytes.subspan(length);
  }
  return bundle;
}

idl::Bytes pack(const Bundle& bundle) {
  idl::Bytes bytes{bundle.choice};
  for (const auto& message : bundle.messages) {
    for (std::size_t i = 0; i < kLengthSize; ++i)
      bytes.push_back(static_cast<std::uint8_t>(message.size() >> (8 * i)));
    bytes.insert(bytes.end(), message.begin(), message.end());
  }
  return bytes;
}

}  // namespace cosegraph::fuzz
