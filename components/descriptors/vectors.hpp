// What the kernels of this component compute with, per element of a vector.
#pragma once

#include <cstdint>
#include <cstring>

#include "core/vectors.hpp"

namespace cosegraph::descriptors {

constexpr int kWidest = kWidth<Wide>;  // columns of numbers are padded to a multiple of it

template <class T>
struct Vector {
  T x;
  T y;
  T z;
};

// The sum is in the order of PCL's, so that what is equal there is equal here.
template <class T>
COSEGRAPH_INLINE T dot(const Vector<T>& a, const Vector<T>& b) {
  return (a.x * b.x + a.z * b.z) + a.y * b.y;
}

template <class T>
COSEGRAPH_INLINE Vector<T> cross(const Vector<T>& a, const Vector<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

constexpr int padded(int count) {
  return (count + kWidest - 1) / kWidest * kWidest;
}

using Doubles [[gnu::vector_size(32)]] = double;

// Integers of the vector's width, as comparisons give them: -1 for true.
template <class V>
using Integers = decltype(V{} < V{});

template <class V>
COSEGRAPH_INLINE Integers<V> bits_of(const V& v) {
  Integers<V> bits;
  std::memcpy(&bits, &v, sizeof v);
  return bits;
}

template <class V>
COSEGRAPH_INLINE V of_bits(const Integers<V>& bits) {
  V v;
  std::memcpy(&v, &bits, sizeof v);
  return v;
}

template <class V>
COSEGRAPH_INLINE V magnitude(const V& v) {
  return of_bits<V>(bits_of(v) & 0x7fffffff);
}

// v within [low, high]; low where v is NaN.
template <class V>
COSEGRAPH_INLINE V bounded(const V& v, float low, float high) {
  const V raised = v > low ? v : V{} + low;
  return raised < high ? raised : V{} + high;
}

// 1 / sqrt(v), relative error below 3e-7; large but finite for 0. A guess by halving the exponent,
// three steps of Newton's method.
template <class V>
COSEGRAPH_INLINE V inverse_root(const V& v) {
  V y = of_bits<V>(0x5f375a86 - (bits_of(v) >> 1));
  const V half = v * 0.5F;
  y = y * (1.5F - (half * y) * y);
  y = y * (1.5F - (half * y) * y);
  return y * (1.5F - (half * y) * y);
}

// Relative error below 2e-7; 0 for 0.
template <class V>
COSEGRAPH_INLINE V square_root(const V& v) {
  const V inverse = inverse_root(v);
  const V guess = v * inverse;
  return guess + (v - guess * guess) * (0.5F * inverse);
}

}  // namespace cosegraph::descriptors
