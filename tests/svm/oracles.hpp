// Margins of a two-class machine by libsvm and liblinear, each in its own unit since their headers
// define the same names.
#pragma once

#include <cstdint>
#include <vector>

namespace cosegraph::test {

struct Problem {
  int dimension = 0;
  std::vector<float> vectors;
  std::vector<std::int32_t> label;
  int label_count = 0;

  std::size_t size() const { return label.size(); }
};

struct OracleParams {
  double gamma = 0.0;  // 0: linear
  double positive_cost = 1.0;
  double negative_cost = 1.0;
};

// Margins of all vectors of `problem`, by a machine for `label` against the others.
std::vector<double> libsvm_margins(const Problem& problem, std::int32_t label,
                                   const OracleParams& params);
// Without bias.
std::vector<double> liblinear_margins(const Problem& problem, std::int32_t label,
                                      const OracleParams& params);

}  // namespace cosegraph::test
