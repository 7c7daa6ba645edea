// Whole graphs of small stages, through real DDS, in one process.
#include "graph/run.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <mutex>
#include <thread>
#include <utility>

#include "graph/runtime.hpp"

namespace cosegraph::graph {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

// What the leaves of the graph under test have seen.
struct Seen {
  std::mutex mutex;
  std::vector<std::pair<std::string, float>> frames;
  int in_flight = 0;
  int most_in_flight = 0;
  int ends = 0;
};
Seen* seen = nullptr;

Cloud number(float value) {
  return {.xyz = {value, 0, 0}, .width = 1};
}

class Numbers final : public SourceStage {
 public:
  std::string summary() const override { return "0, 1, 2, ..."; }
  Fields parameters() override {
    return {integer_field("count", count_, 0, 100000, "", "how many"),
            integer_field("bad", bad_, -1, 100000, "", "which one cannot be read"),
            number_field("rate", rate_, 0, 1000, "Hz", "arrival"),
            boolean_field("drop", drop_, "when full")};
  }
  std::optional<std::string> next() override {
    if (at_ == count_) return std::nullopt;
    return "number " + std::to_string(at_++);
  }
  void process(Frame& frame) override {
    const int value = at_ - 1;
    if (value == bad_) throw InputError("number 3: cannot be read");
    {
      const std::scoped_lock lock(seen->mutex);
      seen->most_in_flight = std::max(seen->most_in_flight, ++seen->in_flight);
    }
    out_.put(frame, number(static_cast<float>(value)));
  }
  double rate() const override { return rate_; }
  bool drop_when_full() const override { return drop_; }

 private:
  LatchedInput<RelationModel> model_{*this, "model", "", Need::optional};
  Output<Cloud> out_{*this, "out", ""};
  int count_ = 10;
  int bad_ = -1;
  int at_ = 0;
  double rate_ = 0.0;
  bool drop_ = false;
};

// Three more frames come whenever there is room for one, and the last of them is taken.
class Sensor final : public SourceStage {
 public:
  std::string summary() const override { return "2, 5, 8, ..."; }
  bool live() const override { return true; }
  bool ready(std::chrono::milliseconds) override {
    ++asked_;
    if (asked_ % 2 == 1) return false;  // nothing yet
    at_ += 3;
    if (at_ <= 30) missed_ += 2;
    return true;
  }
  std::uint64_t missed() override { return std::exchange(missed_, 0); }
  std::optional<std::string> next() override {
    if (at_ > 30) return std::nullopt;
    const std::scoped_lock lock(seen->mutex);
    seen->most_in_flight = std::max(seen->most_in_flight, ++seen->in_flight);
    return "number " + std::to_string(at_ - 1);
  }
  void process(Frame& frame) override { out_.put(frame, number(static_cast<float>(at_ - 1))); }

 private:
  Output<Cloud> out_{*this, "out", ""};
  int asked_ = 0;
  int at_ = 0;
  std::uint64_t missed_ = 0;
};

class Add final : public Stage {
 public:
  std::string summary() const override { return "adds to every number"; }
  Fields parameters() override {
    return {number_field("value", value_, -1e6, 1e6, "", "what is added"),
            integer_field("throw_at", throw_at_, -1, 100000, "", "frame that fails"),
            integer_field("hang_at", hang_at_, -1, 100000, "", "frame that takes too long"),
            integer_field("sleep", sleep_, 0, 10000, "ms", "per frame"),
            boolean_field("refuse", refuse_, "to start")};
  }
  void start() override {
    if (refuse_) throw ParameterError("refuse: as told");
  }
  void process(Frame& frame) override {
    const auto sequence = static_cast<int>(frame.header().sequence);
    if (sequence == throw_at_) throw InputError("no luck");
    if (sequence == hang_at_) std::this_thread::sleep_for(1500ms);
    std::this_thread::sleep_for(std::chrono::milliseconds(sleep_));
    out_.put(frame, number(in_.get(frame).xyz[0] + static_cast<float>(value_)));
  }

 private:
  Input<Cloud> in_{*this, "in", ""};
  Output<Cloud> out_{*this, "out", ""};
  double value_ = 1.0;
  int throw_at_ = -1;
  int hang_at_ = -1;
  int sleep_ = 0;
  bool refuse_ = false;
};

class Sum final : public Stage {
 public:
  std::string summary() const override { return "adds both inputs and remembers them"; }
  Fields parameters() override {
    return {boolean_field("fail_end", fail_end_, "the end of the stream fails")};
  }
  void process(Frame& frame) override {
    float sum = a_.get(frame).xyz[0] + b_.get(frame).xyz[0];
    if (model_.connected()) sum += 1000.0F * static_cast<float>(model_.get(frame)->id);
    const std::scoped_lock lock(seen->mutex);
    --seen->in_flight;
    seen->frames.emplace_back(frame.name(), sum);
  }
  void end() override {
    const std::scoped_lock lock(seen->mutex);
    ++seen->ends;
    if (fail_end_) throw Error("disk full");
  }

 private:
  Input<Cloud> a_{*this, "a", ""};
  Input<Cloud> b_{*this, "b", ""};
  LatchedInput<RelationModel> model_{*this, "model", "", Need::optional};
  bool fail_end_ = false;
};

class Provider final : public Stage {
 public:
  std::string summary() const override { return "provides a model"; }
  void start() override {
    out_.put({.id = 7, .label_names = {"a", "b"}, .neighbours = {1, 1, 1, 1}});
  }
  void process(Frame&) override {}

 private:
  LatchedOutput<RelationModel> out_{*this, "model", ""};
};

template <class S>
StageFactory factory() {
  return [] { return std::make_unique<S>(); };
}

const StageTable kTable{{"numbers", factory<Numbers>()},
                        {"sensor", factory<Sensor>()},
                        {"add", factory<Add>()},
                        {"sum", factory<Sum>()},
                        {"provider", factory<Provider>()}};

constexpr auto kDiamond = R"(version: 1
graph: diamond
window: 3
deadline: 20
stages:
  numbers: {use: numbers}
  left: {use: add, inputs: {in: numbers/out}, params: {value: 1}}
  right: {use: add, inputs: {in: numbers/out}, params: {value: 2}}
  sum: {use: sum, inputs: {a: left/out, b: right/out}}
)";

class Run : public testing::Test {
 protected:
  void SetUp() override { seen = &seen_; }
  void TearDown() override { seen = nullptr; }

  static GraphDescription graph(const std::string& text = kDiamond) {
    std::vector<Fault> faults;
    GraphDescription result = parse(text, "test.yaml", faults);
    for (const auto& fault : check(result, catalog_of(kTable))) faults.push_back(fault);
    if (!faults.empty()) throw GraphError(faults);
    return result;
  }

  Seen seen_;
};

TEST_F(Run, EveryFrameArrivesOnceInOrderAndTheAccountCloses) {
  GraphDescription diamond = graph();
  set_param(diamond, "numbers", "count", {"50"});
  const RunReport report = run_in_process(diamond, kTable, {});
  EXPECT_TRUE(report.fine()) << report.error;
  ASSERT_THAT(seen_.frames, SizeIs(50));
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(seen_.frames[i].first, "number " + std::to_string(i));
    EXPECT_EQ(seen_.frames[i].second, 2.0F * static_cast<float>(i) + 3.0F);
  }
  EXPECT_EQ(report.account.admitted, 50U);
  EXPECT_EQ(report.account.labelled, 50U);
  EXPECT_EQ(report.account.failed, 0U);
  EXPECT_EQ(seen_.ends, 1);
  EXPECT_EQ(report.stages.at("left").status.frames_out, 50U);
}

TEST_F(Run, NeverMoreFramesInFlightThanTheWindowAllows) {
  GraphDescription diamond = graph();
  set_param(diamond, "numbers", "count", {"20"});
  set_param(diamond, "right", "sleep", {"5"});
  run_in_process(diamond, kTable, {});
  EXPECT_LE(seen_.most_in_flight, 3);
  EXPECT_GE(seen_.most_in_flight, 2) << "stages work side by side";
}

TEST_F(Run, FailureOfOneFrameLeavesTheOthersAlone) {
  GraphDescription diamond = graph();
  set_param(diamond, "left", "throw_at", {"4"});
  const RunReport report = run_in_process(diamond, kTable, {});
  EXPECT_EQ(report.account.labelled, 9U);
  EXPECT_EQ(report.account.failed, 1U);
  ASSERT_THAT(report.failures, SizeIs(1));
  EXPECT_EQ(report.failures[0].stage, "left");
  EXPECT_EQ(report.failures[0].frame, "number 4");
  EXPECT_EQ(report.failures[0].reason, "no luck");
  EXPECT_THAT(seen_.frames, SizeIs(9));
  EXPECT_FALSE(report.fine());
}

TEST_F(Run, InputThatCannotBeReadIsAFailedFrame) {
  GraphDescription diamond = graph();
  set_param(diamond, "numbers", "bad", {"3"});
  const RunReport report = run_in_process(diamond, kTable, {});
  EXPECT_EQ(report.account.admitted, 10U);
  EXPECT_EQ(report.account.labelled, 9U);
  EXPECT_EQ(report.account.failed, 1U);
  EXPECT_EQ(report.failures.at(0).stage, "numbers");
}

TEST_F(Run, FrameThatHangsFailsAtItsDeadlineAndNamesTheStage) {
  GraphDescription diamond = graph();
  diamond.deadline = 0.5;
  set_param(diamond, "numbers", "count", {"4"});
  set_param(diamond, "right", "hang_at", {"1"});
  const RunReport report = run_in_process(diamond, kTable, {});
  EXPECT_EQ(report.account.admitted, 4U);
  EXPECT_GE(report.account.failed, 1U);
  ASSERT_FALSE(report.failures.empty());
  EXPECT_EQ(report.failures[0].reason, "timeout at right");
}

TEST_F(Run, StageThatRefusesToStartStopsTheRun) {
  GraphDescription diamond = graph();
  set_param(diamond, "left", "refuse", {"true"});
  try {
    run_in_process(diamond, kTable, {});
    FAIL() << "ran";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("left: refuse"));
  }
}

TEST_F(Run, FailureAtTheEndOfTheStreamIsAnError) {
  GraphDescription diamond = graph();
  set_param(diamond, "sum", "fail_end", {"true"});
  const RunReport report = run_in_process(diamond, kTable, {});
  EXPECT_THAT(report.error, HasSubstr("disk full"));
}

TEST_F(Run, EmptyStreamEnds) {
  GraphDescription diamond = graph();
  set_param(diamond, "numbers", "count", {"0"});
  const RunReport report = run_in_process(diamond, kTable, {});
  EXPECT_TRUE(report.fine());
  EXPECT_EQ(report.account.admitted, 0U);
}

TEST_F(Run, FramesCarryTheModelTheyAreWorkedOnWith) {
  const RunReport report = run_in_process(graph(R"(version: 1
graph: diamond
stages:
  numbers: {use: numbers, inputs: {model: provider/model}}
  provider: {use: provider}
  add: {use: add, inputs: {in: numbers/out}}
  sum: {use: sum, inputs: {a: add/out, b: numbers/out, model: provider/model}}
)"),
                                          kTable, {});
  EXPECT_TRUE(report.fine()) << report.error;
  ASSERT_THAT(seen_.frames, SizeIs(10));
  EXPECT_EQ(seen_.frames[2].second, 7005.0F);
}

TEST_F(Run, LiveSourceDropsWhatItCannotAdmitAndCountsIt) {
  GraphDescription diamond = graph();
  diamond.window = 1;
  set_param(diamond, "numbers", "count", {"20"});
  set_param(diamond, "numbers", "rate", {"100"});
  set_param(diamond, "numbers", "drop", {"true"});
  set_param(diamond, "right", "sleep", {"35"});
  const RunReport report = run_in_process(diamond, kTable, {});
  EXPECT_GT(report.account.dropped, 0U);
  EXPECT_EQ(report.account.admitted + report.account.dropped, 20U);
  EXPECT_EQ(report.account.admitted, report.account.labelled);
}

// A frame that waited for room would be an old one.
TEST_F(Run, SensorIsAskedForAFrameOnlyWhenThereIsRoom) {
  GraphDescription diamond = graph(R"(version: 1
graph: diamond
window: 2
stages:
  sensor: {use: sensor}
  left: {use: add, inputs: {in: sensor/out}}
  right: {use: add, inputs: {in: sensor/out}, params: {sleep: 5}}
  sum: {use: sum, inputs: {a: left/out, b: right/out}}
)");
  const RunReport report = run_in_process(diamond, kTable, {});
  EXPECT_TRUE(report.fine()) << report.error;
  EXPECT_LE(seen_.most_in_flight, 2);
  ASSERT_THAT(seen_.frames, SizeIs(10));
  for (int i = 0; i < 10; ++i)
    EXPECT_EQ(seen_.frames[i].first, "number " + std::to_string(3 * i + 2));
  EXPECT_EQ(report.account.admitted, 10U);
  EXPECT_EQ(report.account.labelled, 10U);
  EXPECT_EQ(report.account.dropped, 20U);
}

TEST_F(Run, ConcurrentRunsOfOneGraphDoNotMeet) {
  GraphDescription first = graph();
  set_param(first, "numbers", "count", {"60"});
  set_param(first, "left", "value", {"100"});
  RunReport other;
  std::jthread beside([&] { other = run_in_process(graph(), kTable, {}); });
  const RunReport report = run_in_process(first, kTable, {});
  beside.join();
  EXPECT_TRUE(report.fine()) << report.error;
  EXPECT_TRUE(other.fine()) << other.error;
  EXPECT_EQ(report.account.labelled, 60U);
  EXPECT_EQ(other.account.labelled, 10U);
  EXPECT_THAT(seen_.frames, SizeIs(70));
}

TEST_F(Run, CanBeInterrupted) {
  GraphDescription diamond = graph();
  set_param(diamond, "numbers", "count", {"10000"});
  set_param(diamond, "right", "sleep", {"10"});
  std::atomic<bool> stop = false;
  std::jthread soon([&] {
    std::this_thread::sleep_for(300ms);
    stop = true;
  });
  const RunReport report = run_in_process(diamond, kTable, {.stop = &stop});
  EXPECT_TRUE(report.interrupted);
  EXPECT_LT(seen_.frames.size(), 10000U);
}

}  // namespace
}  // namespace cosegraph::graph
