#include "svm/gram.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>

#if defined(__x86_64__)
#define COSEGRAPH_AVX2 __attribute__((target("avx2")))
#endif
#define COSEGRAPH_INLINE __attribute__((always_inline)) inline

namespace cosegraph::svm {
namespace {

// Vectors as wide as the registers; operations are per element, so the width changes no result.
using Narrow [[gnu::vector_size(16)]] = float;
using Wide [[gnu::vector_size(32)]] = float;

constexpr int kLanes = 16;   // vectors side by side in a panel
constexpr int kSlice = 512;  // dimensions of a panel: it stays in the first-level cache

// sum[r][lane] = products of rows 0 .. Rows-1 with the panel's vectors, over `count` dimensions.
template <class V, int Rows>
COSEGRAPH_INLINE void multiply_rows(const float* const* row, const float* panel, int count,
                                    float* sum) {
  constexpr int kWidth = sizeof(V) / sizeof(float);
  constexpr int kVectors = kLanes / kWidth;
  V total[Rows][kVectors] = {};
  for (int d = 0; d < count; ++d) {
    V x[kVectors];
#pragma GCC unroll 4
    for (int j = 0; j < kVectors; ++j)
      std::memcpy(&x[j], panel + d * kLanes + j * kWidth, sizeof(V));
#pragma GCC unroll 4
    for (int r = 0; r < Rows; ++r) {
      const float factor = row[r][d];
#pragma GCC unroll 4
      for (int j = 0; j < kVectors; ++j) total[r][j] += x[j] * factor;
    }
  }
  std::memcpy(sum, total, sizeof total);
}

// Rows that are multiplied at once, so that the sums fill half of the 16 registers.
template <class V>
COSEGRAPH_INLINE void multiply_four(const float* const* row, const float* panel, int count,
                                    float* sum) {
  constexpr int kRows = sizeof(V) / 8;
  for (int r = 0; r < 4; r += kRows)
    multiply_rows<V, kRows>(row + r, panel, count, sum + r * kLanes);
}

using Multiply = void (*)(const float* const*, const float*, int, float*);

void multiply_baseline(const float* const* row, const float* panel, int count, float* sum) {
  multiply_four<Narrow>(row, panel, count, sum);
}

#ifdef COSEGRAPH_AVX2
COSEGRAPH_AVX2 void multiply_avx2(const float* const* row, const float* panel, int count,
                                  float* sum) {
  multiply_four<Wide>(row, panel, count, sum);
}
Multiply choose() {
  return __builtin_cpu_supports("avx2") ? multiply_avx2 : multiply_baseline;
}
#else
Multiply choose() {
  return multiply_baseline;
}
#endif

}  // namespace

std::vector<float> gram_matrix(std::span<const float> vectors, int dimension) {
  static const Multiply multiply = choose();
  const auto count = static_cast<std::ptrdiff_t>(vectors.size()) / dimension;
  std::vector<float> gram(count * count, 0.0F);
  std::vector<float> panel(static_cast<std::size_t>(kSlice) * kLanes);
  float sum[4 * kLanes];
  for (std::ptrdiff_t left = 0; left < count; left += kLanes) {
    const auto lanes = static_cast<int>(std::min<std::ptrdiff_t>(kLanes, count - left));
    for (int begin = 0; begin < dimension; begin += kSlice) {
      const int length = std::min(kSlice, dimension - begin);
      for (int lane = 0; lane < kLanes; ++lane) {
        const float* from = &vectors[(left + std::min(lane, lanes - 1)) * dimension + begin];
        for (int d = 0; d < length; ++d) panel[d * kLanes + lane] = from[d];
      }
      for (std::ptrdiff_t top = left; top < count; top += 4) {
        const float* rows[4];
        for (std::ptrdiff_t r = 0; r < 4; ++r)
          rows[r] = &vectors[std::min(top + r, count - 1) * dimension + begin];
        multiply(rows, panel.data(), length, sum);
        for (std::ptrdiff_t row = top; row < std::min(top + 4, count); ++row)
          for (int lane = 0; lane < lanes; ++lane)
            gram[row * count + left + lane] += sum[(row - top) * kLanes + lane];
      }
    }
  }
  for (std::ptrdiff_t i = 0; i < count; ++i)
    for (std::ptrdiff_t j = i + 1; j < count; ++j) gram[i * count + j] = gram[j * count + i];
  return gram;
}

}  // namespace cosegraph::svm
