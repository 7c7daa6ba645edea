#include "sink/results.hpp"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace cosegraph::sink {
namespace {

// A value per dense point, carried to the input's points.
std::vector<std::int32_t> on_input(const Cloud& input, const std::vector<std::int32_t>& dense) {
  std::vector<std::int32_t> result;
  for (const std::int32_t d : dense_indices(input, dense.size()))
    result.push_back(d == kNoPoint ? kNoLabel : dense[static_cast<std::size_t>(d)]);
  return result;
}

// `input` with the points that were removed from it as NaN: what a picture of the object shows.
Cloud object_of(const Cloud& input) {
  Cloud object = input;
  for (std::size_t i = 0; i < input.dense_index.size(); ++i)
    if (input.dense_index[i] == kNoPoint) object.xyz[3 * i] = std::nanf("");
  return object;
}

std::string percent(double fraction) {
  char text[16];
  std::snprintf(text, sizeof text, "%.1f %%", 100.0 * fraction);
  return text;
}

using Json = nlohmann::ordered_json;

Json frame_json(const Result& result) {
  Json frame{{"name", result.name},
             {"points", result.points},
             {"labelled_points", result.labelled_points},
             {"segments", result.segments}};
  Json labels = Json::object();
  for (std::size_t l = 0; l < result.label_names.size(); ++l)
    labels[result.label_names[l]] = result.points_per_label[l];
  frame["points_per_label"] = std::move(labels);
  frame["mean_confidence"] = result.mean_confidence;
  frame["energy"] = result.energy;
  frame["proven_optimal"] = result.proven_optimal;
  frame["gap"] = result.gap;
  frame["violations"] = result.violations;
  frame["notes"] = result.notes;
  if (const auto& truth = result.evaluation) {
    frame["accuracy"] = truth->accuracy;
    frame["majority_floor"] = truth->floor;
    frame["oracle"] = truth->oracle;
    frame["unknown_labels"] = truth->unknown;
  }
  return frame;
}

constexpr std::string_view kHead = "{\n  \"frames\": [";
constexpr std::string_view kEndOfFrame = "\n    }";

// As an element of "frames".
std::string text_of(const Json& frame) {
  // Names come from messages and need not be UTF-8: what is not becomes U+FFFD.
  const std::string lines = frame.dump(2, ' ', false, Json::error_handler_t::replace);
  std::string text = "\n    ";
  for (const char letter : lines) {
    text += letter;
    if (letter == '\n') text += "    ";
  }
  return text;
}

// Up to the last frame that is whole.
std::string mended(std::string_view text) {
  const std::size_t end = text.rfind(std::string(kEndOfFrame) + ",");
  if (end != std::string_view::npos)
    return std::string(text.substr(0, end + kEndOfFrame.size())) + "]}";
  return std::string(text.starts_with(kHead) ? kHead : text) + "]}";
}

Json frames_of(std::string_view text) {
  if (text.empty()) return Json::array();
  Json all = Json::parse(text, nullptr, false);
  if (all.is_discarded()) all = Json::parse(mended(text), nullptr, false);
  try {
    Json frames = all.at("frames");
    for (const auto& frame : frames) frame.at("name").get_ref<const std::string&>();
    return frames;
  } catch (const Json::exception& error) {
    throw InputError(std::string("earlier results cannot be read: ") + error.what());
  }
}

}  // namespace

Result result_of(const std::string& name, const Cloud& input, const Segments& segments,
                 const Labelling& labelling) {
  Result result{.name = name,
                .points = static_cast<std::int64_t>(input.size()),
                .segments = segments.count,
                .label_names = labelling.label_names,
                .points_per_label = std::vector<std::int64_t>(labelling.label_names.size()),
                .energy = labelling.energy,
                .proven_optimal = labelling.proven_optimal,
                .gap = labelling.gap,
                .violations = labelling.violations,
                .notes = input.notes,
                .evaluation = evaluate(input, segments, labelling)};
  double confidence = 0.0;
  for (const std::int32_t d : dense_indices(input, labelling.point_label.size())) {
    if (d == kNoPoint || labelling.point_label[d] == kNoLabel) continue;
    ++result.labelled_points;
    ++result.points_per_label[labelling.point_label[d]];
    confidence += labelling.point_confidence[d];
  }
  if (result.labelled_points > 0)
    result.mean_confidence = confidence / static_cast<double>(result.labelled_points);
  return result;
}

ResultsText::ResultsText(std::string_view earlier, std::string_view redone)
    : begun_(kHead), size_(kHead.size()) {
  for (const Json& frame : frames_of(earlier)) {
    const auto& name = frame["name"].get_ref<const std::string&>();
    if (name == redone) continue;
    earlier_.insert(name);
    begun_ += grow(frame);
  }
  begun_ += tail();
}

std::string ResultsText::grow(const Json& frame) {
  const std::string bytes = (count_++ > 0 ? "," : "") + text_of(frame);
  size_ += bytes.size();
  if (frame.contains("accuracy")) {
    accuracy_ += frame["accuracy"].get<double>();
    floor_ += frame["majority_floor"].get<double>();
    oracle_ += frame["oracle"].get<double>();
    ++evaluated_;
  }
  return bytes;
}

ResultsText::Growth ResultsText::add(const Result& result) {
  Growth growth{.at = size_};
  growth.bytes = grow(frame_json(result));
  growth.bytes += tail();
  return growth;
}

std::string ResultsText::tail() const {
  std::string text = count_ > 0 ? "\n  ]" : "]";
  if (evaluated_ > 0) {
    const Json mean{{"frames", evaluated_},
                    {"accuracy", accuracy_ / evaluated_},
                    {"majority_floor", floor_ / evaluated_},
                    {"oracle", oracle_ / evaluated_}};
    text += ",\n  \"mean\": " + mean.dump();
  }
  return text + "\n}\n";
}

std::string picture_of(const PictureOf& frame) {
  const Labelling& labelling = *frame.labelling;
  const auto evaluation = evaluate(*frame.input, *frame.segments, labelling);
  const Cloud object = object_of(*frame.input);
  std::vector<Panel> panels;
  if (frame.reference != nullptr)
    panels.push_back({.title = "reference",
                      .subtitle = "labelled by hand",
                      .cloud = frame.reference,
                      .group = frame.reference->label,
                      .names = frame.reference->label_names});
  panels.push_back({.title = "query",
                    .subtitle = frame.name,
                    .cloud = frame.input,
                    .group = std::vector<std::int32_t>(frame.input->size(), kNoLabel)});
  panels.push_back({.title = "segments",
                    .subtitle = std::to_string(frame.segments->count) + " part candidates",
                    .cloud = &object,
                    .group = on_input(*frame.input, frame.segments->of_point)});
  panels.push_back({.title = "labels",
                    .subtitle = evaluation ? "accuracy " + percent(evaluation->accuracy) : "",
                    .cloud = &object,
                    .group = on_input(*frame.input, labelling.point_label),
                    .names = labelling.label_names});
  if (evaluation)
    panels.push_back({.title = "true labels",
                      .subtitle = "floor " + percent(evaluation->floor) + ", oracle " +
                                  percent(evaluation->oracle),
                      .cloud = &object,
                      .group = frame.input->label,
                      .names = frame.input->label_names});
  return draw_png(panels, {.columns = static_cast<int>(panels.size())});
}

}  // namespace cosegraph::sink
