#include "tools/evaluation/tables.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <tuple>

#include "tools/evaluation/paper.hpp"
#include "tools/evaluation/plan.hpp"

namespace cosegraph::evaluation {
namespace {

constexpr std::string_view kOverall = "mean of categories";
constexpr std::string_view kPooled = "mean of pairs";

// -- means -------------------------------------------------------------------------------------

// Ids of the clusters of pairs: the same reference and query shape of the same category, whatever
// the view and the seed.
class Clusters {
 public:
  std::int64_t of(const Pair& pair) {
    const auto key = std::tuple(pair.category, pair.reference, pair.query);
    return ids_.try_emplace(key, static_cast<std::int64_t>(ids_.size())).first->second;
  }

 private:
  std::map<std::tuple<int, std::string, std::string>, std::int64_t> ids_;
};

void add(Figures& sum, const Figures& figures, double weight) {
  sum.accuracy += weight * figures.accuracy;
  sum.missing += weight * figures.missing;
  sum.false_alarm += weight * figures.false_alarm;
  sum.rand += weight * figures.rand;
  sum.gce += weight * figures.gce;
  sum.lce += weight * figures.lce;
}

Row row_of(std::string name, std::span<const Pair* const> pairs) {
  Row row{.name = std::move(name), .pairs = static_cast<std::int64_t>(pairs.size())};
  const double weight = 1.0 / static_cast<double>(pairs.size());
  std::vector<double> accuracy;
  std::vector<std::int64_t> cluster;
  Clusters clusters;
  for (const Pair* pair : pairs) {
    accuracy.push_back(pair->figures.accuracy);
    cluster.push_back(clusters.of(*pair));
    add(row.mean, pair->figures, weight);
    row.majority_floor += weight * pair->majority_floor;
    row.oracle += weight * pair->oracle;
    row.unproven += pair->proven_optimal ? 0 : 1;
  }
  row.accuracy = clustered_mean(accuracy, cluster);
  return row;
}

Row overall_of(const std::vector<Row>& rows) {
  Row overall{.name = std::string(kOverall)};
  const double weight = 1.0 / static_cast<double>(rows.size());
  std::vector<Estimate> accuracy;
  double paper = 0.0;
  bool complete = true;
  for (const Row& row : rows) {
    overall.pairs += row.pairs;
    overall.incompatible += row.incompatible;
    overall.failed += row.failed;
    overall.unproven += row.unproven;
    accuracy.push_back(row.accuracy);
    add(overall.mean, row.mean, weight);
    overall.majority_floor += weight * row.majority_floor;
    overall.oracle += weight * row.oracle;
    paper += weight * row.paper.value_or(0.0);
    complete = complete && row.paper.has_value();
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

// -- differences -------------------------------------------------------------------------------

// The names that `name` is one step apart from, on the simpler side.
std::vector<std::string> simpler_than(const std::string& name) {
  if (name == "best") return simpler_than(std::string(pipeline::kBest));
  std::vector<std::string> names;
  const auto replace = [&](std::string_view old, std::string_view by) {
    const std::size_t at = name.find(old);
    if (at == std::string::npos) return;
    std::string other = name;
    names.push_back(other.replace(at, old.size(), by));
  };
  for (std::size_t at = name.find(':'); at != std::string::npos; at = name.find(':', at + 1)) {
    std::string other = name;
    names.push_back(other.erase(at, name.find(':', at + 1) - at));
  }
  if (name.find("+iso*") != std::string::npos) {
    replace("+iso*", "");
    replace("+iso*", "+iso");
  } else {
    replace("+iso", "");
  }
  replace("+fv", "+bow");
  replace("shot+", "fpfh+");
  replace("fused+", "shot+");
  return names;
}

// What makes two pairs of different configurations the same pair.
auto identity_of(const Pair& pair) {
  return std::tie(pair.category, pair.seed, pair.reference, pair.query, pair.view);
}

std::optional<Difference> difference_of(const Report& report, int configuration, int baseline) {
  std::map<decltype(identity_of(report.pairs[0])), double> before;
  for (const Pair& pair : report.pairs)
    if (pair.configuration == baseline) before[identity_of(pair)] = pair.figures.accuracy;
  std::vector<std::vector<double>> gain(report.categories.size());
  std::vector<std::vector<std::int64_t>> cluster(report.categories.size());
  Clusters clusters;
  for (const Pair& pair : report.pairs) {
    if (pair.configuration != configuration) continue;
    const auto at = before.find(identity_of(pair));
    if (at == before.end()) continue;
    const auto c = static_cast<std::size_t>(pair.category);
    gain[c].push_back(pair.figures.accuracy - at->second);
    cluster[c].push_back(clusters.of(pair));
  }
  Difference result{.configuration = report.configurations[static_cast<std::size_t>(configuration)],
                    .baseline = report.configurations[static_cast<std::size_t>(baseline)]};
  double paper = 0.0;
  bool complete = true;
  for (std::size_t c = 0; c < gain.size(); ++c) {
    if (gain[c].empty()) continue;
    const std::string& name = report.categories[c].name;
    result.pairs += static_cast<std::int64_t>(gain[c].size());
    result.names.push_back(name);
    result.categories.push_back(clustered_mean(gain[c], cluster[c]));
    const auto with = paper_accuracy(result.configuration, name);
    const auto without = paper_accuracy(result.baseline, name);
    complete = complete && with && without;
    if (complete) paper += (*with - *without) / 100.0;
  }
  if (result.names.empty()) return std::nullopt;
  result.overall = mean_of(result.categories);
  if (complete) result.paper = paper / static_cast<double>(result.names.size());
  return result;
}

}  // namespace

std::vector<Table> tables_of(const Report& report) {
  std::vector<Table> tables;
  for (std::size_t c = 0; c < report.configurations.size(); ++c)
    if (auto table = table_of(report, c)) tables.push_back(std::move(*table));
  return tables;
}

std::optional<int> best_configuration(const Report& report) {
  std::string best;
  double accuracy = -1.0;
  for (const Table& table : tables_of(report)) {
    if (is_bound(table.configuration) || table.overall.accuracy.mean <= accuracy) continue;
    best = table.configuration;
    accuracy = table.overall.accuracy.mean;
  }
  const auto at = std::ranges::find(report.configurations, best);
  if (at == report.configurations.end()) return std::nullopt;
  return static_cast<int>(at - report.configurations.begin());
}

std::vector<Difference> differences_of(const Report& report) {
  std::vector<Difference> differences;
  for (std::size_t c = 0; c < report.configurations.size(); ++c)
    for (const std::string& simpler : simpler_than(report.configurations[c])) {
      const auto at = std::ranges::find(report.configurations, simpler);
      if (at == report.configurations.end()) continue;
      if (auto difference = difference_of(report, static_cast<int>(c),
                                          static_cast<int>(at - report.configurations.begin())))
        differences.push_back(std::move(*difference));
    }
  return differences;
}

std::vector<TimeRow> times_of(const Report& report) {
  std::vector<TimeRow> rows;
  for (std::size_t c = 0; c < report.configurations.size(); ++c) {
    TimeRow row{.configuration = report.configurations[c]};
    std::int64_t count = 0;
    for (const Pair& pair : report.pairs) {
      if (pair.configuration != static_cast<int>(c)) continue;
      for (std::size_t s = 0; s < kStages.size(); ++s) row.stage_ms[s] += pair.ms[s];
      ++count;
    }
    if (count == 0) continue;
    for (std::size_t s = 0; s < kStages.size(); ++s) {
      row.stage_ms[s] /= static_cast<double>(count);
      const bool learns = kStages[s] == "training" || kStages[s] == "reference";
      const bool segments = kStages[s] == "supervoxels" || kStages[s] == "cpc";
      (learns     ? row.training
       : segments ? row.presegmentation
                  : row.inference) += row.stage_ms[s] / 1000.0;
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace cosegraph::evaluation
