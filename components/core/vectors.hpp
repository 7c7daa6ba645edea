// Vectors as wide as the registers of an instruction set, for kernels.
//
// A kernel is a template over its vector, compiled for the baseline and, inlined into a function
// that may use it, for AVX2. Operations per element, products that are not contracted and sums
// whose order does not depend on the width give the same bits on every machine.
#pragma once

#include <cstring>

#if defined(__x86_64__)
#define COSEGRAPH_AVX2 __attribute__((target("avx2")))
#endif
#define COSEGRAPH_INLINE __attribute__((always_inline)) inline

// Functions that return vectors are inlined, always: called by a function that may use AVX2, one
// that may not would return them elsewhere.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace cosegraph {

using Narrow [[gnu::vector_size(16)]] = float;
using Wide [[gnu::vector_size(32)]] = float;

template <class V>
constexpr int kWidth = sizeof(V) / sizeof(float);

template <class V>
COSEGRAPH_INLINE V load(const float* from) {
  V v;
  std::memcpy(&v, from, sizeof v);
  return v;
}

template <class V, class Number>
COSEGRAPH_INLINE void store(Number* to, const V& v) {
  std::memcpy(to, &v, sizeof v);
}

}  // namespace cosegraph
