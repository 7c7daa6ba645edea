#include "tools/evaluation/report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <sstream>

#include "pipeline/pipeline.hpp"
#include "tools/evaluation/paper.hpp"
#include "tools/evaluation/tables.hpp"

namespace cosegraph::evaluation {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Pair pair_of(int configuration, int category, const std::string& reference,
             const std::string& query, int view, double accuracy) {
  return {.configuration = configuration,
          .category = category,
          .seed = 42,
          .reference = reference,
          .query = query,
          .view = view,
          .figures = {.accuracy = accuracy,
                      .missing = 0.1,
                      .false_alarm = 0.3,
                      .rand = 0.25,
                      .gce = 0.05,
                      .lce = 0.04},
          .majority_floor = 0.5,
          .oracle = 0.9,
          .expansions = 7,
          .proven_optimal = true,
          .segment_label = {0, 1, 1, 0},
          .ms = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10}};
}

Report small_report() {
  Report report{.protocol = {.seeds = {42}},
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
  EXPECT_EQ(
      lines[0],
      "configuration,category,reference,query,view,seed,accuracy,hamming,hamming_rm,hamming_rf,"
      "rand,gce,lce,majority_floor,oracle,segments,expansions,proven_optimal,ms_source,"
      "ms_descriptors,ms_spectra,ms_supervoxels,ms_cpc,ms_fisher,ms_svm,ms_astar,"
      "ms_training,ms_reference");
  EXPECT_EQ(lines[2],
            "fpfh+fv,Ant,1,2,1,42,0.800000,0.200000,0.100000,0.300000,0.250000,0.050000,0.040000,"
            "0.500000,0.900000,4,7,true,1.000,2.000,3.000,4.000,5.000,6.000,7.000,8.000,9.000,"
            "10.000");
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
            "fpfh+fv,Ant,4,1,1,1,0.700000,0.200000,0.100000,0.300000,0.250000,0.050000,0.040000,"
            "0.000000,0.500000,0.900000,0.7770");
  EXPECT_EQ(lines_of(table_csv(report)).size(),
            5U + 10U * 2U);  // ten rows of the paper are not ours
  const std::string text = table_markdown(report);
  EXPECT_THAT(text, HasSubstr("| Cup | 2 | 95.0 | 5.00 | 50.0 | 90.0 | 88.7 | 3 | 0 | 0 |"));
  EXPECT_THAT(text, HasSubstr("| fpfh+fv | 6 | 82.5 | 2.50 | 50.0 | 90.0 | 83.2 | 78.3 |"));
  EXPECT_THAT(text, HasSubstr("| FPFH+FV, paper | 77.7 | 88.7 | 83.2 |"));
  EXPECT_THAT(text, HasSubstr("| FPFH+FV, ours | 70.0 | 95.0 | **82.5** |"));
  EXPECT_THAT(text, HasSubstr("| van Kaick et al. 2011, paper | 58.8 | 81.6 | 70.2 |"));
  EXPECT_THAT(text, HasSubstr("| fpfh+fv | 20.0 | 10.0 | 30.0 | 25.0 | 5.0 | 4.0 | 17.5 |"));
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

TEST(Report, DifferencesArePairedAndBetweenNeighbouringConfigurations) {
  Report report = small_report();
  report.configurations = {"fpfh+fv", "fpfh+fv+iso", "majority"};
  // Ant: gains .1 and .1 of one shape pair, -.1 and 0 of the other. Cup: .05 and -.25.
  const std::vector<double> gains{0.1, 0.1, -0.1, 0.0, 0.05, -0.25};
  for (std::size_t p = 0; p < gains.size(); ++p) {
    Pair pair = report.pairs[p];
    pair.configuration = 1;
    pair.figures.accuracy += gains[p];
    report.pairs.push_back(pair);
  }
  report.pairs.push_back(pair_of(1, 0, "1", "2", 7, 0.3));  // the other one has no such pair
  const auto differences = differences_of(report);
  ASSERT_EQ(differences.size(), 1U);
  const Difference& difference = differences[0];
  EXPECT_EQ(difference.configuration, "fpfh+fv+iso");
  EXPECT_EQ(difference.baseline, "fpfh+fv");
  EXPECT_EQ(difference.pairs, 6);
  ASSERT_EQ(difference.categories.size(), 2U);
  EXPECT_NEAR(difference.categories[0].mean, 0.025, 1e-12);
  // Two clusters with sums of errors .15 and -.15: 2 * 2 * .15^2 / 4^2.
  EXPECT_NEAR(difference.categories[0].standard_error, 0.075, 1e-12);
  EXPECT_NEAR(difference.categories[1].mean, -0.1, 1e-12);
  EXPECT_NEAR(difference.overall.mean, -0.0375, 1e-12);
  EXPECT_NEAR(difference.paper.value(), (74.1 - 77.7 + 87.5 - 88.7) / 200.0, 1e-12);
  EXPECT_THAT(summary_markdown(report), HasSubstr("| fpfh+fv+iso | fpfh+fv | 6 | -3.75 |"));
  EXPECT_THAT(differences_csv(report), HasSubstr("fpfh+fv+iso,fpfh+fv,Ant,0.025000,0.075000,"));
}

TEST(Report, NeighboursOfAConfigurationAreOneStepSimpler) {
  Report report = small_report();
  const auto baselines = [&](const std::string& name, std::vector<std::string> others) {
    report.configurations = std::move(others);
    report.configurations.insert(report.configurations.begin(), name);
    const std::vector<Pair> first = small_report().pairs;
    report.pairs.clear();
    for (std::size_t c = 0; c < report.configurations.size(); ++c)
      for (Pair pair : first) {
        pair.configuration = static_cast<int>(c);
        report.pairs.push_back(pair);
      }
    std::vector<std::string> found;
    for (const Difference& difference : differences_of(report))
      if (difference.configuration == name) found.push_back(difference.baseline);
    return found;
  };
  using ::testing::ElementsAre;
  EXPECT_THAT(baselines("fpfh+fv:cpc:l2", {"fpfh+fv:cpc", "fpfh+fv:l2", "fpfh+fv"}),
              ElementsAre("fpfh+fv:l2", "fpfh+fv:cpc"));
  EXPECT_THAT(baselines("shot+bow+iso*", {"shot+bow", "shot+bow+iso", "fpfh+bow+iso*"}),
              ElementsAre("shot+bow", "shot+bow+iso", "fpfh+bow+iso*"));
  EXPECT_THAT(baselines("best", {"fused+fv", "shot+fv+iso", "fpfh+fv"}),
              ElementsAre("fused+fv", "shot+fv+iso"));
  EXPECT_THAT(baselines("fused+fv", {"shot+fv", "fused+bow"}), ElementsAre("fused+bow", "shot+fv"));
}

TEST(Report, TheBestConfigurationIsNoBound) {
  Report report = small_report();
  report.configurations = {"fpfh+fv", "oracle", "shot+fv"};
  for (const int c : {1, 2})
    for (Pair pair : small_report().pairs) {
      pair.configuration = c;
      pair.figures.accuracy += c == 1 ? 0.05 : 0.02;
      report.pairs.push_back(pair);
    }
  EXPECT_EQ(best_configuration(report), 2);
  EXPECT_EQ(best_configuration(Report{.configurations = {"fpfh+fv"}}), std::nullopt);
}

TEST(Report, TimesAreAddedUpInThePapersKinds) {
  const auto times = times_of(small_report());
  ASSERT_EQ(times.size(), 1U);
  EXPECT_NEAR(times[0].training, 0.019, 1e-12);
  EXPECT_NEAR(times[0].presegmentation, 0.009, 1e-12);
  EXPECT_NEAR(times[0].inference, 0.027, 1e-12);
  EXPECT_EQ(lines_of(times_csv(small_report()))[1].substr(0, 34),
            "fpfh+fv,0.019000,0.009000,0.027000");
}

TEST(Report, ConfusionsAreSharesOfThePoints) {
  Report report = small_report();
  report.categories[0].label_names = {"head", "leg"};
  report.confusions = {{.configuration = 0, .category = 0, .fraction = {1.0, 0.5, 0.0, 0.5}}};
  const auto lines = lines_of(confusion_csv(report));
  ASSERT_EQ(lines.size(), 5U);
  EXPECT_EQ(lines[2], "fpfh+fv,Ant,head,leg,0.250000");
}

TEST(Paper, EveryRowOfTheMethodIsAConfigurationOfOurs) {
  EXPECT_EQ(paper_rows().size(), 11U);
  for (const PaperRow& row : paper_rows()) {
    if (row.configuration.empty()) continue;
    EXPECT_NO_THROW(pipeline::config_from_name(row.configuration)) << row.title;
  }
  EXPECT_EQ(paper_accuracy("shot+fv", "Vase"), 72.8);
  EXPECT_EQ(paper_accuracy("shot+fv", "Lamp"), std::nullopt);
  EXPECT_EQ(paper_accuracy("best", "Vase"), std::nullopt);
}

}  // namespace
}  // namespace cosegraph::evaluation
