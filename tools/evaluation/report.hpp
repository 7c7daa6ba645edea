// A report as tables. Figures are fractions in the CSV texts and percents in the Markdown text.
#pragma once

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

// One line per pair, in the report's order, after a line of column names.
std::string pairs_csv(const Report& report);

// One line per configuration and row of its table; "mean of categories" and "mean of pairs" last.
std::string table_csv(const Report& report);

// Settings, all tables, milliseconds per stage, and what was left out.
std::string table_markdown(const Report& report);

}  // namespace cosegraph::evaluation
