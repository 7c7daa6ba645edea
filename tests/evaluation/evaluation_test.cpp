#include "tools/evaluation/evaluation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "core/error.hpp"
#include "evaluation/world.hpp"
#include "tools/evaluation/pictures.hpp"
#include "tools/evaluation/report.hpp"
#include "tools/evaluation/tables.hpp"

namespace cosegraph::evaluation {
namespace {

using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Protocol quick_protocol(const std::filesystem::path& data) {
  Protocol protocol{.data = data, .query_views = 2, .train_views = 3, .seeds = {3}, .jobs = 1};
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
    EXPECT_GE(pair.figures.accuracy, 0.0);
    EXPECT_LE(pair.figures.accuracy, pair.oracle + 1e-12);
    EXPECT_LE(pair.oracle, 1.0);
    EXPECT_GT(pair.majority_floor, 0.0);
    EXPECT_FALSE(pair.segment_label.empty());
    EXPECT_TRUE(pair.proven_optimal);
  }
  const Table table = tables_of(*report_)[0];
  for (const Row& row : table.categories) {
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
    if (pair.configuration == 1) among_others.push_back(pair.figures.accuracy);
  for (const Pair& pair : report_->pairs)
    if (pair.category == 1) alone.push_back(pair.figures.accuracy);
  EXPECT_EQ(alone, among_others);
  EXPECT_TRUE(std::ranges::all_of(report.pairs, [](const Pair& pair) {
    return (pair.ms[2] > 0.0) == (pair.configuration == 0);
  }));
}

TEST_F(WholeRun, TheBoundsAsConfigurationsHaveTheAccuracyOfTheColumns) {
  Protocol protocol = quick_protocol(folder_->path());
  protocol.configurations = {"majority", "oracle"};
  const Report report = evaluate(protocol);
  ASSERT_EQ(report.pairs.size(), 2 * report_->pairs.size());
  for (const Pair& pair : report.pairs) {
    const auto same = std::ranges::find_if(report_->pairs, [&](const Pair& other) {
      return std::tie(other.category, other.reference, other.query, other.view) ==
             std::tie(pair.category, pair.reference, pair.query, pair.view);
    });
    EXPECT_EQ(pair.majority_floor, same->majority_floor);
    EXPECT_EQ(pair.oracle, same->oracle);
    EXPECT_DOUBLE_EQ(pair.figures.accuracy,
                     pair.configuration == 0 ? same->majority_floor : same->oracle);
    EXPECT_LE(same->figures.accuracy, pair.oracle);
  }
}

TEST_F(WholeRun, SeveralSeedsAreTheRunsOfEachSeedTogether) {
  Protocol protocol = quick_protocol(folder_->path());
  protocol.seeds = {4, 3};
  const Report both = evaluate(protocol);
  EXPECT_EQ(both.categories[0].compatible, 2 * report_->categories[0].compatible);
  std::vector<double> third;
  for (const Pair& pair : both.pairs)
    if (pair.seed == 3) third.push_back(pair.figures.accuracy);
  std::vector<double> alone;
  for (const Pair& pair : report_->pairs) alone.push_back(pair.figures.accuracy);
  EXPECT_EQ(third, alone);
  EXPECT_EQ(both.pairs.size(), 2 * alone.size());
}

TEST_F(WholeRun, TheConfusionsDiagonalIsTheMeanAccuracy) {
  ASSERT_EQ(report_->confusions.size(), 2U);
  for (const Confusion& confusion : report_->confusions) {
    const std::size_t labels =
        report_->categories[static_cast<std::size_t>(confusion.category)].label_names.size();
    ASSERT_EQ(confusion.fraction.size(), labels * labels);
    double diagonal = 0.0;
    double accuracy = 0.0;
    for (std::size_t l = 0; l < labels; ++l) diagonal += confusion.fraction[l * labels + l];
    for (const Pair& pair : report_->pairs)
      if (pair.category == confusion.category) accuracy += pair.figures.accuracy;
    EXPECT_NEAR(diagonal, accuracy, 1e-9);
  }
}

TEST_F(WholeRun, PicturesAreMadeOfIt) {
  ASSERT_EQ(best_configuration(*report_), 0);
  const auto size_of = [](const std::string& png) {
    const cv::Mat image =
        cv::imdecode(std::vector<unsigned char>(png.begin(), png.end()), cv::IMREAD_COLOR);
    return image.size();
  };
  EXPECT_GT(size_of(metrics_png(*report_)).width, 300);
  EXPECT_GT(size_of(times_png(*report_)).width, 300);
  EXPECT_GT(size_of(confusion_png(*report_, 0)).width, 300);
  // Two rows of nine panels.
  const cv::Size gallery = size_of(gallery_png(*report_, 0));
  EXPECT_GT(gallery.width, 9 * 210);
  EXPECT_GT(gallery.height, 2 * 175);
}

// How many pieces of work a run did.
class Counter {
 public:
  Progress progress() {
    return {.stopped = [this] { return done_ >= limit_; },
            .step = [this](const Status&) { ++done_; }};
  }
  void stop_after(int pieces) { limit_ = pieces; }
  int done() const { return done_; }

 private:
  int done_ = 0;
  int limit_ = 1 << 30;
};

TEST_F(WholeRun, ASecondStartGoesOnWhereTheFirstWasStopped) {
  Counter whole;
  const Protocol protocol = quick_protocol(folder_->path());
  evaluate(protocol, whole.progress());
  for (const int pieces : {3, whole.done() / 3, whole.done() - 2}) {
    const TemporaryFolder kept;
    const Keep keep{.results = kept / "results", .views = kept / "views"};
    Counter first;
    first.stop_after(pieces);
    EXPECT_TRUE(evaluate(protocol, first.progress(), keep).interrupted);
    Counter second;
    const Report report = evaluate(protocol, second.progress(), keep);
    EXPECT_FALSE(report.interrupted);
    EXPECT_EQ(text_of(report), text_of(*report_));
    Counter third;
    EXPECT_EQ(text_of(evaluate(protocol, third.progress(), keep)), text_of(*report_));
    EXPECT_EQ(third.done(), 0);
    EXPECT_FALSE(std::filesystem::exists(kept / "views"));
  }
}

TEST_F(WholeRun, FinishedPairsOfAStoppedCategoryAreNotDoneAgain) {
  const TemporaryFolder kept;
  const Keep keep{.results = kept / "results", .views = {}};
  Protocol protocol = quick_protocol(folder_->path());
  protocol.categories = {"Lollipop"};  // 3 shapes, 9 views, 3 models, 6 query views
  Counter first;
  first.stop_after(3 + 9 + 3 + 4);
  evaluate(protocol, first.progress(), keep);
  Counter second;
  evaluate(protocol, second.progress(), keep);
  EXPECT_LT(second.done(), 3 + 9 + 3 + 6);
  EXPECT_GE(second.done(), 3 + 9 + 1 + 2);
}

TEST_F(WholeRun, WhatIsKeptOfTheViewsGivesTheSameFigures) {
  const TemporaryFolder kept;
  const Keep keep{.results = {}, .views = kept.path(), .views_after = true};
  Protocol protocol = quick_protocol(folder_->path());
  protocol.configurations = {"fpfh+fv", "fpfh+fv+iso:cpc"};
  const std::string without = text_of(evaluate(protocol));
  protocol.configurations = {"fpfh+fv"};
  EXPECT_EQ(text_of(evaluate(protocol, {}, keep)), text_of(*report_));
  protocol.configurations = {"fpfh+fv", "fpfh+fv+iso:cpc"};  // half of its parts are kept
  EXPECT_EQ(text_of(evaluate(protocol, {}, keep)), without);
  // Killed writers and a bad disk: cut off and changed files are made again.
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(kept.path())) {
    if (!entry.is_regular_file()) continue;
    if (++files % 2 == 0)
      std::filesystem::resize_file(entry.path(), entry.file_size() / 2);
    else
      std::fstream(entry.path()).seekp(-20, std::ios::end).write("x", 1);
  }
  EXPECT_GT(files, 20U);
  EXPECT_EQ(text_of(evaluate(protocol, {}, keep)), without);
}

TEST(Evaluation, AChangedShapeIsDoneAgain) {
  const TemporaryFolder folder;
  const TemporaryFolder kept;
  const Keep keep{.results = kept / "results", .views = kept / "views"};
  test::write_benchmark(folder.path());
  Protocol protocol = quick_protocol(folder.path());
  protocol.categories = {"Lollipop"};
  evaluate(protocol, {}, keep);
  test::write_shape(folder.path() / "Lollipop", "10", test::lollipop(0.8));
  EXPECT_EQ(text_of(evaluate(protocol, {}, keep)), text_of(evaluate(protocol)));
}

TEST(Evaluation, WhatWasKeptWithoutFlawedShapesIsNotTakenForARunWithThem) {
  const TemporaryFolder folder;
  const TemporaryFolder kept;
  const Keep keep{.results = kept / "results", .views = kept / "views"};
  const auto category = folder.path() / "Lollipop";
  test::write_shape(category, "1", test::lollipop(0.5));
  test::write_shape(category, "2", test::lollipop(0.6));
  Mesh open = test::lollipop(0.55);
  open.face.erase(open.face.begin() + 3 * 800, open.face.begin() + 3 * 801);
  open.face_label.pop_back();
  test::write_shape(category, "3", open);
  Protocol protocol = quick_protocol(folder.path());
  EXPECT_EQ(evaluate(protocol, {}, keep).pairs.size(), 4U);
  protocol.flawed = true;
  EXPECT_EQ(evaluate(protocol, {}, keep).pairs.size(), 12U);
  protocol.flawed = false;
  EXPECT_EQ(evaluate(protocol, {}, keep).pairs.size(), 4U);
}

TEST(Evaluation, AFolderThatCannotBeWrittenIsReportedOnceAndTheRunGoesOn) {
  const TemporaryFolder folder;
  test::write_benchmark(folder.path());
  test::write_text(folder / "plain", "a file where a folder should be");
  Protocol protocol = quick_protocol(folder.path());
  protocol.categories = {"Lollipop"};
  const Report report = evaluate(protocol, {}, {.results = folder / "plain", .views = {}});
  EXPECT_EQ(report.pairs.size(), 12U);
  ASSERT_EQ(report.problems.size(), 1U);
  EXPECT_THAT(report.problems[0].what, HasSubstr("plain"));
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
  Mesh open = test::lollipop(0.5);
  open.face.erase(open.face.begin() + 3 * 800, open.face.begin() + 3 * 801);
  open.face_label.pop_back();
  test::write_shape(category, "6", open);
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
  EXPECT_THAT(where, ElementsAre("Lollipop/4", "Nothing", "Lollipop/3", "Lollipop/5", "Lollipop/6",
                                 "Nothing"));
  EXPECT_THAT(report.problems[2].what, HasSubstr("3_labels.txt"));
  EXPECT_THAT(report.problems[3].what, HasSubstr("no view shows enough of every part"));
  EXPECT_THAT(report.problems[4].what, HasSubstr("6.off: 3 edges have a face on one side only"));
  EXPECT_THAT(table_markdown(report), HasSubstr("## Left out: 6"));
  protocol.flawed = true;
  EXPECT_EQ(evaluate(protocol).pairs.size(), 12U);
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
  EXPECT_THAT(with([](Protocol& p) { p.configurations = {"oracle:l2"}; }), HasSubstr("oracle:cpc"));
  EXPECT_THAT(with([](Protocol& p) { p.seeds = {}; }), HasSubstr("no seed"));
  EXPECT_THAT(with([](Protocol& p) { p.seeds = {1, 1}; }), HasSubstr("seed 1 is named twice"));
  EXPECT_THAT(with([](Protocol& p) { p.query_views = 0; }), HasSubstr("query views"));
  EXPECT_THAT(with([](Protocol& p) { p.shapes = 1; }), HasSubstr("at least 2"));
}

}  // namespace
}  // namespace cosegraph::evaluation
