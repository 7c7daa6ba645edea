// The figures of labelled frames, and their picture.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/values.hpp"
#include "sink/sink.hpp"

namespace cosegraph::sink {

struct Result {
  std::string name;
  std::int64_t points = 0;  // of the input
  std::int64_t labelled_points = 0;
  std::int32_t segments = 0;
  std::vector<std::string> label_names;
  std::vector<std::int64_t> points_per_label;
  double mean_confidence = 0.0;  // over labelled points
  double energy = 0.0;
  bool proven_optimal = false;
  double gap = 0.0;
  std::int32_t violations = 0;
  std::vector<std::string> notes;        // of the input cloud
  std::optional<Evaluation> evaluation;  // where the input carries true labels
};

Result result_of(const std::string& name, const Cloud& input, const Segments& segments,
                 const Labelling& labelling);

// {"frames": [...], "mean": {...}} with figures in 0 .. 1; the mean is over evaluated frames.
// `earlier` is such a text, or empty: its frames come first, those of a name in `results` left out.
// Throws InputError if it is something else.
std::string results_json(std::span<const Result> results, std::string_view earlier = "");

struct PictureOf {
  std::string name;
  const Cloud* input = nullptr;
  const Segments* segments = nullptr;
  const Labelling* labelling = nullptr;
  const Cloud* reference = nullptr;  // labelled cloud, shown first; null: none
};

// PNG bytes: reference, query, segments, labels, and the true labels where they are known.
std::string picture_of(const PictureOf& frame);

}  // namespace cosegraph::sink
