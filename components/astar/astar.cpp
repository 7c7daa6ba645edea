#include "astar/astar.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace cosegraph::astar {
namespace {

constexpr double kMinProbability = 1e-6;                  // appearance alone never forbids a label
constexpr std::size_t kMostTerms = std::size_t{1} << 24;  // of the energy, pairwise

void check_sizes(const Scores& scores, const Segments& segments) {
  if (scores.label_names.empty()) throw InputError("the scores name no labels");
  if (scores.segment_count != segments.count)
    throw MismatchError("there are scores for " + std::to_string(scores.segment_count) +
                        " segments, but " + std::to_string(segments.count) + " segments");
  const auto count = static_cast<std::size_t>(segments.count);
  if (scores.probability.size() != count * scores.label_names.size())
    throw InputError("the scores are not segments x labels");
  for (std::size_t p = 0; p < segments.of_point.size(); ++p)
    if (segments.of_point[p] < 0 || segments.of_point[p] >= segments.count)
      throw InputError("point " + std::to_string(p) + " is in segment " +
                       std::to_string(segments.of_point[p]) + " of " +
                       std::to_string(segments.count));
  for (const auto& [a, b] : segments.adjacency)
    if (a < 0 || a >= b || b >= segments.count)
      throw InputError("segments " + std::to_string(a) + " and " + std::to_string(b) + " of " +
                       std::to_string(segments.count) + " are named as neighbours");
}

std::string joined(const std::vector<std::string>& names) {
  std::string result;
  for (const auto& name : names) result += (result.empty() ? "" : ", ") + name;
  return result;
}

void check_relations(const Scores& scores, const Spectrum* spectrum,
                     const RelationModel* relations) {
  if (relations == nullptr) throw MismatchError("spatial relations need a relation model");
  if (spectrum == nullptr) throw MismatchError("spatial relations need a spectrum");
  if (relations->spectrum_recipe.empty())
    throw MismatchError("the model was trained without spectra: it has no spatial relations");
  if (relations->spectrum_recipe != spectrum->recipe)
    throw MismatchError("the spectrum was made with '" + spectrum->recipe +
                        "', the model's with '" + relations->spectrum_recipe + "'");
  if (relations->label_names != scores.label_names)
    throw MismatchError("the scores have the labels " + joined(scores.label_names) +
                        ", the relation model has " + joined(relations->label_names));
  const std::size_t labels = relations->label_names.size();
  if (relations->pairs.size() != labels * (labels + 1) / 2 ||
      relations->neighbours.size() != labels * labels)
    throw InputError("the relation model does not have the sizes of its " + std::to_string(labels) +
                     " labels");
}

Energy appearance_energy(const Scores& scores) {
  Energy energy{.nodes = scores.segment_count,
                .states = static_cast<int>(scores.label_names.size())};
  for (const float p : scores.probability) {
    if (std::isnan(p)) throw InputError("a score is not a number");
    energy.unary.push_back(-std::log(std::max(double{p}, kMinProbability)));
  }
  return energy;
}

std::vector<std::vector<std::int32_t>> samples_by_segment(const Spectrum& spectrum,
                                                          const Segments& segments) {
  std::vector<std::vector<std::int32_t>> result(static_cast<std::size_t>(segments.count));
  for (std::size_t s = 0; s < spectrum.sample_dense.size(); ++s) {
    const std::int32_t point = spectrum.sample_dense[s];
    if (point == kNoPoint) continue;
    if (point < 0 || static_cast<std::size_t>(point) >= segments.of_point.size())
      throw MismatchError("the spectrum names point " + std::to_string(point) + " of " +
                          std::to_string(segments.of_point.size()));
    result[static_cast<std::size_t>(segments.of_point[static_cast<std::size_t>(point)])].push_back(
        static_cast<std::int32_t>(s));
  }
  return result;
}

void add_relations(const Spectrum& spectrum, const Segments& segments,
                   const RelationModel& relations, const Params& params, Energy& energy) {
  const auto samples = samples_by_segment(spectrum, segments);
  const double weight =
      params.pairwise_weight /
      (params.pairwise_scale == PairwiseScale::segments ? std::max(energy.nodes, 1) : 1);
  const auto nodes = static_cast<std::size_t>(energy.nodes);
  const auto states = static_cast<std::size_t>(energy.states);
  if (const std::size_t pairs = nodes * (nodes + 1) / 2; pairs > kMostTerms / states / states)
    throw InputError(std::to_string(nodes) + " segments with " + std::to_string(states) +
                     " labels are too many for spatial relations");
  energy.pairwise.assign(nodes * (nodes + 1) / 2 * states * states, 0.0);
  for (std::size_t i = 0; i < nodes; ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const auto posterior = log_pair_posterior(spectrum, samples[i], samples[j], relations,
                                                params.likelihood, params.max_distances);
      double* block = &energy.pairwise[pair_index(i, j) * states * states];
      for (std::size_t p = 0; p < posterior.size(); ++p) block[p] = -weight * posterior[p];
    }
}

// More than any two labellings can differ by.
double outweighing_all(const Energy& energy) {
  double sum = 0.0;
  const auto add_range = [&sum](const double* begin, std::size_t count) {
    const auto [lowest, highest] = std::minmax_element(begin, begin + count);
    sum += *highest - *lowest;
  };
  const auto nodes = static_cast<std::size_t>(energy.nodes);
  const auto states = static_cast<std::size_t>(energy.states);
  for (std::size_t i = 0; i < nodes; ++i) {
    add_range(&energy.unary[i * states], states);
    for (std::size_t j = 0; j < i; ++j)
      add_range(&energy.pairwise[pair_index(i, j) * states * states], states * states);
  }
  return 1.0 + 1.001 * sum;
}

bool is_observed(const RelationModel& relations, std::int32_t a, std::int32_t b) {
  const std::size_t labels = relations.label_names.size();
  return relations.neighbours[static_cast<std::size_t>(a) * labels + static_cast<std::size_t>(b)] !=
         0;
}

void add_penalties(const Segments& segments, const RelationModel& relations, Energy& energy) {
  const double penalty = outweighing_all(energy);
  for (const auto& [i, j] : segments.adjacency)
    for (int a = 0; a < energy.states; ++a)
      for (int b = 0; b < energy.states; ++b)
        if (!is_observed(relations, a, b)) energy.pair(i, j, a, b) += penalty;
}

std::int32_t count_violations(const Segments& segments, const RelationModel& relations,
                              const std::vector<std::int32_t>& label) {
  return static_cast<std::int32_t>(std::ranges::count_if(segments.adjacency, [&](const auto& pair) {
    return !is_observed(relations, label[static_cast<std::size_t>(pair[0])],
                        label[static_cast<std::size_t>(pair[1])]);
  }));
}

// Labels and confidences of segments, carried to points.
void fill_labels(const Scores& scores, const Segments& segments, Labelling& result) {
  const std::size_t labels = scores.label_names.size();
  for (std::size_t i = 0; i < result.segment_label.size(); ++i)
    result.segment_confidence.push_back(
        scores.probability[i * labels + static_cast<std::size_t>(result.segment_label[i])]);
  for (const std::int32_t segment : segments.of_point) {
    result.point_label.push_back(result.segment_label[static_cast<std::size_t>(segment)]);
    result.point_confidence.push_back(result.segment_confidence[static_cast<std::size_t>(segment)]);
  }
}

}  // namespace

Fields describe(Params& params) {
  return {
      choice_field("spatial", params.spatial,
                   "Spatial relations: none (appearance only), iso (with hard neighbourhood "
                   "constraints) or iso* (without them)."),
      choice_field("likelihood", params.likelihood,
                   "How distances between two segments are combined: geomean, or literal as in "
                   "eq. (8)."),
      choice_field("pairwise_scale", params.pairwise_scale,
                   "Pairwise terms as in eq. (1) (none) or divided by the number of segments."),
      number_field("pairwise_weight", params.pairwise_weight, 0.0, 1e3, "",
                   "Weight of the pairwise terms."),
      integer_field("max_distances", params.max_distances, 1, 1'000'000, "",
                    "Distances used per pair of segments."),
      integer_field("max_open", params.max_open, 1, 1 << 30, "",
                    "Nodes on the heap of A* at which the search gives up its proof."),
  };
}

Labelling infer(const Scores& scores, const Segments& segments, const Spectrum* spectrum,
                const RelationModel* relations, const Params& params) {
  check_sizes(scores, segments);
  Energy energy = appearance_energy(scores);
  const bool spatial = params.spatial != Spatial::none;
  if (spatial) {
    check_relations(scores, spectrum, relations);
    add_relations(*spectrum, segments, *relations, params, energy);
  }
  Energy constrained = energy;
  if (params.spatial == Spatial::iso) add_penalties(segments, *relations, constrained);
  Solution solution = minimise(constrained, params.max_open);

  Labelling result;
  result.label_names = scores.label_names;
  result.majority = scores.majority;
  result.energy = energy.value(solution.state);
  result.proven_optimal = solution.proven_optimal;
  result.gap = solution.gap;
  result.expansions = solution.expansions;
  result.segment_label = std::move(solution.state);
  if (spatial) result.violations = count_violations(segments, *relations, result.segment_label);
  fill_labels(scores, segments, result);
  return result;
}

}  // namespace cosegraph::astar

template <>
cosegraph::Names<cosegraph::astar::Spatial> cosegraph::names<cosegraph::astar::Spatial>() {
  using enum cosegraph::astar::Spatial;
  static constexpr std::pair<cosegraph::astar::Spatial, std::string_view> table[] = {
      {none, "none"},
      {iso, "iso"},
      {iso_free, "iso*"},
  };
  return table;
}

template <>
cosegraph::Names<cosegraph::astar::PairwiseScale>
cosegraph::names<cosegraph::astar::PairwiseScale>() {
  using enum cosegraph::astar::PairwiseScale;
  static constexpr std::pair<cosegraph::astar::PairwiseScale, std::string_view> table[] = {
      {none, "none"},
      {segments, "segments"},
  };
  return table;
}
