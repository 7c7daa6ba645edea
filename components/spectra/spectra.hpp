// Eigenpairs of the Laplace-Beltrami operator on a point cloud, and commute-time distances
// d^2(x, y) = sum_i (phi_i(x) - phi_i(y))^2 / lambda_i (Bronstein, Bronstein, PAMI 2010).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/fields.hpp"
#include "core/values.hpp"

namespace cosegraph::spectra {

enum class Operator {
  weak,  // cotangent weights on tangent-plane Delaunay one-rings, lumped mass, Neumann boundary
  mls,   // moving least squares, strong form: Liang, Lai, Wong, Zhao, CVPR 2012 (the paper's)
};

struct Params {
  Operator op = Operator::weak;  // field name "operator"
  int samples = 500;             // points the operator is built on
  int eigenpairs = 25;           // without the zero mode
  int neighbours = 16;           // of a point's one-ring or least-squares patch
  double bridge = 0.3;           // weight of the edges that connect separate pieces
};

Fields describe(Params& params);

// Throws InputError for fewer points than eigenpairs + 2, or if the eigenproblem does not
// converge. Eigenfunctions are orthonormal under the lumped mass and their sign is fixed (the
// entry of largest magnitude is positive). Lengths are divided by cloud.scale first.
Spectrum compute(const Cloud& cloud, const Params& params);

// The commute-time distance between samples a and b.
double commute_distance(const Spectrum& spectrum, std::int32_t a, std::int32_t b);

// Rows of eigenfunctions scaled by 1/sqrt(eigenvalue), M x E: distances between rows are
// commute-time distances.
std::vector<float> commute_embedding(const Spectrum& spectrum);

}  // namespace cosegraph::spectra

template <>
cosegraph::Names<cosegraph::spectra::Operator> cosegraph::names<cosegraph::spectra::Operator>();
