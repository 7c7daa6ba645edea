#include "tools/evaluation/pictures.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <limits>

#include "sink/sink.hpp"
#include "tools/evaluation/charts.hpp"
#include "tools/evaluation/paper.hpp"
#include "tools/evaluation/plan.hpp"
#include "tools/evaluation/subject.hpp"
#include "tools/evaluation/tables.hpp"

namespace cosegraph::evaluation {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::string percent(double fraction) {
  char text[16];
  std::snprintf(text, sizeof text, "%.1f %%", 100.0 * fraction);
  return text;
}

std::string pairs_in_words(const Report& report) {
  std::int64_t compatible = 0;
  for (const CategoryCounts& category : report.categories) compatible += category.compatible;
  return std::to_string(report.categories.size()) + " categories, " + std::to_string(compatible) +
         " pairs";
}

// -- gallery -----------------------------------------------------------------------------------

constexpr std::array<const char*, 3> kRanks{"best", "median", "worst"};

// Best, median and worst of the category's pairs by the configuration; none if it has no pairs.
std::vector<const Pair*> chosen_pairs(const Report& report, int configuration, int category) {
  std::vector<const Pair*> pairs;
  for (const Pair& pair : report.pairs)
    if (pair.configuration == configuration && pair.category == category) pairs.push_back(&pair);
  if (pairs.empty()) return {};
  std::ranges::stable_sort(pairs, std::greater{},
                           [](const Pair* pair) { return pair->figures.accuracy; });
  return {pairs.front(), pairs[pairs.size() / 2], pairs.back()};
}

// What a configuration does before any learning: enough to show its labels.
Entry without_learning(Entry entry) {
  entry.descriptors.clear();
  entry.spectra.clear();
  return entry;
}

// One view of a shape as it was evaluated.
ViewParts parts_of(const Protocol& protocol, const Entry& entry, const std::string& category,
                   const std::string& shape, std::uint64_t seed, int view) {
  const Shape files{.name = shape,
                    .mesh = mesh_file(protocol.data, category, shape),
                    .labels = labels_file(protocol.data, category, shape)};
  Subject subject(files, "", category, seed, protocol);
  Store nothing("");
  subject.open(nothing);
  if (static_cast<std::size_t>(view) >= subject.views.size())
    throw InputError(subject.where(static_cast<std::size_t>(view)) + ": cannot be seen any more");
  subject.make(static_cast<std::size_t>(view), std::span(&entry, 1), nothing);
  return std::move(subject.views[static_cast<std::size_t>(view)]);
}

class Gallery {
 public:
  Gallery(const Report& report, int configuration)
      : report_(report),
        entry_(without_learning(
            entries_of(report.protocol)[static_cast<std::size_t>(configuration)])) {}

  void add(const Pair& pair, const std::string& rank) {
    const CategoryCounts& category = report_.categories[static_cast<std::size_t>(pair.category)];
    const Cloud& reference = seen(pair, pair.reference, 0).frames.at(entry_.source).value->input;
    const ViewParts& parts = seen(pair, pair.query, pair.view);
    const Cloud& query = parts.frames.at(entry_.source).value->input;
    const Segments& segments = *parts.segments.at(entry_.segments).value;
    add_panel(category, category.name, "reference " + pair.reference, reference,
              true_labels(category, reference));
    add_panel(category, rank + ", " + percent(pair.figures.accuracy),
              "shape " + pair.query + ", true labels", query, true_labels(category, query));
    add_panel(category, "", "labelled by " + entry_.name, query,
              given_labels(pair, query, segments));
  }

  std::string png() const {
    return sink::draw_png(panels_, {.columns = 9, .panel_width = 210, .legend = false});
  }

 private:
  const ViewParts& seen(const Pair& pair, const std::string& shape, int view) {
    const auto& category = report_.categories[static_cast<std::size_t>(pair.category)].name;
    return parts_.emplace_back(
        parts_of(report_.protocol, entry_, category, shape, pair.seed, view));
  }

  // A label's colour is its place among the category's labels.
  void add_panel(const CategoryCounts& category, std::string title, std::string subtitle,
                 const Cloud& cloud, std::vector<std::int32_t> group) {
    sink::Panel panel{.title = std::move(title),
                      .subtitle = std::move(subtitle),
                      .cloud = &cloud,
                      .group = std::move(group)};
    for (std::size_t l = 0; l < category.label_names.size(); ++l)
      panel.names.push_back(std::to_string(l));
    panels_.push_back(std::move(panel));
  }

  static std::vector<std::int32_t> true_labels(const CategoryCounts& category, const Cloud& cloud) {
    const auto place = positions(cloud.label_names, category.label_names);
    std::vector<std::int32_t> group;
    for (const std::int32_t label : cloud.label)
      group.push_back(label == kNoLabel ? kNoLabel : place[static_cast<std::size_t>(label)]);
    return group;
  }

  static std::vector<std::int32_t> given_labels(const Pair& pair, const Cloud& cloud,
                                                const Segments& segments) {
    std::vector<std::int32_t> group;
    for (const std::int32_t point : cloud.dense_index)
      group.push_back(point == kNoPoint ? kNoLabel
                                        : pair.segment_label.at(static_cast<std::size_t>(
                                              segments.of_point[static_cast<std::size_t>(point)])));
    return group;
  }

  const Report& report_;
  Entry entry_;
  std::deque<ViewParts> parts_;  // stay where they are: the panels point into them
  std::vector<sink::Panel> panels_;
};

}  // namespace

std::string metrics_png(const Report& report) {
  BarChart chart{.title = "Segmentation errors",
                 .subtitle = "Means over " + pairs_in_words(report) +
                             "; smaller is better. Whiskers: standard error of the accuracy.",
                 .unit = "%",
                 .groups = {"Hamming", "1 - Rand", "GCE", "LCE", "1 - accuracy"}};
  for (const Table& table : tables_of(report)) {
    const Figures& mean = table.overall.mean;
    chart.series.push_back(
        {.name = table.configuration,
         .values = {100.0 * mean.hamming(), 100.0 * mean.rand, 100.0 * mean.gce, 100.0 * mean.lce,
                    100.0 * (1.0 - mean.accuracy)},
         .errors = {kNone, kNone, kNone, kNone, 100.0 * table.overall.accuracy.standard_error}});
  }
  return draw_bars(chart);
}

std::string times_png(const Report& report) {
  BarChart chart{.title = "Time per pair",
                 .subtitle = "Of the threads that did the work, means over " +
                             pairs_in_words(report) + "; the paper's on its authors' laptop.",
                 .unit = "s",
                 .logarithmic = true,
                 .groups = {"training", "pre-segmentation", "inference"}};
  for (const PaperTime& time : paper_times())
    chart.series.push_back(
        {.name = std::string(time.title) + ", paper",
         .values = {time.training, time.presegmentation.value_or(kNone), time.inference}});
  for (const TimeRow& row : times_of(report)) {
    if (is_bound(row.configuration)) continue;
    chart.series.push_back(
        {.name = row.configuration, .values = {row.training, row.presegmentation, row.inference}});
  }
  return draw_bars(chart);
}

std::string confusion_png(const Report& report, int configuration) {
  std::vector<ConfusionMatrix> matrices;
  for (const Confusion& confusion : report.confusions) {
    if (confusion.configuration != configuration) continue;
    const auto& category = report.categories[static_cast<std::size_t>(confusion.category)];
    double pairs = 0.0;
    for (const double share : confusion.fraction) pairs += share;
    if (pairs <= 0.0) continue;
    double accuracy = 0.0;
    ConfusionMatrix matrix{.title = category.name, .names = category.label_names};
    for (std::size_t i = 0; i < confusion.fraction.size(); ++i) {
      matrix.fraction.push_back(confusion.fraction[i] / pairs);
      if (i % (matrix.names.size() + 1) == 0) accuracy += matrix.fraction.back();
    }
    matrix.subtitle = report.configurations[static_cast<std::size_t>(configuration)] + ", " +
                      percent(accuracy) + " right";
    matrices.push_back(std::move(matrix));
  }
  return draw_confusions(matrices);
}

std::string gallery_png(const Report& report, int configuration) {
  Gallery gallery(report, configuration);
  for (int category = 0; category < static_cast<int>(report.categories.size()); ++category) {
    const auto pairs = chosen_pairs(report, configuration, category);
    for (std::size_t i = 0; i < pairs.size(); ++i) gallery.add(*pairs[i], kRanks[i]);
  }
  return gallery.png();
}

}  // namespace cosegraph::evaluation
