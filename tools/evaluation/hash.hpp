// FNV-1a: the same on every platform, unlike std::hash. Internal to evaluation.
#pragma once

#include <cstdint>
#include <string_view>

namespace cosegraph::evaluation {

constexpr std::uint64_t kHashStart = 0xcbf29ce484222325ULL;

constexpr std::uint64_t hash(std::string_view text, std::uint64_t value = kHashStart) {
  for (const char c : text) value = (value ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return value;
}

}  // namespace cosegraph::evaluation
