#include "tools/evaluation/report.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <map>
#include <span>

#include "tools/evaluation/paper.hpp"

namespace cosegraph::evaluation {
namespace {

constexpr std::string_view kOverall = "mean of categories";
constexpr std::string_view kPooled = "mean of pairs";

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
  char buffer[256];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(buffer, sizeof buffer, pattern, arguments);
  va_end(arguments);
  return buffer;
}

// -- figures -----------------------------------------------------------------------------------

// Ids of the clusters of pairs: the same reference and query shape of the same category.
class Clusters {
 public:
  std::int64_t of(const Pair& pair) {
    const auto key = std::tuple(pair.category, pair.reference, pair.query);
    return ids_.try_emplace(key, static_cast<std::int64_t>(ids_.size())).first->second;
  }

 private:
  std::map<std::tuple<int, std::string, std::string>, std::int64_t> ids_;
};

Row row_of(std::string name, std::span<const Pair* const> pairs) {
  Row row{.name = std::move(name), .pairs = static_cast<std::int64_t>(pairs.size())};
  std::vector<double> accuracy;
  std::vector<std::int64_t> cluster;
  Clusters clusters;
  for (const Pair* pair : pairs) {
    accuracy.push_back(pair->accuracy);
    cluster.push_back(clusters.of(*pair));
    row.majority_floor += pair->majority_floor;
    row.oracle += pair->oracle;
    row.unproven += pair->proven_optimal ? 0 : 1;
  }
  row.accuracy = clustered_mean(accuracy, cluster);
  row.majority_floor /= static_cast<double>(pairs.size());
  row.oracle /= static_cast<double>(pairs.size());
  return row;
}

// The counts of `rows` added up.
Row sum_of(std::string_view name, const std::vector<Row>& rows) {
  Row sum{.name = std::string(name)};
  for (const Row& row : rows) {
    sum.pairs += row.pairs;
    sum.incompatible += row.incompatible;
    sum.failed += row.failed;
    sum.unproven += row.unproven;
  }
  return sum;
}

Row overall_of(const std::vector<Row>& rows) {
  Row overall = sum_of(kOverall, rows);
  std::vector<Estimate> accuracy;
  double paper = 0.0;
  bool complete = true;
  const auto n = static_cast<double>(rows.size());
  for (const Row& row : rows) {
    accuracy.push_back(row.accuracy);
    overall.majority_floor += row.majority_floor / n;
    overall.oracle += row.oracle / n;
    complete = complete && row.paper.has_value();
    paper += row.paper.value_or(0.0) / n;
  }
  overall.accuracy = mean_of(accuracy);
  if (complete) overall.paper = paper;
  return overall;
}

std::optional<Table> table_of(const Report& report, std::size_t configuration) {
  Table table{.configuration = report.configurations[configuration]};
  std::vector<std::vector<const Pair*>> by_category(report.categories.size());
  std::vector<const Pair*> all;
  for (const Pair& pair : report.pairs) {
    if (pair.configuration != static_cast<int>(configuration)) continue;
    by_category[static_cast<std::size_t>(pair.category)].push_back(&pair);
    all.push_back(&pair);
  }
  if (all.empty()) return std::nullopt;
  for (std::size_t c = 0; c < by_category.size(); ++c) {
    if (by_category[c].empty()) continue;
    const CategoryCounts& counts = report.categories[c];
    Row row = row_of(counts.name, by_category[c]);
    row.incompatible = counts.incompatible;
    row.failed = counts.compatible - row.pairs;
    if (const auto percent = paper_accuracy(table.configuration, counts.name))
      row.paper = *percent / 100.0;
    table.categories.push_back(std::move(row));
  }
  table.overall = overall_of(table.categories);
  table.pooled = row_of(std::string(kPooled), all);
  table.pooled.incompatible = table.overall.incompatible;
  table.pooled.failed = table.overall.failed;
  return table;
}

// -- CSV ---------------------------------------------------------------------------------------

std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string result = "\"";
  for (const char c : text) result += c == '"' ? std::string("\"\"") : std::string(1, c);
  return result + '"';
}

std::string csv_line(const Table& table, const Row& row) {
  std::string line = quoted(table.configuration) + ',' + quoted(row.name);
  for (const std::int64_t count : {row.pairs, row.incompatible, row.failed, row.unproven})
    line += ',' + std::to_string(count);
  line += format(",%.6f,", row.accuracy.mean);
  if (!std::isnan(row.accuracy.standard_error)) line += format("%.6f", row.accuracy.standard_error);
  line += format(",%.6f,%.6f,", row.majority_floor, row.oracle);
  if (row.paper) line += format("%.4f", *row.paper);
  return line + '\n';
}

// -- Markdown ----------------------------------------------------------------------------------

std::string percent(double fraction) {
  return std::isnan(fraction) ? "" : format("%.1f", 100.0 * fraction);
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

const std::vector<std::string> kFigures{
    "pairs", "accuracy %", "standard error", "majority floor %", "oracle %", "paper %"};

std::vector<std::string> figures_of(const Row& row) {
  return {std::to_string(row.pairs),
          percent(row.accuracy.mean),
          percent(row.accuracy.standard_error),
          percent(row.majority_floor),
          percent(row.oracle),
          row.paper ? percent(*row.paper) : ""};
}

std::vector<std::string> joined(std::vector<std::string> first,
                                const std::vector<std::string>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

std::string settings(const Report& report) {
  const Protocol& protocol = report.protocol;
  std::string text = "Seed " + std::to_string(protocol.seed) + "; ";
  text += protocol.shapes > 0 ? "the first " + std::to_string(protocol.shapes) : "all";
  text += " shapes of each of " + std::to_string(report.categories.size()) + " categories; " +
          std::to_string(protocol.query_views) + " query and " +
          std::to_string(protocol.train_views) + " training views per shape.";
  for (const auto& param : protocol.params) text += " " + param + ".";
  if (report.interrupted) text += " Interrupted: only the categories finished until then.";
  return text + "\n\n";
}

// Configurations side by side.
std::string comparison(const std::vector<Table>& tables) {
  std::string text = "## All categories\n\nMeans of the categories' means, as in the paper.\n\n";
  text += markdown_head(joined({"configuration"}, joined(kFigures, {"mean of pairs %"})));
  for (const Table& table : tables)
    text +=
        markdown_line(joined({table.configuration}, joined(figures_of(table.overall),
                                                           {percent(table.pooled.accuracy.mean)})));
  return text + '\n';
}

std::string details(const Table& table) {
  const std::vector<std::string> counts{"incompatible", "failed", "not proven optimal"};
  const auto line = [](const Row& row) {
    return markdown_line(joined(joined({row.name}, figures_of(row)),
                                {std::to_string(row.incompatible), std::to_string(row.failed),
                                 std::to_string(row.unproven)}));
  };
  std::string text = "## " + table.configuration + "\n\n";
  text += markdown_head(joined(joined({"category"}, kFigures), counts));
  for (const Row& row : table.categories) text += line(row);
  return text + line(table.overall) + line(table.pooled) + '\n';
}

std::string times(const Report& report) {
  std::string text =
      "## Milliseconds\n\nMeans over pairs of each stage's wall time in its thread; "
      "training without the features of its views.\n\n";
  std::vector<std::string> head{"configuration"};
  for (const auto stage : kStages) head.emplace_back(stage);
  text += markdown_head(head);
  for (std::size_t c = 0; c < report.configurations.size(); ++c) {
    std::array<double, kStages.size()> sum{};
    std::int64_t count = 0;
    for (const Pair& pair : report.pairs) {
      if (pair.configuration != static_cast<int>(c)) continue;
      for (std::size_t s = 0; s < kStages.size(); ++s) sum[s] += pair.ms[s];
      ++count;
    }
    if (count == 0) continue;
    std::vector<std::string> cells{report.configurations[c]};
    for (const double ms : sum) cells.push_back(format("%.1f", ms / static_cast<double>(count)));
    text += markdown_line(cells);
  }
  return text + '\n';
}

std::string left_out(const Report& report) {
  if (report.problems.empty()) return {};
  std::string text = "## Left out: " + std::to_string(report.problems.size()) + "\n\n";
  for (const Problem& problem : report.problems)
    text += "- " + problem.where + ": " + problem.what + '\n';
  return text + '\n';
}

}  // namespace

std::vector<Table> tables_of(const Report& report) {
  std::vector<Table> tables;
  for (std::size_t c = 0; c < report.configurations.size(); ++c)
    if (auto table = table_of(report, c)) tables.push_back(std::move(*table));
  return tables;
}

std::string pairs_csv(const Report& report) {
  std::string text =
      "configuration,category,reference,query,view,seed,accuracy,majority_floor,oracle,segments,"
      "expansions,proven_optimal";
  for (const auto stage : kStages) text += ",ms_" + std::string(stage);
  text += '\n';
  for (const Pair& pair : report.pairs) {
    text += quoted(report.configurations[static_cast<std::size_t>(pair.configuration)]) + ',' +
            quoted(report.categories[static_cast<std::size_t>(pair.category)].name) + ',' +
            quoted(pair.reference) + ',' + quoted(pair.query) + ',' + std::to_string(pair.view) +
            ',' + std::to_string(report.protocol.seed);
    text += format(",%.6f,%.6f,%.6f,%d,%lld,%s", pair.accuracy, pair.majority_floor, pair.oracle,
                   pair.segments, static_cast<long long>(pair.expansions),
                   pair.proven_optimal ? "true" : "false");
    for (const double ms : pair.ms) text += format(",%.3f", ms);
    text += '\n';
  }
  return text;
}

std::string table_csv(const Report& report) {
  std::string text =
      "configuration,category,pairs,incompatible,failed,not_proven_optimal,accuracy,"
      "standard_error,majority_floor,oracle,paper\n";
  for (const Table& table : tables_of(report)) {
    for (const Row& row : table.categories) text += csv_line(table, row);
    text += csv_line(table, table.overall) + csv_line(table, table.pooled);
  }
  return text;
}

std::string table_markdown(const Report& report) {
  const std::vector<Table> tables = tables_of(report);
  std::string text = "# Evaluation on the labelled benchmark\n\n" + settings(report);
  text += comparison(tables);
  for (const Table& table : tables) text += details(table);
  return text + times(report) + left_out(report);
}

}  // namespace cosegraph::evaluation
