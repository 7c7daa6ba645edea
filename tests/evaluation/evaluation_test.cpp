#include "tools/evaluation/evaluation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <set>

#include "core/error.hpp"
#include "evaluation/world.hpp"
#include "tools/evaluation/report.hpp"

namespace cosegraph::evaluation {
namespace {

using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Protocol quick_protocol(const std::filesystem::path& data) {
  Protocol protocol{.data = data, .query_views = 2, .train_views = 3, .seed = 3, .jobs = 1};
  protocol.camera.pitch = 0.01;
  protocol.camera.directions = 24;
  return protocol;
}

// Everything of a pair but its times.
std::string text_of(Report report) {
  for (Pair& pair : report.pairs) pair.ms = {};
  return pairs_csv(report);
}

std::string message_of(const Protocol& protocol) {
  try {
    evaluate(protocol);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

// One benchmark, evaluated once, for the tests that only look at the outcome.
class WholeRun : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    test::write_benchmark(folder_->path());
    report_ = new Report(evaluate(quick_protocol(folder_->path())));
  }
  static void TearDownTestSuite() {
    delete report_;
    delete folder_;
  }
  static TemporaryFolder* folder_;
  static Report* report_;
};

TemporaryFolder* WholeRun::folder_ = nullptr;
Report* WholeRun::report_ = nullptr;

TEST_F(WholeRun, EveryCompatiblePairIsEvaluatedOnce) {
  EXPECT_TRUE(report_->problems.empty());
  ASSERT_EQ(report_->categories.size(), 2U);
  EXPECT_EQ(report_->categories[0].name, "Dumbbell");
  EXPECT_EQ(report_->categories[0].compatible, 4 * 2);
  EXPECT_EQ(report_->categories[0].incompatible, 2 * 2);
  EXPECT_EQ(report_->categories[1].compatible, 6 * 2);
  EXPECT_EQ(report_->categories[1].incompatible, 0);
  EXPECT_EQ(report_->pairs.size(), 20U);
  std::set<std::tuple<int, std::string, std::string, int>> seen;
  for (const Pair& pair : report_->pairs)
    seen.emplace(pair.category, pair.reference, pair.query, pair.view);
  EXPECT_EQ(seen.size(), report_->pairs.size());
}

TEST_F(WholeRun, NoShapeIsPairedWithItsOwnViewsOrWithAReferenceThatLacksAPart) {
  for (const Pair& pair : report_->pairs) {
    EXPECT_NE(pair.reference, pair.query);
    EXPECT_NE(pair.query, "9");
  }
}

TEST_F(WholeRun, AccuracyLiesBetweenZeroAndTheOracleAndAboveTheFloorInTheMean) {
  for (const Pair& pair : report_->pairs) {
    EXPECT_GE(pair.accuracy, 0.0);
    EXPECT_LE(pair.accuracy, pair.oracle + 1e-12);
    EXPECT_LE(pair.oracle, 1.0);
    EXPECT_GT(pair.majority_floor, 0.0);
    EXPECT_GE(pair.segments, 1);
    EXPECT_TRUE(pair.proven_optimal);
  }
  for (const Row& row : tables_of(*report_)[0].categories) {
    EXPECT_GT(row.accuracy.mean, row.majority_floor) << row.name;
    EXPECT_GT(row.accuracy.mean, 0.8) << row.name;
  }
}

TEST_F(WholeRun, StagesThatRanHaveTimesAndSpectraThatDidNotHaveNone) {
  for (const Pair& pair : report_->pairs)
    for (std::size_t s = 0; s < kStages.size(); ++s)
      EXPECT_EQ(pair.ms[s] > 0.0, kStages[s] != "spectra") << kStages[s];
}

TEST_F(WholeRun, TwoThreadsGiveTheSameFiguresAsOne) {
  Protocol protocol = quick_protocol(folder_->path());
  protocol.jobs = 2;
  EXPECT_EQ(text_of(evaluate(protocol)), text_of(*report_));
}

TEST_F(WholeRun, OtherCategoriesAndConfigurationsDoNotChangeAFigure) {
  Protocol protocol = quick_protocol(folder_->path());
  protocol.categories = {"Lollipop"};
  protocol.configurations = {"fpfh+fv+iso", "fpfh+fv"};
  const Report report = evaluate(protocol);
  std::vector<double> alone;
  std::vector<double> among_others;
  for (const Pair& pair : report.pairs)
    if (pair.configuration == 1) among_others.push_back(pair.accuracy);
  for (const Pair& pair : report_->pairs)
    if (pair.category == 1) alone.push_back(pair.accuracy);
  EXPECT_EQ(alone, among_others);
  EXPECT_TRUE(std::ranges::all_of(report.pairs, [](const Pair& pair) {
    return (pair.ms[2] > 0.0) == (pair.configuration == 0);
  }));
}

TEST_F(WholeRun, StoppingKeepsTheFinishedCategoriesOnly) {
  std::atomic<bool> stop = false;
  const Progress progress{.stopped = [&] { return stop.load(); },
                          .step =
                              [&](const Status& status) {
                                if (status.categories_done == 1) stop = true;
                              }};
  const Report report = evaluate(quick_protocol(folder_->path()), progress);
  EXPECT_TRUE(report.interrupted);
  ASSERT_EQ(report.categories.size(), 1U);
  EXPECT_EQ(report.pairs.size(), 8U);
}

TEST(Evaluation, BadShapesAreReportedAndLeftOutAndTheRunGoesOn) {
  const TemporaryFolder folder;
  const auto category = folder.path() / "Lollipop";
  test::write_shape(category, "1", test::lollipop(0.5));
  test::write_shape(category, "2", test::lollipop(0.6));
  test::write_shape(category, "3", test::lollipop(0.5));
  test::write_text(category / "3_labels.txt", "head\n1 2 3\n");  // most faces without a label
  test::write_shape(category, "4", test::lollipop(0.5));
  std::filesystem::remove(category / "4_labels.txt");
  // A ball hidden in a ball: no view shows it.
  Mesh hidden{.label_names = {"head", "stick"}};
  test::add_sphere(hidden, 0, 1.0, 0.0);
  test::add_sphere(hidden, 1, 0.2, 0.0);
  test::write_shape(category, "5", hidden);
  std::filesystem::create_directories(folder.path() / "Nothing");

  Protocol protocol = quick_protocol(folder.path());
  std::vector<std::string> done;
  const Report report =
      evaluate(protocol, {.category_done = [&](const Report& so_far, const Status&) {
                 done.push_back(so_far.categories.back().name);
               }});
  EXPECT_THAT(done, ElementsAre("Lollipop", "Nothing"));
  EXPECT_EQ(report.pairs.size(), 4U);
  std::vector<std::string> where;
  for (const Problem& problem : report.problems) where.push_back(problem.where);
  EXPECT_THAT(where, ElementsAre("Lollipop/4", "Nothing", "Lollipop/3", "Lollipop/5", "Nothing"));
  EXPECT_THAT(report.problems[2].what, HasSubstr("3_labels.txt"));
  EXPECT_THAT(report.problems[3].what, HasSubstr("no view shows enough of every part"));
}

TEST(Evaluation, AReferenceThatCannotBeTrainedIsReportedWithItsPairsCountedAsFailed) {
  const TemporaryFolder folder;
  const auto category = folder.path() / "Ball";
  for (const std::string name : {"1", "2"}) {
    Mesh ball{.label_names = {"ball"}};
    test::add_sphere(ball, 0, 0.5, 0.0);
    test::write_shape(category, name, ball);
  }
  test::write_benchmark(folder.path());
  Protocol protocol = quick_protocol(folder.path());
  protocol.categories = {"Ball", "Lollipop"};
  protocol.shapes = 2;
  const Report report = evaluate(protocol);
  EXPECT_EQ(report.categories[0].compatible, 4);
  ASSERT_EQ(report.problems.size(), 2U);
  EXPECT_EQ(report.problems[0].where, "Ball/1");
  EXPECT_THAT(report.problems[0].what, HasSubstr("as the reference, fpfh+fv: "));
  EXPECT_EQ(report.pairs.size(), 4U);
  EXPECT_EQ(tables_of(report)[0].categories.size(), 1U);
}

TEST(Evaluation, NothingToEvaluateIsAnErrorThatSaysWhy) {
  const TemporaryFolder folder;
  test::write_shape(folder.path() / "Lollipop", "1", test::lollipop(0.5));
  EXPECT_THAT(message_of(quick_protocol(folder.path())),
              testing::AllOf(HasSubstr("nothing could be evaluated"),
                             HasSubstr("Lollipop: no two shapes make a compatible pair")));
}

TEST(Evaluation, AProtocolThatMakesNoSenseIsRefusedBeforeAnyWork) {
  const TemporaryFolder folder;
  test::write_benchmark(folder.path());
  const auto with = [&](const std::function<void(Protocol&)>& change) {
    Protocol protocol = quick_protocol(folder.path());
    change(protocol);
    EXPECT_THROW(evaluate(protocol), ParameterError);
    return message_of(protocol);
  };
  EXPECT_THAT(with([](Protocol& p) { p.configurations = {"fphf+fv"}; }),
              HasSubstr("did you mean 'fpfh'?"));
  EXPECT_THAT(with([](Protocol& p) { p.categories = {"Lolipop"}; }),
              HasSubstr("did you mean 'Lollipop'?"));
  EXPECT_THAT(with([](Protocol& p) {
                p.configurations = {"fpfh+fv", "fpfh+fv"};
              }),
              HasSubstr("twice"));
  EXPECT_THAT(with([](Protocol& p) { p.params = {"cpc.min_cut_scor=0.2"}; }),
              HasSubstr("did you mean 'cpc.min_cut_score'?"));
  EXPECT_THAT(with([](Protocol& p) { p.params = {"fisher.seed=2"}; }), HasSubstr("fisher.seed"));
  EXPECT_THAT(with([](Protocol& p) { p.params = {"cpc"}; }), HasSubstr("STAGE.NAME=VALUE"));
  EXPECT_THAT(with([](Protocol& p) { p.query_views = 0; }), HasSubstr("query views"));
  EXPECT_THAT(with([](Protocol& p) { p.shapes = 1; }), HasSubstr("at least 2"));
}

}  // namespace
}  // namespace cosegraph::evaluation
