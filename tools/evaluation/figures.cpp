#include "tools/evaluation/figures.hpp"

#include <algorithm>

#include "metrics/metrics.hpp"

namespace cosegraph::evaluation {

std::vector<std::int32_t> positions(const std::vector<std::string>& some,
                                    const std::vector<std::string>& names) {
  std::vector<std::int32_t> result;
  for (const auto& name : some) {
    const auto at = std::ranges::find(names, name);
    if (at == names.end()) throw InputError("the label '" + name + "' is not among the names");
    result.push_back(static_cast<std::int32_t>(at - names.begin()));
  }
  return result;
}

Comparison compare(const Cloud& input, const Labelling& labelling,
                   const std::vector<std::string>& names) {
  const auto of_truth = positions(input.label_names, names);
  const auto of_given = positions(labelling.label_names, names);
  Comparison result;
  for (std::size_t i = 0; i < input.label.size(); ++i) {
    const std::int32_t point = input.dense_index[i];
    if (point == kNoPoint || input.label[i] == kNoLabel) continue;
    const std::int32_t given = labelling.point_label.at(static_cast<std::size_t>(point));
    result.truth.push_back(of_truth[static_cast<std::size_t>(input.label[i])]);
    result.given.push_back(of_given.at(static_cast<std::size_t>(given)));
  }
  if (result.truth.empty()) throw InputError("no point has both a true label and a segment");
  return result;
}

Figures figures_of(const Comparison& comparison) {
  const auto& [truth, given] = comparison;
  const auto hamming = metrics::hamming_distance(given, truth);
  const auto consistency = metrics::consistency_error(given, truth);
  return {.accuracy = metrics::accuracy(given, truth),
          .missing = hamming.missing,
          .false_alarm = hamming.false_alarm,
          .rand = metrics::rand_error(given, truth),
          .gce = consistency.global,
          .lce = consistency.local};
}

void add_to(std::vector<double>& fraction, const Comparison& comparison, std::size_t names) {
  fraction.resize(names * names);
  std::vector<std::int64_t> count(names * names);
  for (std::size_t i = 0; i < comparison.truth.size(); ++i)
    ++count[static_cast<std::size_t>(comparison.truth[i]) * names +
            static_cast<std::size_t>(comparison.given[i])];
  for (std::size_t i = 0; i < count.size(); ++i)
    fraction[i] += static_cast<double>(count[i]) / static_cast<double>(comparison.truth.size());
}

}  // namespace cosegraph::evaluation
