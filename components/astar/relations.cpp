#include "astar/relations.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "core/nearest.hpp"
#include "core/random.hpp"

namespace cosegraph::astar {
namespace {

using Samples = std::span<const std::int32_t>;

constexpr double kSigmaFloor = 0.02;  // of the mean distance of all pairs
constexpr double kBinWidth = 0.25;    // of the deviation floor
constexpr float kBackground = 1e-3F;  // density of distances that no mixture explains (geomean)
constexpr int kMaxIterations = 200;
constexpr double kConverged = 1e-6;  // change of the mean log likelihood

std::size_t pair_count(std::size_t labels) {
  return labels * (labels + 1) / 2;
}

// A distance that stands for `weight` equal ones.
struct Bin {
  double distance;
  double weight;
};

// Groups equal distances up to `width`; ascending.
std::vector<Bin> binned(std::vector<float> distances, double width) {
  std::ranges::sort(distances);
  std::vector<Bin> bins;
  double end = -1.0;
  for (const float distance : distances) {
    if (bins.empty() || distance >= end) {
      bins.push_back({0.0, 0.0});
      end = (std::floor(distance / width) + 1.0) * width;
    }
    bins.back().distance += distance;
    bins.back().weight += 1.0;
  }
  for (auto& bin : bins) bin.distance /= bin.weight;
  return bins;
}

// One Gaussian under EM.
struct Gaussian {
  double weight = 0.0;
  double mean = 0.0;
  double variance = 0.0;

  double log_density(double x) const {
    return std::log(weight) -
           0.5 * (std::log(2.0 * std::numbers::pi * variance) + (x - mean) * (x - mean) / variance);
  }
};

struct Moments {
  double weight = 0.0;
  double sum = 0.0;
  double square = 0.0;

  void add(double x, double w) {
    weight += w;
    sum += w * x;
    square += w * x * x;
  }
  Gaussian gaussian(double total, double min_variance) const {
    const double mean = sum / weight;
    return {weight / total, mean, std::max(square / weight - mean * mean, min_variance)};
  }
};

// Consecutive groups of equal total weight, one Gaussian each.
std::vector<Gaussian> by_quantiles(std::span<const Bin> bins, std::size_t count, double total,
                                   double min_variance) {
  std::vector<Moments> moments(count);
  double before = 0.0;
  for (const auto& bin : bins) {
    const double middle = before + 0.5 * bin.weight;
    const auto group = static_cast<std::size_t>(middle / total * static_cast<double>(count));
    moments[std::min(group, count - 1)].add(bin.distance, bin.weight);
    before += bin.weight;
  }
  std::vector<Gaussian> result;
  for (const auto& moment : moments)
    if (moment.weight > 0.0) result.push_back(moment.gaussian(total, min_variance));
  return result;
}

// One EM step in place; returns the mean log likelihood before it. A component that lost its
// distances is left out.
double expectation_maximisation(std::span<const Bin> bins, double total, double min_variance,
                                std::vector<Gaussian>& mixture) {
  std::vector<Moments> moments(mixture.size());
  std::vector<double> posterior(mixture.size());
  double log_likelihood = 0.0;
  for (const auto& bin : bins) {
    double highest = -std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < mixture.size(); ++k) {
      posterior[k] = mixture[k].log_density(bin.distance);
      highest = std::max(highest, posterior[k]);
    }
    double sum = 0.0;
    for (double& p : posterior) sum += p = std::exp(p - highest);
    log_likelihood += bin.weight * (highest + std::log(sum));
    for (std::size_t k = 0; k < mixture.size(); ++k)
      moments[k].add(bin.distance, bin.weight * posterior[k] / sum);
  }
  mixture.clear();
  for (const auto& moment : moments)
    if (moment.weight > 1e-9 * total) mixture.push_back(moment.gaussian(total, min_variance));
  return log_likelihood / total;
}

DistanceMixture fit_mixture(std::span<const Bin> bins, int components, double min_sigma) {
  double total = 0.0;
  for (const auto& bin : bins) total += bin.weight;
  const double min_variance = min_sigma * min_sigma;
  const auto count = std::min(static_cast<std::size_t>(components), bins.size());
  auto mixture = by_quantiles(bins, count, total, min_variance);
  double last = -std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const double now = expectation_maximisation(bins, total, min_variance, mixture);
    if (now - last < kConverged) break;
    last = now;
  }
  DistanceMixture result;
  for (const auto& gaussian : mixture) {
    result.weight.push_back(static_cast<float>(gaussian.weight));
    result.mean.push_back(static_cast<float>(gaussian.mean));
    result.sigma.push_back(static_cast<float>(std::sqrt(gaussian.variance)));
  }
  return result;
}

std::vector<std::vector<std::int32_t>> samples_by_label(const RelationView& view, int label_count) {
  if (view.spectrum == nullptr) throw InputError("a relation view has no spectrum");
  if (view.label.size() != view.spectrum->sample.size())
    throw InputError("a relation view has " + std::to_string(view.label.size()) + " labels for " +
                     std::to_string(view.spectrum->sample.size()) + " samples");
  std::vector<std::vector<std::int32_t>> result(static_cast<std::size_t>(label_count));
  for (std::size_t s = 0; s < view.label.size(); ++s) {
    const std::int32_t label = view.label[s];
    if (label == kNoLabel) continue;
    if (label < 0 || label >= label_count)
      throw InputError("sample " + std::to_string(s) + " has label " + std::to_string(label) +
                       " of " + std::to_string(label_count));
    result[static_cast<std::size_t>(label)].push_back(static_cast<std::int32_t>(s));
  }
  return result;
}

// Commute-time distances between samples of one spectrum.
class Distances {
 public:
  explicit Distances(const Spectrum& spectrum)
      : functions_(spectrum.eigenfunction.data(), static_cast<Eigen::Index>(spectrum.sample.size()),
                   static_cast<Eigen::Index>(spectrum.eigenvalue.size())),
        inverse_(Eigen::Map<const Eigen::ArrayXf>(spectrum.eigenvalue.data(), functions_.cols())
                     .inverse()
                     .transpose()) {}

  float operator()(std::int32_t a, std::int32_t b) const {
    return std::sqrt(((functions_.row(a) - functions_.row(b)).square() * inverse_).sum());
  }

 private:
  Eigen::Map<const Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> functions_;
  Eigen::Array<float, 1, Eigen::Dynamic> inverse_;
};

// Position of element `index` of the strict lower triangle, row by row: row > column.
std::pair<std::size_t, std::size_t> triangle_position(std::size_t index) {
  auto row =
      static_cast<std::size_t>(0.5 * (1.0 + std::sqrt(1.0 + 8.0 * static_cast<double>(index))));
  while (row * (row - 1) / 2 > index) --row;
  while (row * (row + 1) / 2 <= index) ++row;
  return {row, index - row * (row - 1) / 2};
}

// Appends distances between samples of two parts (of pairs within one part if both are the same
// part): all of them, or one drawn from each of `count` equal stretches of their list.
void append_distances(const Distances& distance, Samples a, Samples b, bool same_part,
                      std::size_t count, Random random, std::vector<float>& result) {
  if (a.empty() || b.empty()) return;
  const std::size_t total = same_part ? a.size() * (a.size() - 1) / 2 : a.size() * b.size();
  count = std::min(count, total);
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t begin = n * total / count;
    const std::size_t index = begin + random.below((n + 1) * total / count - begin);
    const auto [i, j] =
        same_part ? triangle_position(index) : std::pair{index / b.size(), index % b.size()};
    result.push_back(distance(a[i], b[j]));
  }
}

// The distances between two groups of samples, an even subset if there are more than
// `max_distances`. Each row of the (a, b) table is rotated by its number, so that a stride of
// whole rows still visits all of `b`. A sample's distance to itself is left out.
Eigen::ArrayXf distances_between(const Spectrum& spectrum, Samples a, Samples b,
                                 int max_distances) {
  const Distances distance(spectrum);
  const std::size_t total = a.size() * b.size();
  const std::size_t count = std::min(total, static_cast<std::size_t>(std::max(max_distances, 0)));
  Eigen::ArrayXf result(static_cast<Eigen::Index>(count));
  Eigen::Index used = 0;
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t index = n * total / count;
    const std::size_t row = index / b.size();
    const std::int32_t other = b[(index + row) % b.size()];
    if (a[row] != other) result[used++] = distance(a[row], other);
  }
  result.conservativeResize(used);
  return result;
}

// Logarithm of each component's share of the density: one column per component.
Eigen::ArrayXXf log_shares(const DistanceMixture& mixture, const Eigen::ArrayXf& distance) {
  Eigen::ArrayXXf result(distance.size(), static_cast<Eigen::Index>(mixture.weight.size()));
  for (std::size_t k = 0; k < mixture.weight.size(); ++k) {
    const float sigma = mixture.sigma[k];
    const float peak =
        std::log(mixture.weight[k] / (std::sqrt(2.0F * std::numbers::pi_v<float>) * sigma));
    result.col(static_cast<Eigen::Index>(k)) =
        peak - 0.5F * ((distance - mixture.mean[k]) * (1.0F / sigma)).square();
  }
  return result;
}

double log_sum_exp(const Eigen::ArrayXd& values) {
  const double highest = values.maxCoeff();
  return highest + std::log((values - highest).exp().sum());
}

// Eq. (8), its logarithm.
double log_likelihood(const DistanceMixture& mixture, const Eigen::ArrayXf& distance,
                      Likelihood likelihood) {
  const Eigen::ArrayXXf log = log_shares(mixture, distance);
  if (likelihood == Likelihood::literal) return log_sum_exp(log.reshaped().cast<double>());
  Eigen::ArrayXf density = Eigen::ArrayXf::Constant(distance.size(), kBackground);
  for (Eigen::Index k = 0; k < log.cols(); ++k) density += log.col(k).exp();
  return density.log().cast<double>().mean();
}

// Per unordered label pair; a pair without a mixture gets the lowest value of the others. Empty
// if no pair has a mixture.
std::vector<double> log_likelihoods(const RelationModel& model, const Eigen::ArrayXf& distance,
                                    Likelihood likelihood) {
  constexpr double kUnseen = std::numeric_limits<double>::infinity();
  std::vector<double> result;
  for (const auto& mixture : model.pairs)
    result.push_back(mixture.weight.empty() ? kUnseen
                                            : log_likelihood(mixture, distance, likelihood));
  if (result.empty()) return {};
  const double lowest = *std::ranges::min_element(result);
  if (lowest == kUnseen) return {};
  std::ranges::replace(result, kUnseen, lowest);
  return result;
}

}  // namespace

std::vector<DistanceMixture> fit_relations(std::span<const RelationView> views, int label_count,
                                           const RelationParams& params) {
  const auto labels = static_cast<std::size_t>(label_count);
  std::vector<std::vector<float>> distances(pair_count(labels));
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto samples = samples_by_label(views[v], label_count);
    const Distances distance(*views[v].spectrum);
    for (std::size_t a = 0; a < labels; ++a)
      for (std::size_t b = 0; b <= a; ++b) {
        const std::size_t pair = pair_index(a, b);
        append_distances(distance, samples[a], samples[b], a == b,
                         static_cast<std::size_t>(params.samples_per_pair),
                         Random(derive_seed(params.seed, pair, v)), distances[pair]);
      }
  }
  double sum = 0.0;
  std::size_t count = 0;
  for (const auto& pair : distances) {
    sum = std::accumulate(pair.begin(), pair.end(), sum);
    count += pair.size();
  }
  std::vector<DistanceMixture> result(distances.size());
  if (sum == 0.0) return result;  // no two different points share a view
  if (!std::isfinite(sum)) throw InputError("a distance between samples is not finite");
  const double min_sigma = kSigmaFloor * sum / static_cast<double>(count);
  for (std::size_t pair = 0; pair < distances.size(); ++pair)
    if (!distances[pair].empty())
      result[pair] = fit_mixture(binned(std::move(distances[pair]), kBinWidth * min_sigma),
                                 params.mixture, min_sigma);
  return result;
}

std::vector<double> log_pair_posterior(const Spectrum& spectrum, Samples group_a, Samples group_b,
                                       const RelationModel& model, Likelihood likelihood,
                                       int max_distances) {
  const std::size_t labels = model.label_names.size();
  std::vector<double> result(labels * labels, 0.0);
  if (group_a.empty() || group_b.empty()) return result;
  const Eigen::ArrayXf distance = distances_between(spectrum, group_a, group_b, max_distances);
  if (distance.size() == 0) return result;
  const auto pairs = log_likelihoods(model, distance, likelihood);
  if (pairs.empty()) return result;
  for (std::size_t a = 0; a < labels; ++a)
    for (std::size_t b = 0; b < labels; ++b) result[a * labels + b] = pairs[pair_index(a, b)];
  const double evidence = log_sum_exp(
      Eigen::Map<const Eigen::ArrayXd>(result.data(), static_cast<Eigen::Index>(result.size())));
  for (double& value : result) value -= evidence;
  return result;
}

std::vector<std::uint8_t> observed_neighbours(std::span<const Cloud* const> views, int label_count,
                                              double radius, int min_pairs) {
  const auto labels = static_cast<std::size_t>(label_count);
  std::vector<std::uint8_t> result(labels * labels, 0);
  for (std::size_t l = 0; l < labels; ++l) result[l * labels + l] = 1;
  for (const Cloud* view : views) {
    if (view->label.size() != view->size())
      throw InputError("a view without labels shows no neighbourhoods");
    const NearestNeighbours near(view->xyz);
    const auto reach = static_cast<float>(radius * view->scale);
    std::vector<std::int64_t> count(pair_count(labels), 0);
    for (std::size_t i = 0; i < view->size(); ++i) {
      const std::int32_t a = view->label[i];
      if (a == kNoLabel) continue;
      if (a < 0 || a >= label_count)
        throw InputError("point " + std::to_string(i) + " has label " + std::to_string(a) + " of " +
                         std::to_string(label_count));
      for (const auto& neighbour : near.within(&view->xyz[3 * i], reach)) {
        const auto j = static_cast<std::size_t>(neighbour.index);
        if (j > i && view->label[j] >= 0 && view->label[j] < label_count)
          ++count[pair_index(static_cast<std::size_t>(a),
                             static_cast<std::size_t>(view->label[j]))];
      }
    }
    for (std::size_t a = 0; a < labels; ++a)
      for (std::size_t b = 0; b < a; ++b)
        if (count[pair_index(a, b)] >= min_pairs)
          result[a * labels + b] = result[b * labels + a] = 1;
  }
  return result;
}

}  // namespace cosegraph::astar

template <>
cosegraph::Names<cosegraph::astar::Likelihood> cosegraph::names<cosegraph::astar::Likelihood>() {
  using enum cosegraph::astar::Likelihood;
  static constexpr std::pair<cosegraph::astar::Likelihood, std::string_view> table[] = {
      {literal, "literal"},
      {geomean, "geomean"},
  };
  return table;
}
