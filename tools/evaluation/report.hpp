// A report as texts. Figures are fractions in the CSV texts and percents in the Markdown texts.
#pragma once

#include <string>

#include "tools/evaluation/evaluation.hpp"

namespace cosegraph::evaluation {

// One line per pair, in the report's order, after a line of column names.
std::string pairs_csv(const Report& report);

// One line per configuration and category, then "mean of categories" and "mean of pairs"; the
// paper's rows that were not evaluated have the paper's figure only.
std::string table_csv(const Report& report);

// Paired differences: one line per two configurations and category, then "mean of categories".
std::string differences_csv(const Report& report);

// Seconds per kind and milliseconds per stage, one line per configuration.
std::string times_csv(const Report& report);

// One line per configuration, category, true label and given label: mean share of the points.
std::string confusion_csv(const Report& report);

// Settings; ours beside Table 1; configurations, differences, other measures, times.
std::string summary_markdown(const Report& report);

// The summary, then every configuration by category, and what was left out.
std::string table_markdown(const Report& report);

}  // namespace cosegraph::evaluation
