#include "tools/evaluation/report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <map>

#include "tools/evaluation/paper.hpp"
#include "tools/evaluation/tables.hpp"

namespace cosegraph::evaluation {
namespace {

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
  char buffer[256];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(buffer, sizeof buffer, pattern, arguments);
  va_end(arguments);
  return buffer;
}

// -- CSV ---------------------------------------------------------------------------------------

std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string result = "\"";
  for (const char c : text) result += c == '"' ? std::string("\"\"") : std::string(1, c);
  return result + '"';
}

// Empty for NaN.
std::string fraction(double value) {
  return std::isnan(value) ? "" : format("%.6f", value);
}

const char* const kFigureColumns = "accuracy,hamming,hamming_rm,hamming_rf,rand,gce,lce";

std::string figures_csv(const Figures& figures) {
  return format("%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f", figures.accuracy, figures.hamming(),
                figures.missing, figures.false_alarm, figures.rand, figures.gce, figures.lce);
}

std::string csv_line(const Table& table, const Row& row) {
  std::string line = quoted(table.configuration) + ',' + quoted(row.name);
  for (const std::int64_t count : {row.pairs, row.incompatible, row.failed, row.unproven})
    line += ',' + std::to_string(count);
  line += ',' + figures_csv(row.mean) + ',' + fraction(row.accuracy.standard_error);
  line += ',' + fraction(row.majority_floor) + ',' + fraction(row.oracle) + ',';
  if (row.paper) line += format("%.4f", *row.paper);
  return line + '\n';
}

bool is_evaluated(const PaperRow& row, const std::vector<Table>& tables) {
  return std::ranges::find(tables, row.configuration, &Table::configuration) != tables.end();
}

// -- Markdown ----------------------------------------------------------------------------------

std::string percent(double fraction) {
  return std::isnan(fraction) ? "" : format("%.1f", 100.0 * fraction);
}

std::string signed_percent(double fraction) {
  return std::isnan(fraction) ? "" : format("%+.1f", 100.0 * fraction);
}

std::string markdown_line(const std::vector<std::string>& cells) {
  std::string line = "|";
  for (const auto& cell : cells) line += ' ' + cell + " |";
  return line + '\n';
}

// The first column is text, the others are numbers.
std::string markdown_head(const std::vector<std::string>& cells) {
  std::string rule = "| --- |";
  for (std::size_t i = 1; i < cells.size(); ++i) rule += " ---: |";
  return markdown_line(cells) + rule + '\n';
}

std::vector<std::string> joined(std::vector<std::string> first,
                                const std::vector<std::string>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

std::string settings(const Report& report) {
  const Protocol& protocol = report.protocol;
  std::string text = protocol.seeds.size() == 1 ? "Seed" : "Seeds";
  for (const std::uint64_t seed : protocol.seeds) text += ' ' + std::to_string(seed);
  text += protocol.shapes > 0 ? "; the first " + std::to_string(protocol.shapes) : "; all";
  text += " shapes of each of " + std::to_string(report.categories.size()) + " categories; " +
          std::to_string(protocol.query_views) + " query and " +
          std::to_string(protocol.train_views) + " training views per shape.";
  for (const auto& param : protocol.params) text += " " + param + ".";
  if (!report.problems.empty())
    text += " Problems: " + std::to_string(report.problems.size()) + ", see the end of table1.md.";
  if (report.interrupted) text += " Interrupted: only the categories finished until then.";
  return text + "\n\n";
}

// Ours beside the paper's, categories as columns.
std::string beside_paper(const Report& report, const std::vector<Table>& tables) {
  std::vector<std::string> head{"accuracy %"};
  for (const CategoryCounts& category : report.categories) head.push_back(category.name);
  head.emplace_back("mean");
  std::string text =
      "## Table 1\n\nThe mean is that of the columns, for the paper's rows too.\n\n" +
      markdown_head(head);
  const auto ours = [&](const Table& table, const std::string& title) {
    std::map<std::string, std::string> cell;
    for (const Row& row : table.categories) cell[row.name] = percent(row.accuracy.mean);
    std::vector<std::string> cells{title};
    for (const CategoryCounts& category : report.categories) cells.push_back(cell[category.name]);
    cells.push_back("**" + percent(table.overall.accuracy.mean) + "**");
    text += markdown_line(cells);
  };
  const auto papers = [&](const PaperRow& row) {
    std::vector<std::string> cells{std::string(row.title) + ", paper"};
    double sum = 0.0;
    bool any = false;
    for (const CategoryCounts& category : report.categories) {
      const auto accuracy = paper_accuracy(row, category.name);
      any = any || accuracy;
      sum += accuracy.value_or(std::nan(""));
      cells.push_back(accuracy ? format("%.1f", *accuracy) : "");
    }
    const double mean = sum / static_cast<double>(report.categories.size());
    cells.push_back(std::isnan(mean) ? "" : format("%.1f", mean));
    if (any) text += markdown_line(cells);
  };
  for (const PaperRow& row : paper_rows()) {
    papers(row);
    const auto table = std::ranges::find(tables, row.configuration, &Table::configuration);
    if (table != tables.end()) ours(*table, std::string(row.title) + ", ours");
  }
  for (const Table& table : tables)
    if (std::ranges::find(paper_rows(), table.configuration, &PaperRow::configuration) ==
        paper_rows().end())
      ours(table, table.configuration);
  return text + '\n';
}

const std::vector<std::string> kFigures{
    "pairs", "accuracy %", "standard error", "majority floor %", "oracle %", "paper %"};

std::vector<std::string> figures_of_row(const Row& row) {
  return {std::to_string(row.pairs),
          percent(row.accuracy.mean),
          format("%.2f", 100.0 * row.accuracy.standard_error),
          percent(row.majority_floor),
          percent(row.oracle),
          row.paper ? percent(*row.paper) : ""};
}

// Configurations side by side.
std::string comparison(const std::vector<Table>& tables) {
  std::string text =
      "## All categories\n\nMeans of the categories' means, as in the paper. Standard errors are "
      "clustered by (reference, query shape).\n\n";
  text += markdown_head(joined({"configuration"}, joined(kFigures, {"mean of pairs %"})));
  for (const Table& table : tables)
    text +=
        markdown_line(joined({table.configuration}, joined(figures_of_row(table.overall),
                                                           {percent(table.pooled.accuracy.mean)})));
  return text + '\n';
}

std::string paired_differences(const std::vector<Difference>& differences) {
  if (differences.empty()) return {};
  std::string text =
      "## Paired differences\n\nOf the accuracy in points, over the pairs that both have; the "
      "standard error is that of the difference, clustered by (reference, query shape).\n\n";
  text += markdown_head({"configuration", "against", "pairs", "difference", "standard error",
                         "difference / error", "categories better", "paper"});
  for (const Difference& difference : differences) {
    const Estimate& overall = difference.overall;
    const auto better = std::ranges::count_if(difference.categories,
                                              [](const Estimate& e) { return e.mean > 0.0; });
    text += markdown_line(
        {difference.configuration, difference.baseline, std::to_string(difference.pairs),
         format("%+.2f", 100.0 * overall.mean), format("%.2f", 100.0 * overall.standard_error),
         format("%+.1f", overall.mean / overall.standard_error),
         std::to_string(better) + " of " + std::to_string(difference.categories.size()),
         difference.paper ? signed_percent(*difference.paper) : ""});
  }
  return text + '\n';
}

std::string measures(const std::vector<Table>& tables) {
  std::string text =
      "## All measures\n\nErrors in percent, smaller is better (the paper's Fig. 4a; "
      "metrics.png).\n\n";
  text += markdown_head(
      {"configuration", "Hamming", "Rm", "Rf", "1 - Rand", "GCE", "LCE", "1 - accuracy"});
  for (const Table& table : tables) {
    const Figures& mean = table.overall.mean;
    std::vector<std::string> cells{table.configuration};
    for (const double value : {mean.hamming(), mean.missing, mean.false_alarm, mean.rand, mean.gce,
                               mean.lce, 1.0 - mean.accuracy})
      cells.push_back(percent(value));
    text += markdown_line(cells);
  }
  return text + '\n';
}

std::string times(const Report& report) {
  std::string text =
      "## Times\n\nMean seconds per pair of the threads that did the work (the paper's Fig. 4b; "
      "times.png). Training includes all that was done with the reference's views; what several "
      "pairs share is given in full with each. Only one thread on an idle machine gives times "
      "that can be compared.\n\n";
  text += markdown_head({"configuration", "training", "pre-segmentation", "inference"});
  for (const PaperTime& time : paper_times())
    text += markdown_line({std::string(time.title) + ", paper", format("%g", time.training),
                           time.presegmentation ? format("%g", *time.presegmentation) : "",
                           format("%g", time.inference)});
  for (const TimeRow& row : times_of(report))
    text += markdown_line({row.configuration, format("%.3f", row.training),
                           format("%.3f", row.presegmentation), format("%.3f", row.inference)});
  text += "\nMilliseconds per stage:\n\n";
  std::vector<std::string> head{"configuration"};
  for (const auto stage : kStages) head.emplace_back(stage);
  text += markdown_head(head);
  for (const TimeRow& row : times_of(report)) {
    std::vector<std::string> cells{row.configuration};
    for (const double ms : row.stage_ms) cells.push_back(format("%.1f", ms));
    text += markdown_line(cells);
  }
  return text + '\n';
}

std::string details(const Table& table) {
  const std::vector<std::string> counts{"incompatible", "failed", "not proven optimal"};
  const auto line = [](const Row& row) {
    return markdown_line(joined(joined({row.name}, figures_of_row(row)),
                                {std::to_string(row.incompatible), std::to_string(row.failed),
                                 std::to_string(row.unproven)}));
  };
  std::string text = "## " + table.configuration + "\n\n";
  text += markdown_head(joined(joined({"category"}, kFigures), counts));
  for (const Row& row : table.categories) text += line(row);
  return text + line(table.overall) + line(table.pooled) + '\n';
}

std::string left_out(const Report& report) {
  if (report.problems.empty()) return {};
  std::string text = "## Left out: " + std::to_string(report.problems.size()) + "\n\n";
  for (const Problem& problem : report.problems)
    text += "- " + problem.where + ": " + problem.what + '\n';
  return text + '\n';
}

}  // namespace

std::string pairs_csv(const Report& report) {
  std::string text = "configuration,category,reference,query,view,seed," +
                     std::string(kFigureColumns) +
                     ",majority_floor,oracle,segments,expansions,proven_optimal";
  for (const auto stage : kStages) text += ",ms_" + std::string(stage);
  text += '\n';
  for (const Pair& pair : report.pairs) {
    text += quoted(report.configurations[static_cast<std::size_t>(pair.configuration)]) + ',' +
            quoted(report.categories[static_cast<std::size_t>(pair.category)].name) + ',' +
            quoted(pair.reference) + ',' + quoted(pair.query) + ',' + std::to_string(pair.view) +
            ',' + std::to_string(pair.seed) + ',' + figures_csv(pair.figures);
    text += format(",%.6f,%.6f,%zu,%lld,%s", pair.majority_floor, pair.oracle,
                   pair.segment_label.size(), static_cast<long long>(pair.expansions),
                   pair.proven_optimal ? "true" : "false");
    for (const double ms : pair.ms) text += format(",%.3f", ms);
    text += '\n';
  }
  return text;
}

std::string table_csv(const Report& report) {
  std::string text = "configuration,category,pairs,incompatible,failed,not_proven_optimal," +
                     std::string(kFigureColumns) + ",standard_error,majority_floor,oracle,paper\n";
  const std::vector<Table> tables = tables_of(report);
  for (const Table& table : tables) {
    for (const Row& row : table.categories) text += csv_line(table, row);
    text += csv_line(table, table.overall) + csv_line(table, table.pooled);
  }
  for (const PaperRow& row : paper_rows()) {
    if (is_evaluated(row, tables)) continue;
    for (const CategoryCounts& category : report.categories)
      if (const auto accuracy = paper_accuracy(row, category.name))
        text += quoted(std::string(row.title)) + ',' + quoted(category.name) +
                std::string(15, ',') + format("%.4f\n", *accuracy / 100.0);
  }
  return text;
}

std::string differences_csv(const Report& report) {
  std::string text = "configuration,baseline,category,difference,standard_error,paper\n";
  for (const Difference& difference : differences_of(report)) {
    const std::string pair = quoted(difference.configuration) + ',' + quoted(difference.baseline);
    const auto line = [&](const std::string& name, const Estimate& estimate,
                          std::optional<double> paper) {
      text += pair + ',' + quoted(name) + ',' + fraction(estimate.mean) + ',' +
              fraction(estimate.standard_error) + ',' + (paper ? format("%.4f", *paper) : "") +
              '\n';
    };
    for (std::size_t c = 0; c < difference.names.size(); ++c)
      line(difference.names[c], difference.categories[c], std::nullopt);
    line("mean of categories", difference.overall, difference.paper);
  }
  return text;
}

std::string times_csv(const Report& report) {
  std::string text = "configuration,training_s,presegmentation_s,inference_s";
  for (const auto stage : kStages) text += ",ms_" + std::string(stage);
  text += '\n';
  for (const TimeRow& row : times_of(report)) {
    text += quoted(row.configuration) +
            format(",%.6f,%.6f,%.6f", row.training, row.presegmentation, row.inference);
    for (const double ms : row.stage_ms) text += format(",%.3f", ms);
    text += '\n';
  }
  return text;
}

std::string confusion_csv(const Report& report) {
  std::string text = "configuration,category,true_label,given_label,share\n";
  for (const Confusion& confusion : report.confusions) {
    const CategoryCounts& category =
        report.categories[static_cast<std::size_t>(confusion.category)];
    const std::size_t labels = category.label_names.size();
    double pairs = 0.0;
    for (const double share : confusion.fraction) pairs += share;
    for (std::size_t i = 0; pairs > 0.0 && i < confusion.fraction.size(); ++i)
      text += quoted(report.configurations[static_cast<std::size_t>(confusion.configuration)]) +
              ',' + quoted(category.name) + ',' + quoted(category.label_names[i / labels]) + ',' +
              quoted(category.label_names[i % labels]) + ',' +
              fraction(confusion.fraction[i] / pairs) + '\n';
  }
  return text;
}

std::string summary_markdown(const Report& report) {
  const std::vector<Table> tables = tables_of(report);
  std::string text = "# Evaluation on the labelled benchmark\n\n" + settings(report);
  if (tables.empty()) return text;
  return text + beside_paper(report, tables) + comparison(tables) +
         paired_differences(differences_of(report)) + measures(tables) + times(report);
}

std::string table_markdown(const Report& report) {
  std::string text = summary_markdown(report);
  for (const Table& table : tables_of(report)) text += details(table);
  return text + left_out(report);
}

}  // namespace cosegraph::evaluation
