#include "fisher/kernels.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numbers>

#include "core/vectors.hpp"

namespace cosegraph::fisher {
namespace {

// Operations are per element, and sums over dimensions and components are taken in order, so the
// width of the vectors does not change any result.
constexpr int kBlock = 4;              // components are padded to a multiple of it
constexpr float kFarthest = 1e30F;     // bound of a squared distance, so that nothing overflows
constexpr float kNegligible = -23.0F;  // log of the posteriors that count as 0

// v = e^v for -87 < v <= 0, relative error below 2e-7: v = n ln 2 + r, Taylor polynomial in r.
template <class V>
COSEGRAPH_INLINE void exponential(V& v) {
  using Integers [[gnu::vector_size(sizeof(V))]] = std::int32_t;
  constexpr float kRound = 0x1.8p23F;  // adding and subtracting it rounds to an integer
  const V n = (v * std::numbers::log2e_v<float> + kRound) - kRound;
  const V r = (v - n * 0.693359375F) - n * -2.12194440e-4F;  // ln 2 in two parts
  V sum = r * (1.0F / 5040.0F) + 1.0F / 720.0F;
  sum = sum * r + 1.0F / 120.0F;
  sum = sum * r + 1.0F / 24.0F;
  sum = sum * r + 1.0F / 6.0F;
  sum = sum * r + 0.5F;
  sum = sum * r + 1.0F;
  sum = sum * r + 1.0F;
  const Integers power = (__builtin_convertvector(n, Integers) + 127) << 23;
  V scale;
  std::memcpy(&scale, &power, sizeof scale);
  v = sum * scale;
}

// `Count` components: each loaded sample value is used for all of them.
template <class V, int Count>
COSEGRAPH_INLINE void log_joint_block(int dimension, const float* panel, const float* mean,
                                      const float* inverse, const float* offset, float* joint) {
  constexpr int kVectors = kLanes / kWidth<V>;
  V sum[Count][kVectors] = {};
  for (int d = 0; d < dimension; ++d) {
    V x[kVectors];
#pragma GCC unroll 4
    for (int j = 0; j < kVectors; ++j) x[j] = load<V>(panel + d * kLanes + j * kWidth<V>);
#pragma GCC unroll 4
    for (int k = 0; k < Count; ++k) {
      const float m = mean[k * dimension + d];
      const float s = inverse[k * dimension + d];
#pragma GCC unroll 4
      for (int j = 0; j < kVectors; ++j) {
        const V u = (x[j] - m) * s;
        sum[k][j] += u * u;
      }
    }
  }
#pragma GCC unroll 4
  for (int k = 0; k < Count; ++k) {
#pragma GCC unroll 4
    for (int j = 0; j < kVectors; ++j) {
      const V bounded = sum[k][j] < kFarthest ? sum[k][j] : V{} + kFarthest;
      const V value = offset[k] - 0.5F * bounded;
      store(joint + k * kLanes + j * kWidth<V>, value);
    }
  }
}

template <class V>
COSEGRAPH_INLINE void log_joint_all(int padded, int dimension, const float* panel,
                                    const float* mean, const float* inverse, const float* offset,
                                    float* joint) {
  constexpr int kCount = sizeof(V) / 8;  // the sums fill half of the 16 registers
  static_assert(kBlock % kCount == 0);
  for (int k = 0; k < padded; k += kCount)
    log_joint_block<V, kCount>(dimension, panel, mean + k * dimension, inverse + k * dimension,
                               offset + k, joint + k * kLanes);
}

// joint -> posteriors; p(x) = total e^largest.
template <class V>
COSEGRAPH_INLINE void normalise_all(int padded, float* joint, float* total, float* largest) {
  for (int j = 0; j < kLanes; j += kWidth<V>) {
    V most;
    V value;
    most = load<V>(joint + j);
    for (int k = 1; k < padded; ++k) {
      value = load<V>(joint + k * kLanes + j);
      most = value > most ? value : most;
    }
    V sum = {};
    for (int k = 0; k < padded; ++k) {
      value = load<V>(joint + k * kLanes + j);
      value -= most;
      const auto kept = value > kNegligible;
      value = kept ? value : V{} + kNegligible;
      exponential(value);
      value = kept ? value : V{};
      sum += value;
      store(joint + k * kLanes + j, value);
    }
    const V scale = 1.0F / sum;
    for (int k = 0; k < padded; ++k) {
      value = load<V>(joint + k * kLanes + j);
      value *= scale;
      store(joint + k * kLanes + j, value);
    }
    store(total + j, sum);
    store(largest + j, most);
  }
}

template <class V>
COSEGRAPH_INLINE void distances_all(int dimension, const float* panel, const float* centre,
                                    const float* inverse, float* distance) {
  for (int j = 0; j < kLanes; j += kWidth<V>) {
    V sum = {};
    for (int d = 0; d < dimension; ++d) {
      V x;
      x = load<V>(panel + d * kLanes + j);
      const V u = (x - centre[d]) * inverse[d];
      sum += u * u;
    }
    const V bounded = sum < kFarthest ? sum : V{} + kFarthest;
    store(distance + j, bounded);
  }
}

// Columns begin .. begin + kColumns, held in registers over all rows.
template <class V>
COSEGRAPH_INLINE void accumulate_block(int dimension, const float* samples,
                                       const std::int32_t* rows, std::size_t count,
                                       const float* weight, const float* mean, const float* inverse,
                                       float* first, float* second) {
  V m[2];
  V s[2];
  V a[2] = {};
  V b[2] = {};
#pragma GCC unroll 2
  for (int j = 0; j < 2; ++j) {
    m[j] = load<V>(mean + j * kWidth<V>);
    s[j] = load<V>(inverse + j * kWidth<V>);
  }
  for (std::size_t i = 0; i < count; ++i) {
    const float* sample = samples + static_cast<std::ptrdiff_t>(rows[i]) * dimension;
    const float g = weight[i];
#pragma GCC unroll 2
    for (int j = 0; j < 2; ++j) {
      V x;
      x = load<V>(sample + j * kWidth<V>);
      const V u = (x - m[j]) * s[j];
      const V gu = u * g;
      a[j] += gu;
      b[j] += gu * u;
    }
  }
#pragma GCC unroll 2
  for (int j = 0; j < 2; ++j) {
    V sum;
    sum = load<V>(first + j * kWidth<V>);
    sum += a[j];
    store(first + j * kWidth<V>, sum);
    sum = load<V>(second + j * kWidth<V>);
    sum += b[j];
    store(second + j * kWidth<V>, sum);
  }
}

template <class V>
COSEGRAPH_INLINE void accumulate_all(int dimension, const float* samples, const std::int32_t* rows,
                                     std::size_t count, const float* weight, const float* mean,
                                     const float* inverse, float* first, float* second) {
  constexpr int kColumns = 2 * kWidth<V>;
  int d = 0;
  for (; d + kColumns <= dimension; d += kColumns)
    accumulate_block<V>(dimension, samples + d, rows, count, weight, mean + d, inverse + d,
                        first + d, second + d);
  for (; d < dimension; ++d) {
    float a = 0.0F;
    float b = 0.0F;
    for (std::size_t i = 0; i < count; ++i) {
      const float u =
          (samples[static_cast<std::ptrdiff_t>(rows[i]) * dimension + d] - mean[d]) * inverse[d];
      const float gu = u * weight[i];
      a += gu;
      b += gu * u;
    }
    first[d] += a;
    second[d] += b;
  }
}

struct Kernels {
  decltype(&log_joint_all<Narrow>) log_joint;
  decltype(&normalise_all<Narrow>) normalise;
  decltype(&distances_all<Narrow>) distances;
  decltype(&accumulate_all<Narrow>) accumulate;
};

constexpr Kernels kBaseline{[](auto... a) { log_joint_all<Narrow>(a...); },
                            [](auto... a) { normalise_all<Narrow>(a...); },
                            [](auto... a) { distances_all<Narrow>(a...); },
                            [](auto... a) { accumulate_all<Narrow>(a...); }};

#ifdef COSEGRAPH_AVX2
// The same loops, inlined into functions that may use AVX2.
constexpr Kernels kAvx2{[](auto... a) COSEGRAPH_AVX2 { log_joint_all<Wide>(a...); },
                        [](auto... a) COSEGRAPH_AVX2 { normalise_all<Wide>(a...); },
                        [](auto... a) COSEGRAPH_AVX2 { distances_all<Wide>(a...); },
                        [](auto... a) COSEGRAPH_AVX2 { accumulate_all<Wide>(a...); }};

const Kernels& kernels() {
  static const Kernels& chosen = __builtin_cpu_supports("avx2") ? kAvx2 : kBaseline;
  return chosen;
}
#else
const Kernels& kernels() {
  return kBaseline;
}
#endif

}  // namespace

Panels pack(std::span<const float> samples, int dimension) {
  Panels result;
  result.count = samples.size() / dimension;
  result.dimension = dimension;
  result.value.resize(result.panel_count() * dimension * kLanes);
  float* out = result.value.data();
  for (std::size_t panel = 0; panel < result.panel_count(); ++panel, out += dimension * kLanes)
    for (int lane = 0; lane < kLanes; ++lane) {
      const std::size_t sample = std::min(panel * kLanes + lane, result.count - 1);
      for (int d = 0; d < dimension; ++d) out[d * kLanes + lane] = samples[sample * dimension + d];
    }
  return result;
}

Evaluator::Evaluator(std::span<const float> weight, std::span<const float> mean_rows,
                     std::span<const float> sigma)
    : components(static_cast<int>(weight.size())),
      padded((components + kBlock - 1) / kBlock * kBlock),
      dimension(static_cast<int>(mean_rows.size() / weight.size())),
      mean(mean_rows.begin(), mean_rows.end()),
      inverse(static_cast<std::size_t>(padded) * dimension, 0.0F),
      offset(padded, -std::numeric_limits<float>::max()) {
  mean.resize(inverse.size(), 0.0F);
  const double constant = 0.5 * dimension * std::log(2.0 * std::numbers::pi);
  for (int k = 0; k < components; ++k) {
    double log_sigma = 0.0;
    for (int d = 0; d < dimension; ++d) {
      const double s = sigma[static_cast<std::size_t>(k) * dimension + d];
      inverse[static_cast<std::size_t>(k) * dimension + d] = static_cast<float>(1.0 / s);
      log_sigma += std::log(s);
    }
    offset[k] = static_cast<float>(std::log(static_cast<double>(weight[k])) - log_sigma - constant);
  }
}

Evaluator::Evaluator(const GaussianMixture& mixture)
    : Evaluator(mixture.weight, mixture.mean, mixture.sigma) {}

void log_joint(const Evaluator& evaluator, const float* panel, float* joint) {
  kernels().log_joint(evaluator.padded, evaluator.dimension, panel, evaluator.mean.data(),
                      evaluator.inverse.data(), evaluator.offset.data(), joint);
}

void normalise(int padded, float* joint, float* evidence) {
  float total[kLanes];
  kernels().normalise(padded, joint, total, evidence);
  for (int lane = 0; lane < kLanes; ++lane) evidence[lane] += std::log(total[lane]);
}

void squared_distances(int dimension, const float* panel, const float* centre, const float* inverse,
                       float* distance) {
  kernels().distances(dimension, panel, centre, inverse, distance);
}

void accumulate(int dimension, const float* samples, std::span<const std::int32_t> rows,
                const float* weight, const float* mean, const float* inverse, float* first,
                float* second) {
  kernels().accumulate(dimension, samples, rows.data(), rows.size(), weight, mean, inverse, first,
                       second);
}

}  // namespace cosegraph::fisher
