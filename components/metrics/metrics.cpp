#include "metrics/metrics.hpp"

#include <algorithm>
#include <map>
#include <string>
#include <utility>

#include "core/cloud.hpp"
#include "core/error.hpp"

namespace cosegraph::metrics {
namespace {

void check_sizes(Labels evaluated, Labels reference, Weights weight) {
  if (evaluated.size() != reference.size())
    throw InputError(std::to_string(evaluated.size()) + " labels are compared with " +
                     std::to_string(reference.size()));
  if (!weight.empty() && weight.size() != reference.size())
    throw InputError(std::to_string(weight.size()) + " weights for " +
                     std::to_string(reference.size()) + " labels");
}

double weight_of(Weights weight, std::size_t element) {
  return weight.empty() ? 1.0 : weight[element];
}

// Sizes of the segments of both sides and of their intersections.
struct Overlap {
  double total = 0.0;
  std::map<std::int32_t, double> evaluated, reference;
  std::map<std::pair<std::int32_t, std::int32_t>, double> both;

  Overlap(Labels s, Labels r, Weights weight = {}) {
    check_sizes(s, r, weight);
    // Neighbours in the order mostly agree: the maps are looked at once per run of equal pairs.
    for (std::size_t i = 0; i < s.size();) {
      const std::size_t first = i;
      double run = 0.0;
      for (; i < s.size() && s[i] == s[first] && r[i] == r[first]; ++i) run += weight_of(weight, i);
      if (r[first] == kNoLabel) continue;
      total += run;
      evaluated[s[first]] += run;
      reference[r[first]] += run;
      both[{s[first], r[first]}] += run;
    }
  }
};

double pairs_within(double count) {
  return 0.5 * count * (count - 1.0);
}

double pairs_within_all(const auto& sizes) {
  double sum = 0.0;
  for (const auto& [key, count] : sizes) sum += pairs_within(count);
  return sum;
}

double sum_of(const std::map<std::int32_t, double>& values) {
  double sum = 0.0;
  for (const auto& [key, value] : values) sum += value;
  return sum;
}

}  // namespace

double accuracy(Labels evaluated, Labels reference, Weights weight) {
  check_sizes(evaluated, reference, weight);
  double right = 0.0;
  double total = 0.0;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    if (reference[i] == kNoLabel) continue;
    total += weight_of(weight, i);
    if (evaluated[i] == reference[i]) right += weight_of(weight, i);
  }
  return total > 0.0 ? right / total : 0.0;
}

Hamming hamming_distance(Labels evaluated, Labels reference, Weights weight) {
  const Overlap overlap(evaluated, reference, weight);
  if (overlap.total <= 0.0) return {};
  std::map<std::int32_t, double> of_evaluated, of_reference;  // largest intersections
  for (const auto& [pair, size] : overlap.both) {
    of_evaluated[pair.first] = std::max(of_evaluated[pair.first], size);
    of_reference[pair.second] = std::max(of_reference[pair.second], size);
  }
  return {.missing = 1.0 - sum_of(of_reference) / overlap.total,
          .false_alarm = 1.0 - sum_of(of_evaluated) / overlap.total};
}

double rand_error(Labels evaluated, Labels reference) {
  const Overlap overlap(evaluated, reference);
  if (overlap.total < 2.0) return 0.0;
  const double apart = pairs_within_all(overlap.evaluated) + pairs_within_all(overlap.reference) -
                       2.0 * pairs_within_all(overlap.both);
  return apart / pairs_within(overlap.total);
}

ConsistencyError consistency_error(Labels evaluated, Labels reference) {
  const Overlap overlap(evaluated, reference);
  if (overlap.total <= 0.0) return {};
  double forward = 0.0;
  double backward = 0.0;
  double local = 0.0;
  for (const auto& [pair, size] : overlap.both) {
    const double e12 = 1.0 - size / overlap.evaluated.at(pair.first);
    const double e21 = 1.0 - size / overlap.reference.at(pair.second);
    forward += size * e12;
    backward += size * e21;
    local += size * std::min(e12, e21);
  }
  return {.global = std::min(forward, backward) / overlap.total, .local = local / overlap.total};
}

}  // namespace cosegraph::metrics
