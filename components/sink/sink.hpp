// What a user gets: labels on the input's own points, figures against true labels, a picture.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/values.hpp"

namespace cosegraph::sink {

// The labelling carried to the input's points through input.dense_index: `label` (kNoLabel where
// the point was removed) replaces the input's labels, colours become the labels' colours.
struct Labelled {
  Cloud cloud;
  std::vector<float> confidence;  // per point, 0 where there is no label
};
Labelled to_input(const Cloud& input, const Labelling& labelling);

// Per point of `input` the point of a dense cloud of `dense_size` points that stands for it;
// kNoPoint where it was removed. Throws MismatchError if input.dense_index does not fit.
std::vector<std::int32_t> dense_indices(const Cloud& input, std::size_t dense_size);

// Compares labels by name over the points that have a true label and were not removed.
struct Evaluation {
  std::int64_t points = 0;
  double accuracy = 0.0;
  double floor = 0.0;   // all points given labelling.majority, the reference's most frequent label
  double oracle = 0.0;  // each segment given its most frequent true label
  std::vector<std::string> unknown;  // true labels that the model lacks
};
std::optional<Evaluation> evaluate(const Cloud& input, const Segments& segments,
                                   const Labelling& labelling);

// The colour of label i out of the fixed, colour-blind-safe palette, in [0, 1].
std::array<float, 3> palette(std::int32_t label);

// One panel of a picture: points seen from the sensor, coloured.
struct Panel {
  std::string title;
  std::string subtitle;
  const Cloud* cloud = nullptr;
  std::vector<std::int32_t> group;  // per point of `cloud`; kNoLabel: grey
  std::vector<std::string> names;   // legend; empty: groups are coloured without a legend
};

struct Layout {
  int columns = 4;        // at most, then a new row begins
  int panel_width = 480;  // of a panel's image, in pixels; its height is five sixths of that
  bool legend = true;
};

// PNG bytes: panels in rows, each fitted to its frame, with titles and one legend for all named
// groups (same name, same colour).
std::string draw_png(std::span<const Panel> panels, const Layout& layout = {});

}  // namespace cosegraph::sink
