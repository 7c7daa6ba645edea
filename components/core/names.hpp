// Enums as text, by one table per enum.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "core/error.hpp"

namespace cosegraph {

template <class E>
using Names = std::span<const std::pair<E, std::string_view>>;

// Specialised by each enum that has text: `template <> Names<X> names<X>();`, every value once.
template <class E>
Names<E> names();

template <class E>
std::string_view to_name(E value) {
  for (const auto& [key, name] : names<E>())
    if (key == value) return name;
  throw Error("enum value without a name");
}

// Throws ParameterError that lists the possible names.
template <class E>
E from_name(std::string_view text) {
  std::string all;
  for (const auto& [key, name] : names<E>()) {
    if (name == text) return key;
    all += (all.empty() ? "" : ", ") + std::string(name);
  }
  throw ParameterError("'" + std::string(text) + "' is none of: " + all);
}

}  // namespace cosegraph
