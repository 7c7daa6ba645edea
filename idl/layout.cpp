#include "idl/layout.hpp"

#include <cstddef>

namespace cosegraph::idl {
namespace {

constexpr std::size_t kEncapsulation = 4;

class Walk {
 public:
  Walk(std::span<const std::uint8_t> body, bool little_endian)
      : body_(body), little_endian_(little_endian) {}

  bool members(std::string_view layout) {
    for (std::size_t i = 0; i < layout.size(); ++i) {
      if (layout[i] != '[') {
        if (!member(layout[i])) return false;
        continue;
      }
      const std::size_t end = layout.find(']', i);
      if (!structs(layout.substr(i + 1, end - i - 1))) return false;
      i = end;
    }
    return true;
  }

 private:
  bool member(char kind) {
    switch (kind) {
      case '1':
        return skip(1, 1, 1);
      case '4':
        return skip(1, 4, 4);
      case '8':
        return skip(1, 8, 8);
      case 's':
      case 'b':
        return sequence(1);
      case 'f':
        return sequence(4);
      case 'S':
        return structs("s");
      default:
        return false;
    }
  }

  bool sequence(std::size_t element) {
    std::uint32_t count = 0;
    return length(count) && skip(count, element, element);
  }

  // Every struct takes at least a byte, so a hostile count ends the loop with the bytes.
  bool structs(std::string_view layout) {
    std::uint32_t count = 0;
    if (!length(count) || count > body_.size() - at_) return false;
    for (std::uint32_t i = 0; i < count; ++i)
      if (!members(layout)) return false;
    return true;
  }

  bool length(std::uint32_t& value) {
    if (!skip(1, 4, 4)) return false;
    const std::uint8_t* p = &body_[at_ - 4];
    value = little_endian_ ? p[0] | p[1] << 8U | p[2] << 16U | std::uint32_t{p[3]} << 24U
                           : p[3] | p[2] << 8U | p[1] << 16U | std::uint32_t{p[0]} << 24U;
    return true;
  }

  // Nothing is skipped, and nothing aligned, for no elements.
  bool skip(std::size_t count, std::size_t size, std::size_t alignment) {
    if (count == 0) return true;
    const std::size_t begin = (at_ + alignment - 1) / alignment * alignment;
    if (begin > body_.size() || count > (body_.size() - begin) / size) return false;
    at_ = begin + count * size;
    return true;
  }

  std::span<const std::uint8_t> body_;
  bool little_endian_;
  std::size_t at_ = 0;
};

}  // namespace

bool fits_layout(std::span<const std::uint8_t> bytes, std::string_view layout) {
  if (bytes.size() < kEncapsulation || bytes[0] != 0 || bytes[1] > 1) return false;
  return Walk(bytes.subspan(kEncapsulation), bytes[1] == 1).members(layout);
}

}  // namespace cosegraph::idl
