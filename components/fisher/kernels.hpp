// The inner loops of mixtures and Fisher vectors, on plain float arrays.
//
// Each kernel is compiled twice, for the baseline instruction set and for AVX2, and chosen at run
// time. Sums run in the same order in both and products are not contracted, so that the results
// are the same bits on every machine. One thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/values.hpp"

namespace cosegraph::fisher {

// Samples side by side: one panel holds kLanes of them, value[d][lane].
constexpr int kLanes = 16;

struct Panels {
  std::size_t count = 0;  // samples; the last panel is filled up with copies of the last sample
  int dimension = 0;
  std::vector<float> value;  // panel_count() x dimension x kLanes

  std::size_t panel_count() const { return (count + kLanes - 1) / kLanes; }
  const float* panel(std::size_t index) const {
    return value.data() + index * static_cast<std::size_t>(dimension) * kLanes;
  }
};

Panels pack(std::span<const float> samples, int dimension);

// A mixture ready for evaluation: log(w_k N(x | mu_k, Sigma_k)) is
// offset_k - 1/2 sum_d ((x_d - mean_kd) inverse_kd)^2.
struct Evaluator {
  int components = 0;
  int padded = 0;  // components rounded up to whole blocks; those added never win
  int dimension = 0;
  std::vector<float> mean;     // padded x dimension
  std::vector<float> inverse;  // padded x dimension, 1 / sigma
  std::vector<float> offset;   // padded

  Evaluator(std::span<const float> weight, std::span<const float> mean,
            std::span<const float> sigma);
  explicit Evaluator(const GaussianMixture& mixture);
};

// The values above of one panel: joint[padded][kLanes].
void log_joint(const Evaluator& evaluator, const float* panel, float* joint);

// joint -> posteriors (6), in place; evidence[kLanes] = log p(x). Posteriors under 1e-10 become 0:
// single precision cannot tell their sum from 1, and most terms of the sums below vanish.
void normalise(int padded, float* joint, float* evidence);

// Squared distances of one panel to `centre`, in units of 1 / inverse.
void squared_distances(int dimension, const float* panel, const float* centre, const float* inverse,
                       float* distance);

// The sums that EM and Fisher vectors are made of, over the samples in `rows`, in their order:
// first_d += g u_d and second_d += g u_d^2, with u = (sample - mean) inverse and g the sample's
// entry of `weight`. `samples` is row-major; all but `rows` and `weight` have `dimension` columns.
void accumulate(int dimension, const float* samples, std::span<const std::int32_t> rows,
                const float* weight, const float* mean, const float* inverse, float* first,
                float* second);

}  // namespace cosegraph::fisher
