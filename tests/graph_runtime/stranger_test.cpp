// What a participant that does not belong to a graph can do to it by writing on its topics.
#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <thread>

#include "core/random.hpp"
#include "graph/control.hpp"
#include "graph/dds.hpp"
#include "graph/observer.hpp"
#include "graph/runtime.hpp"

namespace cosegraph::graph {
namespace {

using namespace std::chrono_literals;
using idl::FrameHeader;
using testing::HasSubstr;

constexpr std::uint64_t kFrames = 150;
constexpr std::uint64_t kModel = 7;

Cloud number(float value) {
  return {.xyz = {value, 0, 0}, .width = 1};
}

RelationModel model_of(std::uint64_t id) {
  return {.id = id, .label_names = {"a", "b"}, .neighbours = {1, 1, 1, 1}};
}

class Numbers final : public SourceStage {
 public:
  std::string summary() const override { return "0, 1, 2, ..., at a rate"; }
  std::optional<std::string> next() override {
    if (at_ == kFrames) return std::nullopt;
    return "number " + std::to_string(at_++);
  }
  void process(Frame& frame) override { out_.put(frame, number(static_cast<float>(at_ - 1))); }
  double rate() const override { return 200.0; }

 private:
  LatchedInput<RelationModel> model_{*this, "model", "", Need::optional};
  Output<Cloud> out_{*this, "out", ""};
  std::uint64_t at_ = 0;
};

class Provider final : public Stage {
 public:
  std::string summary() const override { return "provides a model"; }
  void start() override { out_.put(model_of(kModel)); }
  void process(Frame&) override {}

 private:
  LatchedOutput<RelationModel> out_{*this, "model", ""};
};

class Pass final : public Stage {
 public:
  std::string summary() const override { return "gives what it takes"; }
  void process(Frame& frame) override {
    if (model_.get(frame)->id != kModel) throw Error("not our model");
    out_.put(frame, in_.get(frame));
  }

 private:
  Input<Cloud> in_{*this, "in", ""};
  LatchedInput<RelationModel> model_{*this, "model", ""};
  Output<Cloud> out_{*this, "out", ""};
};

// What the leaf has seen.
struct Seen {
  std::mutex mutex;
  std::vector<float> numbers;
};
Seen* seen = nullptr;

class Collect final : public Stage {
 public:
  std::string summary() const override { return "remembers what it takes"; }
  void process(Frame& frame) override {
    const float value = in_.get(frame).xyz.at(0);
    const std::scoped_lock lock(seen->mutex);
    seen->numbers.push_back(value);
  }

 private:
  Input<Cloud> in_{*this, "in", ""};
};

template <class S>
StageFactory factory() {
  return [] { return std::make_unique<S>(); };
}

const StageTable kTable{{"numbers", factory<Numbers>()},
                        {"provider", factory<Provider>()},
                        {"pass", factory<Pass>()},
                        {"collect", factory<Collect>()}};

constexpr std::uint64_t kWindow = 3;  // as in the graph
constexpr auto kGraph = R"(version: 1
graph: stranger
window: 3
deadline: 30
stages:
  numbers: {use: numbers, inputs: {model: provider/model}}
  provider: {use: provider}
  pass: {use: pass, inputs: {in: numbers/out, model: provider/model}}
  collect: {use: collect, inputs: {in: pass/out}}
)";

class Stranger : public testing::Test {
 protected:
  void SetUp() override {
    seen = &seen_;
    std::vector<Fault> faults;
    graph_ = parse(kGraph, "test.yaml", faults);
    ASSERT_TRUE(faults.empty());
    graph_.instance = "stranger-" + std::to_string(::getpid());
    graph_.one_process = true;
    stranger_ = std::make_unique<Participant>(graph_, "stranger");
    observer_ = std::make_unique<Observer>(graph_);
    for (const auto& [topic, type] : std::initializer_list<std::pair<const char*, const char*>>{
             {"numbers/out", "Cloud"},
             {"pass/out", "Cloud"},
             {"provider/model", "RelationModel"},
             {"frame_failure", "FrameFailure"},
             {"frame_done", "FrameDone"},
             {"stream_end", "StreamEnd"},
             {"stage_status", "StageStatus"},
             {"command", "Command"}})
      writers_[topic] = stranger_->writer(control_topic(graph_, topic), type, {.depth = 8});
    for (const auto& node : graph_.stages)
      runners_[node.name] = std::make_unique<StageRunner>(graph_, node.name, kTable.at(node.use)(),
                                                          RunnerOptions{.leaves = {"collect"}});
  }

  void TearDown() override {
    for (const auto& [name, runner] : runners_) runner->request_stop();
    runners_.clear();
    seen = nullptr;
  }

  bool over() const {
    const idl::State state = runners_.at("numbers")->status().state;
    return state == idl::State::finished || state == idl::State::failed;
  }

  // The header of the frame that was admitted last, once there is one.
  // Once everybody hears what the stranger writes.
  FrameHeader newest_frame() {
    const auto is_heard = [](const auto& writer) { return writer.second->matched() > 0; };
    for (;;) {
      const auto stages = observer_->stages();
      const auto source = stages.find("numbers");
      if (source != stages.end() && source->second.status.account.admitted > 0 &&
          std::ranges::all_of(writers_, is_heard)) {
        FrameHeader header = source->second.header;
        header.model_id = kModel;
        return header;
      }
      observer_->wait(50ms);
    }
  }

  void await_end() {
    while (!over()) observer_->wait(50ms);
  }

  idl::Account account() const { return runners_.at("numbers")->status().account; }

  std::string failure_of(std::uint64_t sequence) {
    for (int i = 0; i < 100; ++i, observer_->wait(50ms))
      for (const auto& failure : observer_->failures())
        if (failure.sequence == sequence) return failure.stage + ": " + failure.reason;
    return "";
  }

  void expect_all_but(const std::vector<std::uint64_t>& lost) {
    std::vector<float> expected;
    for (std::uint64_t i = 0; i < kFrames; ++i)
      if (std::ranges::find(lost, i) == lost.end()) expected.push_back(static_cast<float>(i));
    EXPECT_EQ(seen_.numbers, expected);
    EXPECT_EQ(account().admitted, kFrames);
    EXPECT_EQ(account().labelled, kFrames - lost.size());
    EXPECT_EQ(account().failed, lost.size());
  }

  void write(const std::string& topic, const idl::Bytes& bytes) {
    writers_.at(topic)->write(bytes);
  }

  GraphDescription graph_;
  Seen seen_;
  std::unique_ptr<Participant> stranger_;
  std::unique_ptr<Observer> observer_;
  std::map<std::string, std::unique_ptr<Writer>> writers_;
  std::map<std::string, std::unique_ptr<StageRunner>> runners_;
};

idl::Bytes noise(Random& random) {
  idl::Bytes bytes(4 + random.below(200));
  for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random.next());
  if (random.below(2) == 0) bytes[0] = bytes[2] = bytes[3] = 0, bytes[1] = 1;  // as if it were CDR
  return bytes;
}

// A whole message of the topic's type, that the stage of that name could have written.
idl::Bytes message_on(const std::string& topic, const FrameHeader& header) {
  if (topic == "provider/model") return idl::encode(header, model_of(header.model_id));
  if (topic == "frame_failure") return idl::encode(header, idl::FrameFailure{"made up"});
  if (topic == "frame_done") return idl::encode(header, idl::FrameDone{idl::Outcome::failed});
  if (topic == "stream_end") return idl::encode(header, idl::StreamEnd{1});
  if (topic == "stage_status") return idl::encode(header, idl::StageStatus{.replica = 1U << 31U});
  if (topic == "command") return idl::encode(header, idl::Command{.verb = "drain"});
  return idl::encode(header, number(std::nanf("")));
}

TEST_F(Stranger, NoiseAndDamagedMessagesChangeNothing) {
  Random random(1);
  const FrameHeader header = newest_frame();
  while (!over()) {
    for (const auto& [topic, writer] : writers_) {
      writer->write(noise(random));
      idl::Bytes damaged = message_on(topic, header);
      // Behind the header a length may become any: it is the last that is damaged.
      std::fill_n(damaged.end() - 8, 4, static_cast<std::uint8_t>(0xff));
      damaged.resize(damaged.size() - 1 - random.below(damaged.size() / 2));
      if (topic != "numbers/out" && topic != "pass/out") writer->write(damaged);
    }
    std::this_thread::sleep_for(2ms);
  }
  expect_all_but({});
}

TEST_F(Stranger, MessagesOfStagesThatDoNotFeedAPortChangeNothing) {
  FrameHeader header = newest_frame();
  header.stage = "nobody";
  while (!over()) {
    for (const std::uint64_t ahead : {1U, 2U, 5U, 100U})
      for (const auto& [topic, writer] : writers_) {
        FrameHeader claimed = header;
        claimed.sequence = header.sequence + ahead;
        claimed.epoch = header.epoch + ahead % 2;
        writer->write(message_on(topic, claimed));
      }
    header.sequence += 2;
    std::this_thread::sleep_for(2ms);
  }
  expect_all_but({});
}

TEST_F(Stranger, FramesOfAPastEpochAndFramesThatWereChangeNothing) {
  FrameHeader header = newest_frame();
  header.stage = "numbers";
  for (const auto first = header.sequence; header.sequence <= first + kWindow && !over();)
    header.sequence = newest_frame().sequence;
  header.sequence -= kWindow + 1;  // which is over, by the window
  while (!over()) {
    FrameHeader past = header;
    past.epoch = 5;
    past.sequence += kWindow + 3;
    write("numbers/out", message_on("numbers/out", past));
    write("numbers/out", message_on("numbers/out", header));
    std::this_thread::sleep_for(2ms);
  }
  expect_all_but({});
}

// Nor does an epoch that none could follow.
TEST_F(Stranger, EpochThatNoClockShowsIsNotBelieved) {
  FrameHeader header = newest_frame();
  header.epoch = ~std::uint64_t{0};
  for (const char* topic : {"numbers/out", "stream_end", "stage_status"}) {
    header.stage = "numbers";
    write(topic, message_on(topic, header));
  }
  await_end();
  expect_all_but({});
}

TEST_F(Stranger, FloodOfFramesToComeIsBoundedAndLeavesTheOthersAlone) {
  FrameHeader header = newest_frame();
  header.stage = "numbers";
  const std::uint64_t first = kFrames + 1000;
  std::uint64_t most = 0;
  for (std::uint64_t i = 0; i < 3000; ++i) {
    header.sequence = first + i;
    write("numbers/out", message_on("numbers/out", header));
    if (i % 100 == 0) most = std::max(most, runners_.at("pass")->status().queue);
  }
  EXPECT_GT(most, 0U) << "the flood did arrive";
  EXPECT_LE(runners_.at("pass")->status().queue, 1024U);
  await_end();
  expect_all_but({});
}

// Without security nobody can tell who wrote a message that claims a frame to come. The frame
// fails, by name; the others do not.
TEST_F(Stranger, FrameThatIsTakenByADamagedMessageFails) {
  FrameHeader header = newest_frame();
  header.stage = "numbers";
  header.sequence = kFrames - 1;
  idl::Bytes whole = message_on("numbers/out", header);
  whole.resize(whole.size() - 3);
  write("numbers/out", whole);
  header.sequence = kFrames - 2;
  write("numbers/out",
        idl::encode(header, Cloud{.xyz = {1, 2, 3}, .scale = std::nanf(""), .width = 1}));
  await_end();
  EXPECT_THAT(failure_of(kFrames - 1), HasSubstr("pass: Cloud message is truncated"));
  EXPECT_THAT(failure_of(kFrames - 2), HasSubstr("pass: Cloud message: scale is not positive"));
  expect_all_but({kFrames - 2, kFrames - 1});
}

TEST_F(Stranger, FrameOfAModelThatDoesNotExistFails) {
  FrameHeader header = newest_frame();
  header.stage = "numbers";
  header.sequence = kFrames - 1;
  header.model_id = 999;
  write("numbers/out", message_on("numbers/out", header));
  await_end();
  EXPECT_THAT(failure_of(kFrames - 1), HasSubstr("model 999 has not arrived"));
  expect_all_but({kFrames - 1});
}

TEST_F(Stranger, DamagedModelDoesNotReplaceTheOneThatIsThere) {
  FrameHeader header = newest_frame();
  header.stage = "provider";
  RelationModel odd = model_of(kModel);
  odd.neighbours = {1, 9, 0, 1};
  write("provider/model", idl::encode(header, odd));
  idl::Bytes truncated = message_on("provider/model", header);
  truncated.resize(truncated.size() - 2);
  write("provider/model", truncated);
  await_end();
  expect_all_but({});
}

}  // namespace
}  // namespace cosegraph::graph
