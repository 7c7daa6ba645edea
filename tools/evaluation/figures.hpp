// How good one labelling is.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/values.hpp"

namespace cosegraph::evaluation {

// By the measures of components/metrics, over the input's points that have a true label and were
// not removed. All but `accuracy` are errors. All are fractions.
struct Figures {
  double accuracy = 0.0;
  double missing = 0.0;      // Hamming distance, Rm
  double false_alarm = 0.0;  // Hamming distance, Rf
  double rand = 0.0;         // 1 - Rand index
  double gce = 0.0;
  double lce = 0.0;

  double hamming() const { return 0.5 * (missing + false_alarm); }
};

// Position of each of `some` in `names`. Throws InputError for one that is not there.
std::vector<std::int32_t> positions(const std::vector<std::string>& some,
                                    const std::vector<std::string>& names);

// True and given labels of the points that count, as indices into `names`.
struct Comparison {
  std::vector<std::int32_t> truth;
  std::vector<std::int32_t> given;
};

// Throws InputError if no point counts, or for a label that `names` lacks.
Comparison compare(const Cloud& input, const Labelling& labelling,
                   const std::vector<std::string>& names);

Figures figures_of(const Comparison& comparison);

// Adds the comparison's share of points per (true label, given label) to the names x names matrix
// `fraction`: 1 in all.
void add_to(std::vector<double>& fraction, const Comparison& comparison, std::size_t names);

}  // namespace cosegraph::evaluation
