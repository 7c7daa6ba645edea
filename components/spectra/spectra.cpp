#include "spectra/spectra.hpp"

#include <Spectra/GenEigsRealShiftSolver.h>
#include <Spectra/MatOp/SparseGenRealShiftSolve.h>
#include <Spectra/SymEigsShiftSolver.h>
#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/random.hpp"
#include "spectra/laplacian.hpp"

namespace cosegraph::spectra {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using SparseMatrix = Eigen::SparseMatrix<double>;

constexpr std::uint64_t kStartSeed = 1;  // of the solver's start vector
constexpr double kTolerance = 1e-9;      // relative, of an eigenvalue
constexpr int kMaxRestarts = 300;

// Coordinates in multiples of the cloud's scale.
std::vector<double> scaled_points(const Cloud& cloud) {
  if (!(cloud.scale > 0.0F) || !std::isfinite(cloud.scale))
    throw InputError("the cloud's scale is " + std::to_string(cloud.scale));
  std::vector<double> xyz(cloud.xyz.size());
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    if (!std::isfinite(cloud.xyz[i]))
      throw InputError("point " + std::to_string(i / 3) + " is not finite");
    xyz[i] = double{cloud.xyz[i]} / cloud.scale;
  }
  return xyz;
}

double squared_distance(const double* a, const double* b) {
  const double x = a[0] - b[0];
  const double y = a[1] - b[1];
  const double z = a[2] - b[2];
  return x * x + y * y + z * z;
}

// The point farthest from the centroid; the first of equals.
std::size_t outermost(std::span<const double> xyz) {
  const std::size_t count = xyz.size() / 3;
  double centroid[3] = {0.0, 0.0, 0.0};
  for (std::size_t i = 0; i < xyz.size(); ++i)
    centroid[i % 3] += xyz[i] / static_cast<double>(count);
  std::size_t best = 0;
  double farthest = -1.0;
  for (std::size_t i = 0; i < count; ++i)
    if (const double d = squared_distance(&xyz[3 * i], centroid); d > farthest) {
      farthest = d;
      best = i;
    }
  return best;
}

struct Sampling {
  std::vector<std::int32_t> sample;   // ascending point indices
  std::vector<std::int32_t> nearest;  // per point: position in `sample`
};

// Farthest-point sampling from the outermost point on; stops early when only copies of samples are
// left. The set of samples does not depend on the order of the points, ties excepted.
Sampling sample_evenly(std::span<const double> xyz, std::size_t samples) {
  const std::size_t count = xyz.size() / 3;
  std::vector<double> distance(count, std::numeric_limits<double>::infinity());
  Sampling result;
  result.nearest.assign(count, 0);
  std::size_t next = outermost(xyz);
  while (result.sample.size() < std::min(samples, count) && distance[next] > 0.0) {
    const auto number = static_cast<std::int32_t>(result.sample.size());
    result.sample.push_back(static_cast<std::int32_t>(next));
    const double* centre = &xyz[3 * next];
    double farthest = -1.0;
    for (std::size_t i = 0; i < count; ++i) {
      if (const double d = squared_distance(&xyz[3 * i], centre); d < distance[i]) {
        distance[i] = d;
        result.nearest[i] = number;
      }
      if (distance[i] > farthest) {
        farthest = distance[i];
        next = i;
      }
    }
  }
  std::vector<std::int32_t> order(result.sample.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::sort(order, {}, [&](std::int32_t s) { return result.sample[std::size_t(s)]; });
  std::vector<std::int32_t> position(order.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    position[static_cast<std::size_t>(order[i])] = static_cast<std::int32_t>(i);
  for (auto& nearest : result.nearest) nearest = position[static_cast<std::size_t>(nearest)];
  std::ranges::sort(result.sample);
  return result;
}

// Ascending eigenvalues, one column per eigenvalue.
struct Eigenpairs {
  VectorXd value;
  MatrixXd function;
};

VectorXd start_vector(Eigen::Index size) {
  Random random(kStartSeed);
  return VectorXd::NullaryExpr(size, [&random](Eigen::Index) { return random.uniform(-1.0, 1.0); });
}

// Size of the Krylov space for `wanted` eigenpairs of a matrix of `size` rows.
Eigen::Index krylov_size(Eigen::Index wanted, Eigen::Index size) {
  return std::min(size, 2 * wanted + 10);
}

// x -> D^(1/2) (L - shift D)^-1 D^(1/2) x: inverts the symmetric D^(-1/2) L D^(-1/2) - shift.
class ShiftInvert {
 public:
  using Scalar = double;

  ShiftInvert(SparseMatrix stiffness, const VectorXd& mass)
      : matrix_(std::move(stiffness)), mass_(mass), root_(mass.cwiseSqrt()) {}

  Eigen::Index rows() const { return matrix_.rows(); }
  Eigen::Index cols() const { return matrix_.cols(); }
  void set_shift(double shift) {
    SparseMatrix shifted = matrix_;
    shifted.diagonal() -= shift * mass_;
    solver_.compute(shifted);
    if (solver_.info() != Eigen::Success)
      throw InputError("the Laplace-Beltrami operator could not be factorised");
  }
  void perform_op(const double* in, double* out) const {
    const Eigen::Map<const VectorXd> x(in, rows());
    Eigen::Map<VectorXd>(out, rows()) = root_.cwiseProduct(solver_.solve(root_.cwiseProduct(x)));
  }

 private:
  SparseMatrix matrix_;
  VectorXd mass_, root_;
  Eigen::SimplicialLDLT<SparseMatrix> solver_;
};

SparseMatrix stiffness_matrix(const WeakLaplacian& laplacian) {
  const auto size = static_cast<Eigen::Index>(laplacian.mass.size());
  std::vector<Eigen::Triplet<double>> entry;
  entry.reserve(4 * laplacian.edge.size() + laplacian.mass.size());
  for (Eigen::Index i = 0; i < size; ++i) entry.emplace_back(i, i, 0.0);
  for (const auto& [a, b, weight] : laplacian.edge) {
    entry.emplace_back(a, a, weight);
    entry.emplace_back(b, b, weight);
    entry.emplace_back(a, b, -weight);
    entry.emplace_back(b, a, -weight);
  }
  SparseMatrix result(size, size);
  result.setFromTriplets(entry.begin(), entry.end());
  return result;
}

// The smallest eigenpairs without the constant, orthonormal under the mass.
Eigenpairs weak_eigenpairs(const WeakLaplacian& laplacian, Eigen::Index count) {
  const Eigen::Map<const VectorXd> mass(laplacian.mass.data(),
                                        static_cast<Eigen::Index>(laplacian.mass.size()));
  ShiftInvert op(stiffness_matrix(laplacian), mass);
  // The shift keeps the singular stiffness invertible; its size is that of a low eigenvalue.
  Spectra::SymEigsShiftSolver<ShiftInvert> solver(
      op, count + 1, krylov_size(count + 1, mass.size()), -1.0 / mass.sum());
  const VectorXd start = start_vector(mass.size());
  solver.init(start.data());
  solver.compute(Spectra::SortRule::LargestMagn, kMaxRestarts, kTolerance,
                 Spectra::SortRule::SmallestAlge);
  if (solver.info() != Spectra::CompInfo::Successful)
    throw InputError("the eigenproblem of the Laplace-Beltrami operator did not converge");
  return {solver.eigenvalues().tail(count),
          mass.cwiseSqrt().cwiseInverse().asDiagonal() * solver.eigenvectors().rightCols(count)};
}

// Of the strong form, whose spectrum may hold negative and complex values: only eigenvalues with a
// positive real part that is ten times the imaginary one count. A conjugate pair stands for two
// equal real eigenvalues, with the real and the imaginary part of its vector as functions.
Eigenpairs usable_pairs(const Eigen::VectorXcd& value, const Eigen::MatrixXcd& vector, double zero,
                        const VectorXd& mass) {
  struct Candidate {
    double value;
    VectorXd function;
  };
  std::vector<Candidate> usable;
  for (Eigen::Index i = 0; i < value.size(); ++i) {
    const double real = value[i].real();
    const double imaginary = value[i].imag();
    if (real <= zero || std::abs(imaginary) > 0.1 * real) continue;
    const VectorXd part =
        imaginary < 0.0 ? VectorXd(vector.col(i).imag()) : VectorXd(vector.col(i).real());
    usable.push_back({real, part / std::sqrt(part.cwiseAbs2().dot(mass))});
  }
  std::ranges::stable_sort(usable, {}, &Candidate::value);
  Eigenpairs result{VectorXd(usable.size()), MatrixXd(mass.size(), usable.size())};
  for (std::size_t i = 0; i < usable.size(); ++i) {
    result.value[static_cast<Eigen::Index>(i)] = usable[i].value;
    result.function.col(static_cast<Eigen::Index>(i)) = usable[i].function;
  }
  return result;
}

// The eigenpairs of `matrix` nearest to zero, spurious ones among them.
Eigenpairs strong_eigenpairs(const SparseMatrix& matrix, const VectorXd& mass,
                             Eigen::Index wanted) {
  const double unit = 1.0 / mass.sum();  // the size of a low eigenvalue
  Spectra::SparseGenRealShiftSolve<double> op(matrix);
  Spectra::GenEigsRealShiftSolver<Spectra::SparseGenRealShiftSolve<double>> solver(
      op, wanted, krylov_size(wanted, mass.size()), -unit);
  const VectorXd start = start_vector(mass.size());
  solver.init(start.data());
  solver.compute(Spectra::SortRule::LargestMagn, kMaxRestarts, kTolerance);
  if (solver.info() != Spectra::CompInfo::Successful)
    throw InputError("the eigenproblem of the moving-least-squares operator did not converge");
  return usable_pairs(solver.eigenvalues(), solver.eigenvectors(), 1e-3 * unit, mass);
}

// The `count` smallest usable eigenpairs. Asks for more of all kinds until there are enough.
Eigenpairs strong_eigenpairs(const StrongLaplacian& laplacian, const VectorXd& mass,
                             Eigen::Index count) {
  std::vector<Eigen::Triplet<double>> entry;
  for (const auto& [row, column, value] : laplacian.entry) entry.emplace_back(row, column, value);
  SparseMatrix matrix(mass.size(), mass.size());
  matrix.setFromTriplets(entry.begin(), entry.end());
  const Eigen::Index all = mass.size() - 2;
  Eigenpairs result;
  for (Eigen::Index wanted = std::min(2 * count + 10, all);; wanted = std::min(2 * wanted, all)) {
    result = strong_eigenpairs(matrix, mass, wanted);
    if (result.value.size() >= count) break;
    if (wanted == all)
      throw InputError("the moving-least-squares operator has only " +
                       std::to_string(result.value.size()) + " usable eigenpairs of " +
                       std::to_string(count));
  }
  return {result.value.head(count), result.function.leftCols(count)};
}

// Makes the entry of largest magnitude of every column positive.
void fix_signs(MatrixXd& function) {
  for (Eigen::Index e = 0; e < function.cols(); ++e) {
    Eigen::Index largest = 0;
    function.col(e).cwiseAbs().maxCoeff(&largest);
    if (function(largest, e) < 0.0) function.col(e) *= -1.0;
  }
}

Eigenpairs eigenpairs_of(std::span<const double> points, const Params& params,
                         std::vector<std::int32_t>& component) {
  WeakLaplacian weak = weak_laplacian(points, params.neighbours);
  component = weak.component;
  if (params.op == Operator::weak) {
    add_bridges(points, params.bridge, weak);
    return weak_eigenpairs(weak, params.eigenpairs);
  }
  const Eigen::Map<const VectorXd> mass(weak.mass.data(),
                                        static_cast<Eigen::Index>(weak.mass.size()));
  return strong_eigenpairs(mls_laplacian(points, params.neighbours), mass, params.eigenpairs);
}

}  // namespace

Fields describe(Params& params) {
  return {
      choice_field("operator", params.op,
                   "Discretisation: weak (cotangent weights) or mls (the paper's moving least "
                   "squares, for closed surfaces)."),
      integer_field("samples", params.samples, 10, 20000, "",
                    "Points that the operator is built on, chosen evenly."),
      integer_field("eigenpairs", params.eigenpairs, 1, 500, "",
                    "Eigenpairs kept, without the constant one."),
      integer_field("neighbours", params.neighbours, 6, 64, "",
                    "Nearest points, itself included, that a point's one-ring or least-squares "
                    "patch is made from."),
      number_field("bridge", params.bridge, 1e-6, 1e3, "",
                   "Weight of the edges that join separate pieces: crossing one adds about its "
                   "inverse to the squared distance."),
  };
}

Spectrum compute(const Cloud& cloud, const Params& params) {
  const int needed = params.eigenpairs + 2;
  if (params.samples < needed)
    throw ParameterError("samples: " + std::to_string(params.eigenpairs) +
                         " eigenpairs need at least " + std::to_string(needed) + " samples");
  const std::vector<double> xyz = scaled_points(cloud);
  Sampling sampling;
  if (!xyz.empty()) sampling = sample_evenly(xyz, static_cast<std::size_t>(params.samples));
  if (sampling.sample.size() < static_cast<std::size_t>(needed))
    throw InputError("the cloud has " + std::to_string(sampling.sample.size()) +
                     " different points; " + std::to_string(params.eigenpairs) +
                     " eigenpairs need at least " + std::to_string(needed));
  std::vector<double> points;
  for (const std::int32_t s : sampling.sample)
    points.insert(points.end(), &xyz[3 * static_cast<std::size_t>(s)],
                  &xyz[3 * static_cast<std::size_t>(s)] + 3);

  Spectrum result;
  Params copy = params;
  result.recipe = recipe(describe(copy));
  Eigenpairs pairs = eigenpairs_of(points, params, result.component);
  fix_signs(pairs.function);
  for (const std::int32_t s : sampling.sample)
    result.sample_dense.push_back(
        cloud.dense_index.empty() ? s : cloud.dense_index[static_cast<std::size_t>(s)]);
  result.sample = std::move(sampling.sample);
  result.nearest_sample = std::move(sampling.nearest);
  result.eigenvalue.assign(pairs.value.begin(), pairs.value.end());
  for (Eigen::Index s = 0; s < pairs.function.rows(); ++s)
    for (Eigen::Index e = 0; e < pairs.function.cols(); ++e)
      result.eigenfunction.push_back(static_cast<float>(pairs.function(s, e)));
  return result;
}

double commute_distance(const Spectrum& spectrum, std::int32_t a, std::int32_t b) {
  const std::size_t count = spectrum.eigenvalue.size();
  const float* first = &spectrum.eigenfunction[static_cast<std::size_t>(a) * count];
  const float* second = &spectrum.eigenfunction[static_cast<std::size_t>(b) * count];
  double sum = 0.0;
  for (std::size_t e = 0; e < count; ++e) {
    const double difference = double{first[e]} - second[e];
    sum += difference * difference / spectrum.eigenvalue[e];
  }
  return std::sqrt(sum);
}

std::vector<float> commute_embedding(const Spectrum& spectrum) {
  const std::size_t count = spectrum.eigenvalue.size();
  std::vector<float> result = spectrum.eigenfunction;
  for (std::size_t i = 0; i < result.size(); ++i)
    result[i] /= std::sqrt(spectrum.eigenvalue[i % count]);
  return result;
}

}  // namespace cosegraph::spectra

template <>
cosegraph::Names<cosegraph::spectra::Operator> cosegraph::names<cosegraph::spectra::Operator>() {
  using enum cosegraph::spectra::Operator;
  static constexpr std::pair<cosegraph::spectra::Operator, std::string_view> table[] = {
      {weak, "weak"},
      {mls, "mls"},
  };
  return table;
}
