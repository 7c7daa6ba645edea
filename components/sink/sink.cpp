#include "sink/sink.hpp"

#include <algorithm>
#include <map>
#include <string>

namespace cosegraph::sink {
namespace {

using Colour = std::array<float, 3>;

constexpr Colour kGrey = {0.65F, 0.65F, 0.65F};  // points without a label

// Chosen so that any two differ by at least 24 in CIELAB for normal, protanopic and deuteranopic
// eyes (the first seven by 32), and by 16 for tritanopic ones.
constexpr std::array<std::uint32_t, 12> kPalette = {0x2579DD, 0xBF7600, 0xF42D92, 0x58C9FD,
                                                    0x0B4B3B, 0xE6E639, 0x3E00BB, 0x5EFDAF,
                                                    0x930000, 0xB7D9E3, 0x81ED73, 0xA5935A};

Colour mixed(const Colour& colour, float target, float amount) {
  Colour result;
  for (std::size_t c = 0; c < 3; ++c) result[c] = colour[c] + amount * (target - colour[c]);
  return result;
}

// Position of each of `names` in `among`; kNoLabel where it is missing.
std::vector<std::int32_t> positions(const std::vector<std::string>& names,
                                    const std::vector<std::string>& among) {
  std::vector<std::int32_t> result;
  for (const auto& name : names) {
    const auto found = std::ranges::find(among, name);
    result.push_back(found == among.end() ? kNoLabel
                                          : static_cast<std::int32_t>(found - among.begin()));
  }
  return result;
}

}  // namespace

std::vector<std::int32_t> dense_indices(const Cloud& input, std::size_t dense_size) {
  std::vector<std::int32_t> result = input.dense_index;
  if (result.empty())
    for (std::size_t i = 0; i < input.size(); ++i) result.push_back(static_cast<std::int32_t>(i));
  if (result.size() != input.size())
    throw InputError("the input has " + std::to_string(input.size()) + " points but " +
                     std::to_string(result.size()) + " dense indices");
  for (std::size_t i = 0; i < result.size(); ++i)
    if (result[i] != kNoPoint &&
        (result[i] < 0 || static_cast<std::size_t>(result[i]) >= dense_size))
      throw MismatchError("point " + std::to_string(i) + " of the input stands for point " +
                          std::to_string(result[i]) + " of " + std::to_string(dense_size) +
                          " labelled ones");
  return result;
}

Labelled to_input(const Cloud& input, const Labelling& labelling) {
  const auto dense = dense_indices(input, labelling.point_label.size());
  Labelled result{.cloud = input};
  result.cloud.label_names = labelling.label_names;
  result.cloud.label.clear();
  result.cloud.rgb.clear();
  for (const std::int32_t point : dense) {
    const auto at = static_cast<std::size_t>(point);
    const std::int32_t label = point == kNoPoint ? kNoLabel : labelling.point_label[at];
    const Colour colour = palette(label);
    result.cloud.label.push_back(label);
    result.cloud.rgb.insert(result.cloud.rgb.end(), colour.begin(), colour.end());
    result.confidence.push_back(label == kNoLabel ? 0.0F : labelling.point_confidence.at(at));
  }
  return result;
}

std::optional<Evaluation> evaluate(const Cloud& input, const Segments& segments,
                                   const Labelling& labelling) {
  if (input.label.empty()) return std::nullopt;
  if (segments.of_point.size() != labelling.point_label.size())
    throw MismatchError("segments and labelling are of different clouds: " +
                        std::to_string(segments.of_point.size()) + " and " +
                        std::to_string(labelling.point_label.size()) + " points");
  const auto dense = dense_indices(input, labelling.point_label.size());
  const auto in_model = positions(input.label_names, labelling.label_names);
  std::map<std::int32_t, std::map<std::int32_t, std::int64_t>> count;  // [segment][true label]
  std::vector<bool> missing(input.label_names.size(), false);
  Evaluation result;
  std::int64_t right = 0;
  std::int64_t of_majority = 0;
  for (std::size_t i = 0; i < dense.size(); ++i) {
    if (dense[i] == kNoPoint || input.label[i] == kNoLabel) continue;
    const auto point = static_cast<std::size_t>(dense[i]);
    const auto truth = static_cast<std::size_t>(input.label[i]);
    ++result.points;
    ++count[segments.of_point[point]][input.label[i]];
    if (in_model[truth] == kNoLabel)
      missing[truth] = true;
    else if (in_model[truth] == labelling.point_label[point])
      ++right;
    if (in_model[truth] != kNoLabel && in_model[truth] == labelling.majority) ++of_majority;
  }
  if (result.points == 0) return std::nullopt;
  std::int64_t best = 0;
  for (const auto& [segment, of_label] : count) {
    std::int64_t most = 0;
    for (const auto& [label, points] : of_label) most = std::max(most, points);
    best += most;
  }
  result.accuracy = static_cast<double>(right) / static_cast<double>(result.points);
  result.floor = static_cast<double>(of_majority) / static_cast<double>(result.points);
  result.oracle = static_cast<double>(best) / static_cast<double>(result.points);
  for (std::size_t l = 0; l < missing.size(); ++l)
    if (missing[l]) result.unknown.push_back(input.label_names[l]);
  return result;
}

std::array<float, 3> palette(std::int32_t label) {
  if (label < 0) return kGrey;
  const std::uint32_t code = kPalette[static_cast<std::size_t>(label) % kPalette.size()];
  const Colour colour = {static_cast<float>(code >> 16) / 255.0F,
                         static_cast<float>(code >> 8 & 0xFF) / 255.0F,
                         static_cast<float>(code & 0xFF) / 255.0F};
  switch (static_cast<std::size_t>(label) / kPalette.size() % 3) {
    case 1:
      return mixed(colour, 0.0F, 0.4F);
    case 2:
      return mixed(colour, 1.0F, 0.5F);
    default:
      return colour;
  }
}

}  // namespace cosegraph::sink
