// Synthetic samples and mixtures for the tests of fisher.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/random.hpp"
#include "core/values.hpp"

namespace cosegraph::test {

using Values = std::vector<float>;

inline Values normal_values(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  Values result(count);
  for (float& v : result) v = static_cast<float>(random.normal());
  return result;
}

// `count` samples around `centres` random centres, `spread` deviations apart; cycling through them.
inline Values clustered_samples(int count, int dimension, int centres, double spread,
                                std::uint64_t seed) {
  Random random(seed);
  std::vector<double> centre(static_cast<std::size_t>(centres) * dimension);
  for (double& c : centre) c = spread * random.normal();
  Values result;
  for (int i = 0; i < count; ++i)
    for (int d = 0; d < dimension; ++d)
      result.push_back(static_cast<float>(centre[(i % centres) * dimension + d] + random.normal()));
  return result;
}

// A mixture with random weights, means and deviations.
inline GaussianMixture random_mixture(int components, int dimension, std::uint64_t seed) {
  Random random(seed);
  GaussianMixture mixture{.components = components, .dimension = dimension};
  double sum = 0.0;
  for (int k = 0; k < components; ++k) {
    mixture.weight.push_back(static_cast<float>(random.uniform(0.2, 1.0)));
    sum += mixture.weight.back();
  }
  for (float& w : mixture.weight) w = static_cast<float>(w / sum);
  for (int i = 0; i < components * dimension; ++i) {
    mixture.mean.push_back(static_cast<float>(random.normal()));
    mixture.sigma.push_back(static_cast<float>(random.uniform(0.4, 1.5)));
  }
  return mixture;
}

inline double relative_difference(const Values& a, const Values& b) {
  double difference = 0.0;
  double length = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference += (double{a[i]} - b[i]) * (double{a[i]} - b[i]);
    length += double{b[i]} * b[i];
  }
  return std::sqrt(difference / length);
}

}  // namespace cosegraph::test
