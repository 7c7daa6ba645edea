// Recording running graphs and replaying them, through real DDS in one process.
#include <gmock/gmock.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <thread>

#include "graph/runtime.hpp"
#include "io/file.hpp"
#include "tools/recording/compare.hpp"
#include "tools/recording/recorder.hpp"
#include "tools/recording/replay.hpp"

namespace cosegraph::recording {
namespace {

using namespace std::chrono_literals;
using testing::Each;
using testing::ElementsAre;
using testing::Gt;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// The source holds its second frame back until this is set: the first is kept for readers that are
// found late, and when it has come through everywhere, everybody has found everybody.
std::atomic<bool> go_on = true;

// `count` numbers; each is a cloud of `points` points.
class Numbers final : public graph::SourceStage {
 public:
  std::string summary() const override { return "0, 1, 2, ..."; }
  Fields parameters() override {
    return {integer_field("count", count_, 0, 100000, "", "how many"),
            integer_field("points", points_, 1, 100000, "", "of every cloud")};
  }
  std::optional<std::string> next() override {
    while (at_ == 1 && !go_on && !stopping()) std::this_thread::sleep_for(1ms);
    if (at_ == count_) return std::nullopt;
    return "n" + std::to_string(at_++);
  }
  void process(graph::Frame& frame) override {
    Cloud cloud{.width = static_cast<std::uint32_t>(points_)};
    for (int i = 0; i < 3 * points_; ++i)
      cloud.xyz.push_back(static_cast<float>(at_ - 1) + std::sin(static_cast<float>(i)));
    out_.put(frame, cloud);
  }

 private:
  graph::LatchedInput<RelationModel> model_{*this, "model", "", graph::Need::optional};
  graph::Output<Cloud> out_{*this, "out", ""};
  int count_ = 10;
  int points_ = 1;
  int at_ = 0;
};

// What Add has made, while there is a list.
std::vector<float>* made = nullptr;

class Add final : public graph::Stage {
 public:
  std::string summary() const override { return "adds to every number"; }
  Fields parameters() override {
    return {number_field("value", value_, -1e6, 1e6, "", "what is added"),
            integer_field("throw_at", throw_at_, -1, 100000, "", "frame that fails"),
            boolean_field("fail_end", fail_end_, "the end of the stream fails")};
  }
  void process(graph::Frame& frame) override {
    if (static_cast<int>(frame.header().sequence) == throw_at_) throw InputError("no luck");
    Cloud cloud = in_.get(frame);
    for (auto& x : cloud.xyz) x += static_cast<float>(value_);
    if (model_.connected()) cloud.xyz[0] += 1000.0F * static_cast<float>(model_.get(frame)->id);
    if (made != nullptr) made->push_back(cloud.xyz[0]);
    out_.put(frame, cloud);
  }
  void end() override {
    if (fail_end_) throw Error("disk full");
  }

 private:
  graph::Input<Cloud> in_{*this, "in", ""};
  graph::LatchedInput<RelationModel> model_{*this, "model", "", graph::Need::optional};
  graph::Output<Cloud> out_{*this, "out", ""};
  double value_ = 1.0;
  int throw_at_ = -1;
  bool fail_end_ = false;
};

class Provider final : public graph::Stage {
 public:
  std::string summary() const override { return "provides a model"; }
  void start() override { out_.put({.id = 7, .label_names = {"a"}, .neighbours = {1}}); }
  void process(graph::Frame&) override {}

 private:
  graph::LatchedOutput<RelationModel> out_{*this, "model", ""};
};

template <class S>
graph::StageFactory factory() {
  return [] { return std::make_unique<S>(); };
}

const graph::StageTable kTable{
    {"numbers", factory<Numbers>()}, {"add", factory<Add>()}, {"provider", factory<Provider>()}};

constexpr auto kChain = R"(version: 1
graph: chain
window: 3
deadline: 20
stages:
  provider: {use: provider}
  numbers: {use: numbers, inputs: {model: provider/model}}
  first: {use: add, inputs: {in: numbers/out, model: provider/model}}
  second: {use: add, inputs: {in: first/out}}
)";

class Live : public testing::Test {
 protected:
  Live() {
    std::vector<graph::Fault> faults;
    graph_ = graph::parse(kChain, "chain.yaml", faults);
    graph_ = fresh(graph_);
    graph_.one_process = true;
  }

  // Runs of tests that are at work at the same time must not meet.
  static graph::GraphDescription fresh(graph::GraphDescription graph) {
    static int count = 0;
    graph.instance = "live" + std::to_string(::getpid()) + "n" + std::to_string(++count);
    return graph;
  }

  std::filesystem::path file() const { return folder_ / "x.mcap"; }

  // Every stage of the graph, at work until the object goes.
  class Running {
   public:
    explicit Running(const graph::GraphDescription& graph) {
      for (const auto& node : graph.stages) {
        auto stage = kTable.at(node.use)();
        graph::apply_params(graph, node, *stage);
        stages_.push_back(std::make_unique<graph::StageRunner>(
            graph, node.name, std::move(stage), graph::RunnerOptions{.leaves = {"second"}}));
        if (node.use == "numbers") source_ = stages_.back().get();
      }
    }
    idl::Account account() const { return source_->status().account; }

   private:
    std::vector<std::unique_ptr<graph::StageRunner>> stages_;
    graph::StageRunner* source_ = nullptr;
  };

  // Records a whole run of the graph.
  Recorder::Result record(const RecorderOptions& options = {}) {
    Recorder recorder(graph_, graph::catalog_of(kTable), file(), options);
    go_on = false;
    const Running running(graph_);
    for (int i = 0; i < 3000 && !recorder.progress().silent.empty(); ++i) recorder.step(10ms);
    go_on = true;
    for (int i = 0; i < 300 && recorder.step(100ms); ++i) continue;
    Recorder::Result result = recorder.finish("not over");
    account_ = running.account();
    return result;
  }

  // Replays into a stage of the graph as it is now; its results are in `made_`.
  IntoReport into(const McapReader& reader, const std::string& name, ReplayOptions options = {}) {
    made = &made_;
    const IntoReport report = replay_into(reader, fresh(graph_), name, stage(name), options);
    made = nullptr;
    return report;
  }
  void TearDown() override { made = nullptr; }

  std::unique_ptr<graph::Stage> stage(const std::string& name) const {
    const graph::StageNode& node = *graph_.stage(name);
    auto stage = kTable.at(node.use)();
    graph::apply_params(graph_, node, *stage);
    return stage;
  }

  const io::TemporaryFolder folder_;
  graph::GraphDescription graph_;
  idl::Account account_;
  std::vector<float> made_;
};

TEST_F(Live, RecordingOfAWholeRunIsComplete) {
  graph::set_param(graph_, "numbers", "count", {"40"});
  graph::set_param(graph_, "first", "throw_at", {"4"});
  const Recorder::Result result = record();
  EXPECT_EQ(result.completeness.ended, "the stream is over");
  EXPECT_TRUE(result.completeness.has_all());
  ASSERT_THAT(result.completeness.stretches, SizeIs(1));
  const Stretch& stretch = result.completeness.stretches[0];
  EXPECT_TRUE(stretch.from_start && stretch.to_end);
  EXPECT_EQ(stretch.frames.last, 39U);
  EXPECT_EQ(stretch.failed, 1U);
  EXPECT_EQ(account_.labelled, 39U);

  const McapReader reader(file());
  EXPECT_EQ(reader.damage(), "");
  EXPECT_EQ(graph::to_yaml(graph_in(reader)), graph::to_yaml(graph_));
  EXPECT_EQ(completeness_in(reader), result.completeness);
  std::vector<float> numbers;
  std::uint64_t time = 0;
  for (auto messages = reader.messages(); const auto message = messages.next();) {
    EXPECT_GE(message->log_time, time) << "times ascend";
    time = message->log_time;
    if (reader.channels().at(message->channel).topic == "chain/second/out")
      numbers.push_back(idl::decode<Cloud>(message->data).xyz[0]);
  }
  ASSERT_THAT(numbers, SizeIs(39));
  EXPECT_EQ(numbers[0], 7002.0F);
  EXPECT_EQ(numbers[38], 7041.0F);
}

TEST_F(Live, RecordedStagesMakeTheSameAgainWithoutTheGraph) {
  graph::set_param(graph_, "numbers", "count", {"20"});
  graph::set_param(graph_, "first", "throw_at", {"4"});
  record();
  const McapReader reader(file());
  for (const std::string name : {"first", "second"}) {
    const StageWiring wiring = wiring_of(graph_, name, graph::info_of("add", kTable.at("add")));
    StageFrames frames(reader, wiring, StageFrames::Want::inputs_and_outputs, graph_.window, 0,
                       ~std::uint64_t{0});
    const auto again = stage(name);
    for (const auto& input : graph_.stage(name)->inputs) again->connect(input.port);
    std::map<FrameComparison::Verdict, int> counts;
    while (const auto frame = frames.next()) ++counts[compare(*frame, wiring, *again, 0.0).verdict];
    EXPECT_EQ(counts[FrameComparison::Verdict::identical], name == "first" ? 20 : 19);
    EXPECT_EQ(counts[FrameComparison::Verdict::differs], 0);
  }
}

TEST_F(Live, ChosenTopicsOnlyAndWhatHappenedToTheFrames) {
  const Recorder::Result result = record({.topics = {"second/"}});
  EXPECT_TRUE(result.completeness.has_all());
  EXPECT_EQ(result.completeness.topics.at("chain/second/out").messages, 10U);
  EXPECT_FALSE(result.completeness.topics.contains("chain/numbers/out"));
  EXPECT_TRUE(result.completeness.topics.contains("chain/stream_end"));
  EXPECT_THROW(
      Recorder(graph_, graph::catalog_of(kTable), folder_ / "y.mcap", {.topics = {"teapot"}}),
      ParameterError);
}

// A model that frames name may be found after them; an end that is asked for waits for it.
TEST_F(Live, WhatIsOnItsWayAtTheEndIsWaitedFor) {
  Recorder recorder(graph_, graph::catalog_of(kTable), file(), {});
  graph::Participant participant(graph_, "chain/hand");
  std::map<std::string, std::unique_ptr<graph::Writer>> writers;
  const auto write = [&](const std::string& stage, std::uint64_t sequence, const auto& value) {
    for (const auto& topic : topics_of(graph_, graph::catalog_of(kTable)))
      if (topic.name == "chain/" + stage) {
        auto& writer = writers[stage];
        if (!writer) writer = participant.writer(topic.name, topic.type, qos_of(topic, graph_));
        for (int i = 0; i < 3000 && writer->matched() == 0; ++i) std::this_thread::sleep_for(1ms);
        writer->write(idl::encode(
            {.graph = "chain", .stage = stage, .epoch = 3, .sequence = sequence, .model_id = 7},
            value));
      }
  };
  const Cloud cloud{.xyz = {1.0F, 2.0F, 3.0F}, .width = 1, .height = 1};
  for (const auto* stage : {"numbers/out", "first/out", "second/out"})
    for (const std::uint64_t sequence : {0, 2}) write(stage, sequence, cloud);
  while (recorder.progress().messages < 6) recorder.step(1ms);
  std::thread late([&] {
    for (const auto* stage : {"numbers/out", "first/out", "second/out"}) write(stage, 1, cloud);
    write("provider/model", 0, RelationModel{.id = 7, .label_names = {"a"}, .neighbours = {1}});
  });
  const Completeness completeness = recorder.finish("stopped").completeness;
  late.join();
  EXPECT_TRUE(completeness.has_all());
  ASSERT_THAT(completeness.stretches, SizeIs(1));
  EXPECT_EQ(completeness.stretches[0].frames, (Range{3, 0, 2}));
}

// What has no room is lost to the recording, by count, and to nobody else.
TEST_F(Live, RecorderWithoutRoomHoldsNobodyUp) {
  graph::set_param(graph_, "numbers", "count", {"200"});
  graph::set_param(graph_, "numbers", "points", {"20000"});
  const Recorder::Result result = record({.memory = 1});
  EXPECT_EQ(account_.labelled, 200U);
  EXPECT_FALSE(result.completeness.has_all());
  std::uint64_t lost = 0;
  for (const auto& name : {"chain/numbers/out", "chain/first/out", "chain/second/out"}) {
    const TopicCount& count = result.completeness.topics.at(name);
    EXPECT_EQ(count.messages + count.lost, 200U) << name;
    lost += count.lost;
  }
  EXPECT_GT(lost, 0U);
}

TEST_F(Live, NewestSecondsOnlyAreWrittenAtTheEnd) {
  graph::set_param(graph_, "numbers", "count", {"200"});
  graph::set_param(graph_, "numbers", "points", {"2000"});
  const Recorder::Result result =
      record({.last = std::chrono::seconds(100), .ring_memory = 1'000'000});
  EXPECT_THAT(result.completeness.ended, HasSubstr("as far back as memory reached"));
  const TopicCount& count = result.completeness.topics.at("chain/second/out");
  EXPECT_GT(count.messages, 0U);
  EXPECT_LT(count.messages, 200U);
  EXPECT_EQ(result.completeness.topics.at("chain/provider/model").messages, 1U)
      << "models are kept however old";
  ASSERT_THAT(result.completeness.stretches, SizeIs(1));
  EXPECT_FALSE(result.completeness.stretches[0].from_start);
  EXPECT_EQ(result.completeness.stretches[0].frames.last, 199U);
}

TEST_F(Live, RecordingEndsWhenTheFileHasItsSize) {
  graph::set_param(graph_, "numbers", "count", {"300"});
  graph::set_param(graph_, "numbers", "points", {"20000"});
  const Recorder::Result result = record({.file = {.max_size = 3'000'000}});
  EXPECT_EQ(result.completeness.ended, "the file has its size");
  EXPECT_EQ(McapReader(file()).damage(), "");
}

// -- replay --------------------------------------------------------------------------------------

// Reads a topic of a run.
class Listener {
 public:
  Listener(const graph::GraphDescription& graph, const std::string& topic, const std::string& type)
      : participant_(graph, "listener"),
        reader_(
            participant_.reader(topic, type, {.depth = 100}, [this](const graph::Sample& sample) {
              const std::scoped_lock lock(mutex_);
              samples_.push_back(sample);
            })) {}
  std::vector<graph::Sample> samples() const {
    const std::scoped_lock lock(mutex_);
    return samples_;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<graph::Sample> samples_;
  graph::Participant participant_;
  std::unique_ptr<graph::Reader> reader_;
};

// The replays of these tests hold no more frames than a writer keeps for readers that are found
// late: 2 x window + 2.
TEST_F(Live, ReplayPublishesWhatWasRecorded) {
  graph::set_param(graph_, "numbers", "count", {"8"});
  record();
  const McapReader reader(file());
  const graph::GraphDescription again = fresh(graph_);
  const Listener outputs(again, "chain/second/out", "Cloud");
  const Listener models(again, "chain/provider/model", "RelationModel");
  const ReplayReport report = replay(
      reader, again, {.speed = 50.0, .topics = {"second/out", "provider/model"}, .wait = true});
  EXPECT_EQ(report.rounds, 1U);
  std::vector<idl::Bytes> recorded;
  for (auto messages = reader.messages(); const auto message = messages.next();)
    if (reader.channels().at(message->channel).topic == "chain/second/out")
      recorded.emplace_back(message->data.begin(), message->data.end());
  const auto heard = outputs.samples();
  ASSERT_THAT(heard, SizeIs(recorded.size()));
  for (std::size_t i = 0; i < heard.size(); ++i) EXPECT_EQ(*heard[i], recorded[i]);
  EXPECT_THAT(models.samples(), SizeIs(1));
}

TEST_F(Live, LoopBeginsAnewWithEpochsOfItsOwn) {
  graph::set_param(graph_, "numbers", "count", {"8"});
  record();
  const McapReader reader(file());
  const graph::GraphDescription again = fresh(graph_);
  const Listener outputs(again, "chain/second/out", "Cloud");
  std::atomic<bool> stop = false;
  ReplayReport report;
  std::jthread replaying([&] {
    report =
        replay(reader, again,
               {.speed = 50.0, .loop = true, .topics = {"second"}, .wait = true, .stop = &stop});
  });
  for (int i = 0; i < 600 && outputs.samples().size() < 25; ++i) std::this_thread::sleep_for(50ms);
  stop = true;
  replaying.join();
  EXPECT_GE(report.rounds, 2U);
  std::vector<std::uint64_t> epochs;
  for (const auto& sample : outputs.samples()) {
    const idl::FrameHeader header = idl::decode_header(*sample);
    if (header.sequence == 0) epochs.push_back(header.epoch);
  }
  EXPECT_THAT(epochs, SizeIs(testing::Ge(2U)));
  EXPECT_TRUE(std::ranges::is_sorted(epochs));
  EXPECT_EQ(std::ranges::adjacent_find(epochs), epochs.end());
}

TEST_F(Live, ReplayOfAPartBeginsWithTheModels) {
  graph::set_param(graph_, "numbers", "count", {"30"});
  record();
  const McapReader reader(file());
  std::uint64_t middle = 0;
  for (auto messages = reader.messages(); const auto message = messages.next();)
    if (idl::decode_header(message->data).sequence == 23 && middle == 0) middle = message->log_time;
  const graph::GraphDescription again = fresh(graph_);
  const Listener outputs(again, "chain/second/out", "Cloud");
  const Listener models(again, "chain/provider/model", "RelationModel");
  replay(reader, again,
         {.from = middle, .speed = 50.0, .topics = {"second/out", "provider/model"}, .wait = true});
  EXPECT_THAT(outputs.samples().size(), testing::AllOf(Gt(4U), testing::Lt(15U)));
  EXPECT_THAT(models.samples(), SizeIs(1));
}

TEST_F(Live, StageIsGivenItsRecordedFrames) {
  graph::set_param(graph_, "numbers", "count", {"40"});
  graph::set_param(graph_, "first", "throw_at", {"4"});
  record();
  const McapReader reader(file());
  graph::set_param(graph_, "second", "value", {"10"});
  const IntoReport report = into(reader, "second");
  EXPECT_EQ(report.frames, 39U);
  EXPECT_EQ(report.failed, 0U);
  EXPECT_EQ(report.skipped, 1U);
  EXPECT_EQ(report.status.frames_out, 39U);
  EXPECT_EQ(report.status.state, idl::State::finished);
  ASSERT_THAT(made_, SizeIs(39));
  EXPECT_EQ(made_[0], 7011.0F);
  EXPECT_EQ(made_[38], 7050.0F);
}

TEST_F(Live, StageIsGivenItsModelsAndItsFailuresAreCounted) {
  graph::set_param(graph_, "numbers", "count", {"12"});
  record();
  const McapReader reader(file());
  graph::set_param(graph_, "first", "throw_at", {"5"});
  const IntoReport report = into(reader, "first");
  EXPECT_EQ(report.frames, 12U);
  EXPECT_EQ(report.failed, 1U);
  ASSERT_THAT(made_, SizeIs(11));
  EXPECT_EQ(made_[0], 7001.0F);
}

TEST_F(Live, StageTakesUpTheMiddleOfAStream) {
  graph::set_param(graph_, "numbers", "count", {"30"});
  record();
  const McapReader reader(file());
  std::uint64_t middle = 0;
  for (auto messages = reader.messages(); const auto message = messages.next();)
    if (reader.channels().at(message->channel).topic == "chain/first/out" &&
        idl::decode_header(message->data).sequence == 20)
      middle = message->log_time;
  const IntoReport report = into(reader, "second", {.from = middle});
  EXPECT_EQ(report.frames, 10U);
  EXPECT_EQ(report.failed, 0U);
}

TEST_F(Live, StageThatFailsAtTheEndIsAnError) {
  record();
  const McapReader reader(file());
  graph::set_param(graph_, "second", "fail_end", {"true"});
  try {
    into(reader, "second");
    FAIL() << "ran";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("second: disk full"));
  }
}

TEST_F(Live, SourcesCannotBeReplayedInto) {
  record();
  const McapReader reader(file());
  EXPECT_THROW(into(reader, "numbers"), ParameterError);
}

}  // namespace
}  // namespace cosegraph::recording
