// What a report's pairs say: means, differences and times.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tools/evaluation/evaluation.hpp"
#include "tools/evaluation/statistics.hpp"

namespace cosegraph::evaluation {

// Figures of one configuration over some pairs.
struct Row {
  std::string name;  // category
  std::int64_t pairs = 0;
  std::int64_t incompatible = 0;
  std::int64_t failed = 0;    // compatible, but without a result: see Report::problems
  std::int64_t unproven = 0;  // A* gave up before it had proven its answer
  Estimate accuracy;          // clustered by (reference, query shape)
  Figures mean;
  double majority_floor = 0.0;
  double oracle = 0.0;
  std::optional<double> paper;  // accuracy in Table 1, where it has this configuration
};

struct Table {
  std::string configuration;
  std::vector<Row> categories;  // those with pairs
  Row overall;                  // mean of the categories' means, as in the paper
  Row pooled;                   // mean over all pairs, whatever the category; no paper's figure
};

// One per configuration that has pairs.
std::vector<Table> tables_of(const Report& report);

// The index into Report::configurations of the one with the highest accuracy, bounds (majority,
// oracle) left aside; none without pairs.
std::optional<int> best_configuration(const Report& report);

// Paired difference of two configurations' accuracies, over the pairs that both have.
struct Difference {
  std::string configuration;
  std::string baseline;
  std::int64_t pairs = 0;
  std::vector<std::string> names;    // categories
  std::vector<Estimate> categories;  // clustered by (reference, query shape)
  Estimate overall;                  // mean over the categories
  std::optional<double> paper;       // the same of Table 1
};

// Of every two configurations that are one step apart: an option or the spatial term more, iso* for
// iso, fv for bow, shot for fpfh, fused for shot.
std::vector<Difference> differences_of(const Report& report);

// Mean seconds per pair, in the paper's three kinds (Fig. 4b), and milliseconds per stage.
struct TimeRow {
  std::string configuration;
  double training = 0.0;         // the reference's views and learning from them
  double presegmentation = 0.0;  // supervoxels, cpc
  double inference = 0.0;        // all else done for the query
  std::array<double, kStages.size()> stage_ms{};
};

// One per configuration that has pairs.
std::vector<TimeRow> times_of(const Report& report);

}  // namespace cosegraph::evaluation
