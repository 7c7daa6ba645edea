// How well a segmentation agrees with a reference: the measures of the Princeton benchmark (Chen,
// Golovinskiy, Funkhouser, "A Benchmark for 3D Mesh Segmentation", SIGGRAPH 2009) and accuracy.
//
// All take one label per element (face or point) of the evaluated segmentation S and of the
// reference R; sizes that differ are refused with InputError. Elements whose reference is kNoLabel
// are left out; an evaluated kNoLabel is a segment like any other (and never accurate). Without
// elements every result is 0. Only accuracy compares the labels themselves; the others compare the
// partitions. Results do not depend on the order of the elements, rounding excepted.
#pragma once

#include <cstdint>
#include <span>

namespace cosegraph::metrics {

using Labels = std::span<const std::int32_t>;
// Per element, as a face's area; empty: all elements count the same.
using Weights = std::span<const double>;

// Fraction of the weight whose label is the reference's.
double accuracy(Labels evaluated, Labels reference, Weights weight = {});

// Rm = 1 - sum_j max_i |S_i n R_j| / A and Rf = 1 - sum_i max_j |S_i n R_j| / A.
struct Hamming {
  double missing = 0.0;      // Rm
  double false_alarm = 0.0;  // Rf
  double mean() const { return 0.5 * (missing + false_alarm); }
};
Hamming hamming_distance(Labels evaluated, Labels reference, Weights weight = {});

// 1 - RI: fraction of the pairs of elements that one side joins and the other separates.
double rand_error(Labels evaluated, Labels reference);

// With E12(x) = 1 - |S(x) n R(x)| / |S(x)| and E21 likewise: GCE is the smaller of their means, LCE
// the mean of the smaller. Both are 0 if either side has a single segment: the Princeton program
// has a special case for that, which the definitions make superfluous.
struct ConsistencyError {
  double global = 0.0;
  double local = 0.0;
};
ConsistencyError consistency_error(Labels evaluated, Labels reference);

}  // namespace cosegraph::metrics
