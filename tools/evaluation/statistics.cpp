#include "tools/evaluation/statistics.hpp"

#include <cmath>
#include <limits>
#include <map>
#include <numeric>

namespace cosegraph::evaluation {

Estimate clustered_mean(std::span<const double> values, std::span<const std::int64_t> cluster) {
  const auto n = static_cast<double>(values.size());
  Estimate result{.mean = std::accumulate(values.begin(), values.end(), 0.0) / n,
                  .standard_error = std::numeric_limits<double>::quiet_NaN()};
  std::map<std::int64_t, double> error;
  for (std::size_t i = 0; i < values.size(); ++i) error[cluster[i]] += values[i] - result.mean;
  if (error.size() < 2) return result;
  double sum = 0.0;
  for (const auto& [id, e] : error) sum += e * e;
  const auto c = static_cast<double>(error.size());
  result.standard_error = std::sqrt(c / (c - 1.0) * sum) / n;
  return result;
}

Estimate mean_of(std::span<const Estimate> strata) {
  const auto n = static_cast<double>(strata.size());
  double sum = 0.0;
  double variance = 0.0;
  for (const Estimate& stratum : strata) {
    sum += stratum.mean;
    variance += stratum.standard_error * stratum.standard_error;
  }
  return {.mean = sum / n, .standard_error = std::sqrt(variance) / n};
}

}  // namespace cosegraph::evaluation
