// Means with their standard errors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace cosegraph::evaluation {

struct Estimate {
  double mean = 0.0;
  double standard_error = 0.0;  // NaN if it cannot be estimated
};

// Mean of `values` (not empty). Values of one cluster (same id) may depend on each other in any
// way, clusters are independent: with e = value - mean,
//   SE^2 = C / (C - 1) * sum over clusters (sum of e)^2 / N^2
// for N values in C clusters (Liang, Zeger 1986). NaN for a single cluster.
Estimate clustered_mean(std::span<const double> values, std::span<const std::int64_t> cluster);

// Unweighted mean of independent estimates (not empty); the strata themselves are taken as fixed.
// NaN if one of them has no standard error.
Estimate mean_of(std::span<const Estimate> strata);

}  // namespace cosegraph::evaluation
