// Gaussian mixtures with diagonal covariance, eq. (2), and principal components.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/values.hpp"

namespace cosegraph::fisher {

struct MixtureParams {
  int components = 32;
  int iterations = 15;
  double variance_floor = 0.05;  // of the samples' variance per dimension
  std::uint64_t seed = 1;
};

// Expectation maximisation from a seeded k-means++ start. `samples` is N x dimension, row-major.
// Fewer samples than components: as many components as samples. Components that starve are
// re-seeded at the worst explained sample. Throws InputError if N is 0 or a value is not finite.
GaussianMixture fit_mixture(std::span<const float> samples, int dimension,
                            const MixtureParams& params);

// log p(m) of every sample.
std::vector<float> log_likelihood(const GaussianMixture& mixture, std::span<const float> samples);

// Soft assignments gamma_t(k), eq. (6): N x K, computed in the log domain.
std::vector<float> posteriors(const GaussianMixture& mixture, std::span<const float> samples);

// log(w_k N(m_t | mu_k, Sigma_k)): N x K.
std::vector<float> log_components(const GaussianMixture& mixture, std::span<const float> samples);

// The `output` leading principal components of the samples. output >= dimension: a rotation only.
Projection fit_projection(std::span<const float> samples, int dimension, int output);

// N x output. With projection.output == 0 a copy.
std::vector<float> project(const Projection& projection, std::span<const float> samples);

}  // namespace cosegraph::fisher
