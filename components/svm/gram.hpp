// Inner products of all pairs of vectors: most of the time it takes to train a machine.
#pragma once

#include <span>
#include <vector>

namespace cosegraph::svm {

// N x N, symmetric, of N vectors of `dimension`. Compiled for the baseline instruction set and for
// AVX2, chosen at run time; both sum in the same order, to the same bits. One thread.
std::vector<float> gram_matrix(std::span<const float> vectors, int dimension);

}  // namespace cosegraph::svm
