// Figures as pictures: PNG bytes, the same for the same chart.
//
// White ground, dark text, colours of the same family as sink::draw_png. Pictures are at most
// 2200 pixels wide unless what they show does not fit. Text that is too long for its place ends
// in "..."; it never overlaps. The fonts know ASCII only.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace cosegraph::evaluation {

struct Series {
  std::string name;
  std::vector<double> values;  // per group; NaN: no bar
  std::vector<double> errors;  // standard errors, drawn as whiskers; empty or NaN: none
};

// Bars in groups, one colour per series with a legend, the value written over each bar.
struct BarChart {
  std::string title;
  std::string subtitle;
  std::string unit;          // on the value axis: "%", "s"
  bool logarithmic = false;  // values must then be positive; the axis starts at a decade
  std::vector<std::string> groups;
  std::vector<Series> series;  // the colours of the first 24 differ
};

// Throws ParameterError, naming the series, for numbers that do not fit the groups or the axis.
std::string draw_bars(const BarChart& chart);

// A confusion matrix: fraction[t * names.size() + p] of all points have true label t and are
// labelled p (sum 1, or all 0).
struct ConfusionMatrix {
  std::string title;
  std::string subtitle;
  std::vector<std::string> names;  // rows: true; columns: labelled
  std::vector<double> fraction;
};

// Side by side, wrapped into rows of at most `columns`. A cell's shade is its share of its row (the
// true label), its percentage is written in it; beside each row stands the row's share of all
// points. Throws ParameterError, naming the matrix, for fractions that are none or do not fit the
// names.
std::string draw_confusions(std::span<const ConfusionMatrix> matrices, int columns = 4);

}  // namespace cosegraph::evaluation
