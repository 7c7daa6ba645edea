#include "tools/evaluation/paper.hpp"

#include <algorithm>

namespace cosegraph::evaluation {
namespace {

constexpr PaperRow kRows[] = {
    {"",
     "van Kaick et al. 2011",
     {58.8, 62.7, 35.2, 43.2, 58.1, 43.5, 59.6, 81.6, 84.2, 60.1, 78.1, 52.2, 41.3, 81.3, 82.0,
      33.7, 71.6, 71.9, 64.3},
     61.2},
    {"",
     "Kalogerakis et al. 2010",
     {58.9, 62.0, 35.6, 43.4, 57.0, 43.2, 59.6, 81.8, 84.4, 59.4, 78.6, 52.7, 41.6, 81.7, 82.8,
      32.5, 70.9, 71.1, 65.5},
     61.2},
    {"shot+bow",
     "SHOT+BoW",
     {66.2, 59.2, 42.2, 52.1, 57.4, 43.8, 60.6, 90.0, 72.1, 51.1, 75.4, 53.4, 35.8, 82.4, 76.5,
      70.5, 88.9, 64.5, 70.6},
     63.8},
    {"fpfh+bow",
     "FPFH+BoW",
     {69.9, 57.5, 48.9, 55.7, 55.3, 40.8, 54.5, 88.9, 75.9, 51.6, 60.7, 54.1, 38.0, 80.2, 66.0,
      69.5, 84.1, 72.5, 69.2},
     62.8},
    {"shot+bow+iso",
     "SHOT+BoW+ISO",
     {65.6, 57.0, 39.9, 50.5, 52.0, 43.6, 56.7, 87.6, 71.7, 48.1, 75.5, 46.8, 34.2, 84.4, 75.0,
      57.3, 87.5, 69.4, 65.3},
     61.5},
    {"shot+bow+iso*",
     "SHOT+BoW+ISO*",
     {63.9, 58.8, 41.2, 52.1, 53.4, 44.0, 57.4, 89.6, 73.2, 48.3, 74.0, 49.7, 37.0, 84.3, 76.8,
      70.5, 86.5, 68.1, 69.4},
     63.0},
    {"fpfh+fv",
     "FPFH+FV",
     {77.7, 64.0, 54.9, 52.2, 58.5, 44.6, 60.2, 88.7, 78.4, 54.9, 74.1, 56.0, 43.7, 84.1, 69.6,
      71.9, 85.4, 76.4, 70.3},
     66.6},
    {"fpfh+fv:cpc",
     "FPFH+FV (CPC)",
     {77.2, 60.4, 43.8, 49.4, 57.8, 40.6, 58.2, 90.9, 77.9, 50.3, 69.2, 56.2, 41.2, 85.8, 71.3,
      70.8, 85.5, 75.3, 68.9},
     64.8},
    {"fpfh+fv:l2",
     "FPFH+FV (L2)",
     {74.6, 63.3, 52.2, 54.5, 57.2, 44.8, 60.3, 88.2, 77.8, 54.2, 73.8, 56.0, 41.6, 82.3, 68.2,
      68.2, 85.7, 76.4, 66.2},
     65.6},
    {"shot+fv",
     "SHOT+FV",
     {72.1, 64.7, 52.5, 57.6, 60.3, 42.5, 64.1, 90.4, 79.0, 59.0, 75.6, 56.0, 45.7, 79.0, 79.9,
      71.8, 87.9, 76.5, 72.8},
     67.8},
    {"fpfh+fv+iso",
     "FPFH+FV+ISO",
     {74.1, 60.0, 51.5, 51.2, 53.6, 45.0, 55.5, 87.5, 77.7, 50.6, 73.4, 49.6, 40.4, 84.6, 69.8,
      58.8, 84.1, 77.0, 63.8},
     63.6},
};

constexpr PaperTime kTimes[] = {{"van Kaick et al. 2011", 766.1, std::nullopt, 290.15},
                                {"FPFH+FV", 581.0, 34.2, 16.1}};

}  // namespace

std::span<const PaperRow> paper_rows() {
  return kRows;
}

std::optional<double> paper_accuracy(const PaperRow& row, std::string_view category) {
  const auto column = std::ranges::find(kPaperCategories, category);
  if (column == kPaperCategories.end()) return std::nullopt;
  return row.accuracy[static_cast<std::size_t>(column - kPaperCategories.begin())];
}

std::optional<double> paper_accuracy(std::string_view configuration, std::string_view category) {
  const auto row = std::ranges::find(kRows, configuration, &PaperRow::configuration);
  if (configuration.empty() || row == std::end(kRows)) return std::nullopt;
  return paper_accuracy(*row, category);
}

std::span<const PaperTime> paper_times() {
  return kTimes;
}

}  // namespace cosegraph::evaluation
