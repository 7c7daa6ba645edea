// Messages, taken apart (see inspect.hpp), for people and programs.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "idl/inspect.hpp"

namespace cosegraph::idl {

struct Presentation {
  bool whole = false;       // every value, however many
  std::size_t longest = 9;  // of a list that is shown whole anyway
};

// What a long list of numbers holds; NaNs do not count for the range.
struct Summary {
  std::size_t rows = 0;
  std::size_t columns = 1;
  std::size_t nans = 0;
  std::vector<double> least;  // per column up to four, else one for all; empty if all are NaN
  std::vector<double> greatest;
};

Summary summary_of(const Node& list);

// YAML-like, a line per member and its members indented; one line per row of a matrix if whole.
// Control characters of hostile texts do not reach the terminal.
std::string to_text(const Node& node, const Presentation& presentation);

// Structures as objects, lists as arrays; a list that is too long as {"count", "rows", "columns",
// "nan", "min", "max"}, or if of texts or structures as {"count", "first"}. NaN is null.
nlohmann::ordered_json to_json(const Node& node, const Presentation& presentation);

}  // namespace cosegraph::idl
