#include "tools/evaluation/report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <sstream>

#include "pipeline/pipeline.hpp"
#include "tools/evaluation/paper.hpp"

namespace cosegraph::evaluation {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Pair pair_of(int configuration, int category, const std::string& reference,
             const std::string& query, int view, double accuracy) {
  return {.configuration = configuration,
          .category = category,
          .reference = reference,
          .query = query,
          .view = view,
          .accuracy = accuracy,
          .majority_floor = 0.5,
          .oracle = 0.9,
          .segments = 4,
          .expansions = 7,
          .proven_optimal = true,
          .ms = {1, 2, 3, 4, 5, 6, 7, 8, 9}};
}

Report small_report() {
  Report report{.protocol = {.seed = 42},
                .configurations = {"fpfh+fv", "shot+fv"},
                .categories = {{.name = "Ant", .compatible = 5, .incompatible = 1},
                               {.name = "Cup", .compatible = 2, .incompatible = 3}}};
  report.pairs = {pair_of(0, 0, "1", "2", 0, 0.6), pair_of(0, 0, "1", "2", 1, 0.8),
                  pair_of(0, 0, "2", "1", 0, 0.7), pair_of(0, 0, "2", "1", 1, 0.7),
                  pair_of(0, 1, "5", "6", 0, 0.9), pair_of(0, 1, "6", "5", 0, 1.0)};
  report.pairs[3].proven_optimal = false;
  return report;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

TEST(Report, OverallIsTheMeanOfCategoriesAndPooledThatOfPairs) {
  const std::vector<Table> tables = tables_of(small_report());
  ASSERT_EQ(tables.size(), 1U);  // shot+fv has no pairs
  const Table& table = tables[0];
  ASSERT_EQ(table.categories.size(), 2U);
  EXPECT_NEAR(table.categories[0].accuracy.mean, 0.70, 1e-12);
  EXPECT_NEAR(table.categories[1].accuracy.mean, 0.95, 1e-12);
  EXPECT_NEAR(table.overall.accuracy.mean, 0.825, 1e-12);
  EXPECT_NEAR(table.pooled.accuracy.mean, 4.7 / 6.0, 1e-12);
  EXPECT_EQ(table.overall.pairs, 6);
  EXPECT_EQ(table.categories[0].failed, 1);
  EXPECT_EQ(table.overall.incompatible, 4);
  EXPECT_EQ(table.overall.unproven, 1);
}

TEST(Report, ViewsOfOneReferenceAndQueryAreOneCluster) {
  // Ant: two clusters, both with mean 0.7. Cup: clusters of one, 0.9 and 1.0.
  const Table table = tables_of(small_report())[0];
  EXPECT_NEAR(table.categories[0].accuracy.standard_error, 0.0, 1e-12);
  EXPECT_NEAR(table.categories[1].accuracy.standard_error, 0.05, 1e-12);
  EXPECT_NEAR(table.overall.accuracy.standard_error, 0.025, 1e-12);
}

TEST(Report, ThePapersFigureIsTheMeanOverTheSameCategories) {
  const Table table = tables_of(small_report())[0];
  EXPECT_NEAR(table.categories[0].paper.value(), 0.777, 1e-12);
  EXPECT_NEAR(table.categories[1].paper.value(), 0.887, 1e-12);
  EXPECT_NEAR(table.overall.paper.value(), (0.777 + 0.887) / 2, 1e-12);
  Report other = small_report();
  other.categories[1].name = "Lamp";
  EXPECT_FALSE(tables_of(other)[0].overall.paper.has_value());
}

TEST(Report, PairsAreOneLineEachWithTheNamedColumns) {
  const std::vector<std::string> lines = lines_of(pairs_csv(small_report()));
  ASSERT_EQ(lines.size(), 7U);
  EXPECT_EQ(lines[0],
            "configuration,category,reference,query,view,seed,accuracy,majority_floor,oracle,"
            "segments,expansions,proven_optimal,ms_source,ms_descriptors,ms_spectra,"
            "ms_supervoxels,ms_cpc,ms_fisher,ms_svm,ms_astar,ms_training");
  EXPECT_EQ(lines[2],
            "fpfh+fv,Ant,1,2,1,42,0.800000,0.500000,0.900000,4,7,true,1.000,2.000,3.000,4.000,"
            "5.000,6.000,7.000,8.000,9.000");
}

TEST(Report, NamesWithCommasAndQuotesAreQuoted) {
  Report report = small_report();
  report.categories[1].name = "Cup, \"small\"";
  EXPECT_THAT(pairs_csv(report), HasSubstr("fpfh+fv,\"Cup, \"\"small\"\"\",5,6,0"));
}

TEST(Report, TableTextsHoldEveryRowAndWhatWasLeftOut) {
  Report report = small_report();
  report.problems = {{"Ant/3", "a mesh without the labels 3_labels.txt"}};
  EXPECT_EQ(lines_of(table_csv(report))[1],
            "fpfh+fv,Ant,4,1,1,1,0.700000,0.000000,0.500000,0.900000,0.7770");
  EXPECT_EQ(lines_of(table_csv(report)).size(), 5U);
  const std::string text = table_markdown(report);
  EXPECT_THAT(text, HasSubstr("| Cup | 2 | 95.0 | 5.0 | 50.0 | 90.0 | 88.7 | 3 | 0 | 0 |"));
  EXPECT_THAT(text, HasSubstr("| fpfh+fv | 6 | 82.5 | 2.5 | 50.0 | 90.0 | 83.2 | 78.3 |"));
  EXPECT_THAT(text, HasSubstr("## Left out: 1\n\n- Ant/3: a mesh without the labels"));
  EXPECT_THAT(text, Not(HasSubstr("Interrupted")));
}

TEST(Report, WithoutPairsThereAreHeadsOnly) {
  const Report empty{.configurations = {"fpfh+fv"}, .interrupted = true};
  EXPECT_TRUE(tables_of(empty).empty());
  EXPECT_EQ(lines_of(pairs_csv(empty)).size(), 1U);
  EXPECT_EQ(lines_of(table_csv(empty)).size(), 1U);
  EXPECT_THAT(table_markdown(empty), HasSubstr("Interrupted"));
}

TEST(Paper, EveryRowsCategoriesAverageToItsOverallFigure) {
  for (const PaperRow& row : paper_rows()) {
    const double sum = std::accumulate(row.accuracy.begin(), row.accuracy.end(), 0.0);
    EXPECT_NEAR(sum / 19.0, row.overall, 0.1) << row.title;
  }
}

TEST(Paper, EveryRowIsAConfigurationOfOurs) {
  for (const PaperRow& row : paper_rows())
    EXPECT_NO_THROW(pipeline::config_from_name(row.configuration)) << row.title;
  EXPECT_EQ(paper_accuracy("shot+fv", "Vase"), 72.8);
  EXPECT_EQ(paper_accuracy("shot+fv", "Lamp"), std::nullopt);
  EXPECT_EQ(paper_accuracy("best", "Vase"), std::nullopt);
}

}  // namespace
}  // namespace cosegraph::evaluation
