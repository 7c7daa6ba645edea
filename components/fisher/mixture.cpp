#include "fisher/mixture.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "core/error.hpp"
#include "core/random.hpp"
#include "fisher/kernels.hpp"

namespace cosegraph::fisher {
namespace {

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr int kLloydIterations = 3;
constexpr double kStarved = 0.1;  // expected samples below which a component is re-seeded

std::size_t check_samples(std::span<const float> samples, int dimension) {
  if (dimension < 1) throw InputError("samples of dimension " + std::to_string(dimension));
  if (samples.empty()) throw InputError("no samples");
  if (samples.size() % dimension != 0)
    throw InputError(std::to_string(samples.size()) + " numbers are not whole samples of " +
                     std::to_string(dimension));
  for (std::size_t i = 0; i < samples.size(); ++i)
    if (!std::isfinite(samples[i]))
      throw InputError("sample " + std::to_string(i / dimension) + ", dimension " +
                       std::to_string(i % dimension) + " is not finite");
  return samples.size() / dimension;
}

// Of all samples: mean and variance per dimension, the latter bounded away from 0 so that constant
// dimensions do no harm.
struct Moments {
  std::vector<double> mean;
  std::vector<double> variance;
};

Moments moments(std::span<const float> samples, int dimension) {
  const std::size_t count = samples.size() / dimension;
  Moments result{std::vector<double>(dimension), std::vector<double>(dimension)};
  for (std::size_t i = 0; i < count; ++i)
    for (int d = 0; d < dimension; ++d) result.mean[d] += samples[i * dimension + d];
  for (double& m : result.mean) m /= static_cast<double>(count);
  for (std::size_t i = 0; i < count; ++i)
    for (int d = 0; d < dimension; ++d) {
      const double u = samples[i * dimension + d] - result.mean[d];
      result.variance[d] += u * u;
    }
  double average = 0.0;
  for (double& v : result.variance) average += (v /= static_cast<double>(count)) / dimension;
  for (int d = 0; d < dimension; ++d) {
    const double rounding = 1e-5 * (std::abs(result.mean[d]) + 1e-5);
    result.variance[d] = std::max({result.variance[d], 1e-6 * average, rounding * rounding});
  }
  return result;
}

// What one pass over the samples gathers. Deviations are in units of the component's sigma.
struct Sums {
  std::vector<double> weight;         // K
  std::vector<double> first;          // K x D
  std::vector<double> second;         // K x D
  std::vector<float> log_likelihood;  // N
};

enum class Assignment { soft, nearest };

// joint -> 1 for the most likely component, 0 for the others; evidence = its value.
void harden(int padded, float* joint, float* evidence) {
  for (int lane = 0; lane < kLanes; ++lane) {
    int best = 0;
    for (int k = 1; k < padded; ++k)
      if (joint[k * kLanes + lane] > joint[best * kLanes + lane]) best = k;
    evidence[lane] = joint[best * kLanes + lane];
    for (int k = 0; k < padded; ++k) joint[k * kLanes + lane] = k == best ? 1.0F : 0.0F;
  }
}

// The samples of a batch that a component has a share in.
struct Shares {
  std::vector<std::int32_t> row;
  std::vector<float> weight;
  std::size_t count = 0;
  float total = 0.0F;

  explicit Shares(std::size_t capacity) : row(capacity), weight(capacity) {}

  // posterior[(i / kLanes) * stride + i % kLanes] belongs to sample begin + i. Without branches:
  // which posteriors vanish is not predictable.
  void collect(const float* posterior, std::size_t stride, std::size_t begin, std::size_t end) {
    float sum[kLanes] = {};
    std::size_t kept = 0;
    for (std::size_t first = begin; first < end; first += kLanes, posterior += stride) {
      const std::size_t lanes = std::min<std::size_t>(kLanes, end - first);
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        row[kept] = static_cast<std::int32_t>(first + lane);
        weight[kept] = posterior[lane];
        kept += posterior[lane] > 0.0F ? 1 : 0;
        sum[lane] += posterior[lane];
      }
    }
    count = kept;
    total = std::accumulate(sum, sum + kLanes, 0.0F);
  }
};

// One pass in batches that stay in the cache. Sums are in single precision within a batch.
Sums expectation(const GaussianMixture& mixture, const Panels& panels,
                 std::span<const float> samples, Assignment assignment) {
  constexpr std::size_t kBatch = 16;  // panels
  const Evaluator evaluator(mixture);
  const int dimension = mixture.dimension;
  const std::size_t joint_size = static_cast<std::size_t>(evaluator.padded) * kLanes;
  Sums sums{std::vector<double>(mixture.components), std::vector<double>(mixture.mean.size()),
            std::vector<double>(mixture.mean.size()),
            std::vector<float>(panels.panel_count() * kLanes)};
  std::vector<float> joint(kBatch * joint_size);
  Shares shares(kBatch * kLanes + 1);
  std::vector<float> first(dimension);
  std::vector<float> second(dimension);
  for (std::size_t begin = 0; begin < panels.panel_count(); begin += kBatch) {
    const std::size_t end = std::min(begin + kBatch, panels.panel_count());
    for (std::size_t p = begin; p < end; ++p) {
      float* values = &joint[(p - begin) * joint_size];
      float* evidence = &sums.log_likelihood[p * kLanes];
      log_joint(evaluator, panels.panel(p), values);
      if (assignment == Assignment::soft)
        normalise(evaluator.padded, values, evidence);
      else
        harden(evaluator.padded, values, evidence);
    }
    const std::size_t last = std::min(end * kLanes, panels.count);
    for (int k = 0; k < mixture.components; ++k) {
      shares.collect(&joint[k * kLanes], joint_size, begin * kLanes, last);
      std::ranges::fill(first, 0.0F);
      std::ranges::fill(second, 0.0F);
      const std::size_t row = static_cast<std::size_t>(k) * dimension;
      accumulate(dimension, samples.data(), {shares.row.data(), shares.count}, shares.weight.data(),
                 &evaluator.mean[row], &evaluator.inverse[row], first.data(), second.data());
      sums.weight[k] += shares.total;
      for (int d = 0; d < dimension; ++d) {
        sums.first[row + d] += first[d];
        sums.second[row + d] += second[d];
      }
    }
  }
  sums.log_likelihood.resize(panels.count);
  return sums;
}

// Samples by rising likelihood, for re-seeding.
class WorstExplained {
 public:
  explicit WorstExplained(const std::vector<float>& log_likelihood)
      : log_likelihood_(log_likelihood), taken_(log_likelihood.size(), false) {}

  std::size_t next() {
    std::size_t worst = 0;
    for (std::size_t i = 1; i < taken_.size(); ++i)
      if (taken_[worst] || (!taken_[i] && log_likelihood_[i] < log_likelihood_[worst])) worst = i;
    taken_[worst] = true;
    return worst;
  }

 private:
  const std::vector<float>& log_likelihood_;
  std::vector<bool> taken_;
};

enum class Update { means, all };

// New parameters from the sums. A starved component moves to the worst explained sample, with the
// deviations of the whole.
void maximise(const Sums& sums, std::span<const float> samples, const Moments& whole,
              double variance_floor, Update update, GaussianMixture& mixture) {
  WorstExplained worst(sums.log_likelihood);
  const auto count = static_cast<double>(sums.log_likelihood.size());
  const int dimension = mixture.dimension;
  double total = 0.0;
  std::vector<double> weight(mixture.components);
  for (int k = 0; k < mixture.components; ++k) {
    const bool starved = sums.weight[k] < kStarved;
    const float* seed = starved ? &samples[worst.next() * dimension] : nullptr;
    total += weight[k] = starved ? 1.0 : sums.weight[k];
    for (int d = 0; d < dimension; ++d) {
      const std::size_t cell = static_cast<std::size_t>(k) * dimension + d;
      if (starved) {
        mixture.mean[cell] = seed[d];
        mixture.sigma[cell] = static_cast<float>(std::sqrt(whole.variance[d]));
        continue;
      }
      const double sigma = mixture.sigma[cell];
      const double shift = sums.first[cell] / sums.weight[k];
      mixture.mean[cell] = static_cast<float>(mixture.mean[cell] + sigma * shift);
      if (update == Update::means) continue;
      const double variance = sigma * sigma * (sums.second[cell] / sums.weight[k] - shift * shift);
      mixture.sigma[cell] =
          static_cast<float>(std::sqrt(std::max(variance, variance_floor * whole.variance[d])));
    }
  }
  if (update == Update::means) return;
  // A component that nearly vanished keeps a weight that (4) and (5) can divide by.
  const double least = kStarved / count;
  for (int k = 0; k < mixture.components; ++k)
    mixture.weight[k] = static_cast<float>(std::max(weight[k] / total, least));
  const double sum = std::accumulate(mixture.weight.begin(), mixture.weight.end(), 0.0);
  for (float& w : mixture.weight) w = static_cast<float>(w / sum);
}

// k-means++ (Arthur, Vassilvitskii, SODA 2007): each centre is drawn with probability in
// proportion to the squared distance from the centres before it.
std::vector<std::size_t> draw_centres(std::span<const float> samples, const Panels& panels,
                                      const std::vector<float>& inverse, int centres,
                                      Random& random) {
  std::vector<std::size_t> result{random.below(panels.count)};
  std::vector<float> nearest(panels.panel_count() * kLanes, std::numeric_limits<float>::max());
  std::vector<double> cumulative(panels.count);
  while (static_cast<int>(result.size()) < centres) {
    const float* centre = &samples[result.back() * panels.dimension];
    for (std::size_t p = 0; p < panels.panel_count(); ++p) {
      float distance[kLanes];
      squared_distances(panels.dimension, panels.panel(p), centre, inverse.data(), distance);
      for (int lane = 0; lane < kLanes; ++lane)
        nearest[p * kLanes + lane] = std::min(nearest[p * kLanes + lane], distance[lane]);
    }
    std::partial_sum(nearest.begin(), nearest.begin() + static_cast<std::ptrdiff_t>(panels.count),
                     cumulative.begin(), [](double sum, double value) { return sum + value; });
    if (cumulative.back() <= 0.0) {  // all samples coincide with a centre
      result.push_back(random.below(panels.count));
      continue;
    }
    const double drawn = random.uniform() * cumulative.back();
    const auto found = std::ranges::upper_bound(cumulative, drawn);
    result.push_back(std::min<std::size_t>(found - cumulative.begin(), panels.count - 1));
  }
  return result;
}

// Equal weights, the centres as means, the deviations of the whole: the most likely component of
// a sample is then the nearest centre.
GaussianMixture mixture_at(const std::vector<std::size_t>& centres, std::span<const float> samples,
                           const Moments& whole) {
  GaussianMixture mixture;
  mixture.components = static_cast<std::int32_t>(centres.size());
  mixture.dimension = static_cast<std::int32_t>(whole.mean.size());
  mixture.weight.assign(centres.size(), 1.0F / static_cast<float>(centres.size()));
  for (const std::size_t centre : centres) {
    const auto row = samples.subspan(centre * mixture.dimension, mixture.dimension);
    mixture.mean.insert(mixture.mean.end(), row.begin(), row.end());
    for (const double v : whole.variance) mixture.sigma.push_back(static_cast<float>(std::sqrt(v)));
  }
  return mixture;
}

// What a mixture says of each sample, in the samples' order.
struct Evaluation {
  std::vector<float> per_component;  // N x K: log(w_k N_k), or the posteriors
  std::vector<float> evidence;       // N: log p; empty unless normalised
};

Evaluation evaluate_all(const GaussianMixture& mixture, std::span<const float> samples,
                        bool normalised) {
  if (samples.empty()) return {};
  const std::size_t count = check_samples(samples, mixture.dimension);
  const std::size_t components = mixture.components;
  const Evaluator evaluator(mixture);
  const Panels panels = pack(samples, mixture.dimension);
  Evaluation result;
  result.per_component.resize(count * components);
  std::vector<float> joint(static_cast<std::size_t>(evaluator.padded) * kLanes);
  float evidence[kLanes];
  for (std::size_t begin = 0; begin < count; begin += kLanes) {
    const std::size_t lanes = std::min<std::size_t>(kLanes, count - begin);
    log_joint(evaluator, panels.panel(begin / kLanes), joint.data());
    if (normalised) {
      normalise(evaluator.padded, joint.data(), evidence);
      result.evidence.insert(result.evidence.end(), evidence, evidence + lanes);
    }
    for (std::size_t lane = 0; lane < lanes; ++lane)
      for (std::size_t k = 0; k < components; ++k)
        result.per_component[(begin + lane) * components + k] = joint[k * kLanes + lane];
  }
  return result;
}

}  // namespace

GaussianMixture fit_mixture(std::span<const float> samples, int dimension,
                            const MixtureParams& params) {
  const std::size_t count = check_samples(samples, dimension);
  if (params.components < 1) throw ParameterError("a mixture needs at least one component");
  const int components =
      static_cast<int>(std::min<std::size_t>(static_cast<std::size_t>(params.components), count));
  const Moments whole = moments(samples, dimension);
  std::vector<float> inverse(dimension);
  for (int d = 0; d < dimension; ++d)
    inverse[d] = static_cast<float>(1.0 / std::sqrt(whole.variance[d]));
  const Panels panels = pack(samples, dimension);
  Random random(params.seed);
  GaussianMixture mixture =
      mixture_at(draw_centres(samples, panels, inverse, components, random), samples, whole);
  for (int i = 0; i <= kLloydIterations; ++i) {
    const Update update = i < kLloydIterations ? Update::means : Update::all;
    maximise(expectation(mixture, panels, samples, Assignment::nearest), samples, whole,
             params.variance_floor, update, mixture);
  }
  for (int i = 0; i < params.iterations; ++i)
    maximise(expectation(mixture, panels, samples, Assignment::soft), samples, whole,
             params.variance_floor, Update::all, mixture);
  return mixture;
}

std::vector<float> log_likelihood(const GaussianMixture& mixture, std::span<const float> samples) {
  return evaluate_all(mixture, samples, true).evidence;
}

std::vector<float> posteriors(const GaussianMixture& mixture, std::span<const float> samples) {
  return evaluate_all(mixture, samples, true).per_component;
}

std::vector<float> log_components(const GaussianMixture& mixture, std::span<const float> samples) {
  return evaluate_all(mixture, samples, false).per_component;
}

Projection fit_projection(std::span<const float> samples, int dimension, int output) {
  const std::size_t count = check_samples(samples, dimension);
  output = std::min(output, dimension);
  if (output < 1) throw ParameterError("a projection needs at least one output dimension");
  const Moments whole = moments(samples, dimension);
  const Eigen::RowVectorXf mean =
      Eigen::Map<const Eigen::RowVectorXd>(whole.mean.data(), dimension).cast<float>();
  const Matrix centred =
      Eigen::Map<const Matrix>(samples.data(), static_cast<Eigen::Index>(count), dimension)
          .rowwise() -
      mean;
  Eigen::MatrixXf scatter = Eigen::MatrixXf::Zero(dimension, dimension);
  scatter.selfadjointView<Eigen::Lower>().rankUpdate(centred.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scatter.cast<double>());
  if (solver.info() != Eigen::Success) throw InputError("principal components did not converge");

  Projection result{.input = dimension, .output = output};
  result.mean.assign(mean.begin(), mean.end());
  for (int row = 0; row < output; ++row) {  // eigenvalues ascend
    const Eigen::VectorXd axis = solver.eigenvectors().col(dimension - 1 - row);
    Eigen::Index largest = 0;
    axis.cwiseAbs().maxCoeff(&largest);
    const double sign = axis[largest] < 0.0 ? -1.0 : 1.0;
    for (const double value : axis) result.basis.push_back(static_cast<float>(sign * value));
  }
  return result;
}

std::vector<float> project(const Projection& projection, std::span<const float> samples) {
  if (projection.output == 0) return {samples.begin(), samples.end()};
  if (samples.size() % projection.input != 0)
    throw MismatchError("the projection takes samples of " + std::to_string(projection.input) +
                        " numbers");
  const auto rows = static_cast<Eigen::Index>(samples.size()) / projection.input;
  std::vector<float> result(rows * projection.output);
  const Eigen::Map<const Matrix> in(samples.data(), rows, projection.input);
  const Eigen::Map<const Matrix> basis(projection.basis.data(), projection.output,
                                       projection.input);
  const Eigen::Map<const Eigen::RowVectorXf> mean(projection.mean.data(), projection.input);
  Eigen::Map<Matrix>(result.data(), rows, projection.output).noalias() =
      (in.rowwise() - mean) * basis.transpose();
  return result;
}

}  // namespace cosegraph::fisher
