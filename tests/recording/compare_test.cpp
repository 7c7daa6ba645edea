// A stage against its recorded outputs, without DDS.
#include "tools/recording/compare.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "graph/runtime.hpp"
#include "io/file.hpp"
#include "tools/recording/recording.hpp"

namespace cosegraph::recording {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using Verdict = FrameComparison::Verdict;

Cloud number(float value) {
  return {.xyz = {value, 0, 0}, .width = 1};
}

// out = a + b + 100 x model + offset
class Sum final : public graph::Stage {
 public:
  std::string summary() const override { return "adds"; }
  Fields parameters() override { return {number_field("offset", offset_, -10, 10, "", "added")}; }
  void process(graph::Frame& frame) override {
    const float a = a_.get(frame).xyz[0];
    if (a == throw_at_) throw InputError("no luck");
    out_.put(frame,
             number(a + b_.get(frame).xyz[0] + 100.0F * static_cast<float>(model_.get(frame)->id) +
                    static_cast<float>(offset_)));
  }
  float throw_at_ = -1.0F;

 private:
  graph::Input<Cloud> a_{*this, "a", ""};
  graph::Input<Cloud> b_{*this, "b", ""};
  graph::LatchedInput<RelationModel> model_{*this, "model", ""};
  graph::Output<Cloud> out_{*this, "out", ""};
  double offset_ = 0.0;
};

const std::vector<Topic> kTopics{
    {.name = "g/source/a", .type = "Cloud", .stage = "source", .upstream = {"source"}},
    {.name = "g/other/b", .type = "Cloud", .stage = "other", .upstream = {"other", "source"}},
    {.name = "g/model/m",
     .type = "RelationModel",
     .stage = "model",
     .latched = true,
     .taken = true},
    {.name = "g/sum/out", .type = "Cloud", .stage = "sum", .upstream = {"other", "source", "sum"}},
    {.name = "g/frame_failure", .type = "FrameFailure"}};
enum : std::size_t { kA, kB, kModel, kOut, kFailure };

constexpr auto kGraph = R"(version: 1
graph: g
window: 2
stages:
  source: {use: source}
  other: {use: other, inputs: {in: source/a}}
  model: {use: model}
  sum: {use: sum, inputs: {a: source/a, b: other/b, model: model/m}}
)";

class CompareTest : public testing::Test {
 protected:
  CompareTest() {
    std::vector<graph::Fault> faults;
    graph_ = graph::parse(kGraph, "g.yaml", faults);
    recording_ = std::make_unique<Recording>(folder_ / "x.mcap", graph_, kTopics);
  }

  template <class Value>
  void write(std::size_t topic, std::uint64_t sequence, const Value& value) {
    const idl::FrameHeader header{.graph = "g",
                                  .stage = kTopics[topic].stage,
                                  .generation = topic == kOut ? 3U : 0U,
                                  .source = "source",
                                  .epoch = 5,
                                  .sequence = sequence,
                                  .model_id = 7,
                                  .name = "n" + std::to_string(sequence)};
    write(topic, header, value);
  }
  template <class Value>
  void write(std::size_t topic, const idl::FrameHeader& header, const Value& value) {
    recording_->write({.topic = topic,
                       .time = ++time_,
                       .sample = std::make_shared<idl::Bytes>(idl::encode(header, value))});
  }
  void write_model(std::uint64_t id) {
    write(kModel, {.stage = "model", .model_id = id},
          RelationModel{.id = id, .label_names = {"a"}, .neighbours = {1}});
  }
  // Inputs i and 10 i of a frame, and what sum made of them.
  void write_frame(std::uint64_t i) {
    const auto value = static_cast<float>(i);
    write(kA, i, number(value));
    write(kB, i, number(10 * value));
    write(kOut, i, number(11 * value + 700));
  }
  void fail(const std::string& stage, std::uint64_t sequence) {
    write(kFailure, {.stage = stage, .epoch = 5, .sequence = sequence, .name = "f"},
          idl::FrameFailure{"no luck"});
  }

  std::vector<FrameComparison> results(double tolerance = 0.0) {
    recording_->close("stopped", std::vector<std::uint64_t>(kTopics.size()));
    const McapReader reader(folder_ / "x.mcap");
    const StageWiring wiring =
        wiring_of(graph_, "sum", graph::info_of("sum", [] { return std::make_unique<Sum>(); }));
    StageFrames frames(reader, wiring, StageFrames::Want::inputs_and_outputs, graph_.window, 0,
                       std::numeric_limits<std::uint64_t>::max());
    std::vector<FrameComparison> result;
    while (const auto frame = frames.next())
      result.push_back(compare(*frame, wiring, stage_, tolerance));
    return result;
  }

  const io::TemporaryFolder folder_;
  graph::GraphDescription graph_;
  std::unique_ptr<Recording> recording_;
  Sum stage_;
  std::uint64_t time_ = 0;
};

std::vector<Verdict> verdicts(const std::vector<FrameComparison>& frames) {
  std::vector<Verdict> result;
  for (const auto& frame : frames) result.push_back(frame.verdict);
  return result;
}

TEST_F(CompareTest, UnchangedStageMakesTheSameBytes) {
  write_model(7);
  for (std::uint64_t i = 0; i < 5; ++i) write_frame(i);
  const auto found = results();
  EXPECT_THAT(found, SizeIs(5));
  for (const auto& frame : found) {
    EXPECT_EQ(frame.verdict, Verdict::identical) << frame.note;
    EXPECT_EQ(frame.name, "n" + std::to_string(frame.sequence));
  }
}

TEST_F(CompareTest, ChangedStageIsToldByMember) {
  write_model(7);
  write_frame(0);
  stage_.parameters()[0].set({"0.5"});
  const auto found = results();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].verdict, Verdict::differs);
  ASSERT_THAT(found[0].ports.at("out"), SizeIs(1));
  const Difference& one = found[0].ports.at("out")[0];
  EXPECT_EQ(one.member, "xyz");
  EXPECT_TRUE(one.is_real);
  EXPECT_EQ(one.changed, 1U);
  EXPECT_EQ(one.size, 3U);
  EXPECT_DOUBLE_EQ(one.largest, 0.5);
}

TEST_F(CompareTest, ToleranceIsForRealNumbers) {
  write_model(7);
  write_frame(0);
  stage_.parameters()[0].set({"0.5"});
  EXPECT_THAT(verdicts(results(0.5)), ElementsAre(Verdict::identical));
}

TEST_F(CompareTest, FramesWithoutAllInputsAreNotComparable) {
  write_model(7);
  write_frame(0);
  write(kA, 1, number(1));
  write(kOut, 1, number(1));
  for (std::uint64_t i = 2; i < 9; ++i) write_frame(i);
  write(kA, 9, number(9));
  write(kB, 9, number(90));
  const auto found = results();
  ASSERT_THAT(found, SizeIs(10));
  for (std::uint64_t i = 0; i < 10; ++i) EXPECT_EQ(found[i].sequence, i);
  EXPECT_EQ(found[1].verdict, Verdict::not_comparable);
  EXPECT_EQ(found[1].note, "not recorded: b");
  EXPECT_EQ(found[2].verdict, Verdict::identical);
  EXPECT_EQ(found[9].note, "not recorded: what the stage gave");
}

TEST_F(CompareTest, FrameNeedsTheModelItWasWorkedOnWith) {
  write_model(6);
  write_model(8);
  write_frame(0);
  const auto found = results();
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].note, "not recorded: model");
}

TEST_F(CompareTest, ModelThatComesLateIsFound) {
  write_frame(0);
  write_model(7);
  write_model(8);
  EXPECT_THAT(verdicts(results()), ElementsAre(Verdict::identical));
}

TEST_F(CompareTest, FailureForTheSameReasonIsTheSame) {
  write_model(7);
  write(kA, 0, number(0));
  write(kB, 0, number(0));
  fail("sum", 0);
  write_frame(1);
  stage_.throw_at_ = 0.0F;
  EXPECT_THAT(verdicts(results()), ElementsAre(Verdict::identical, Verdict::identical));
}

TEST_F(CompareTest, NewAndGoneFailuresDiffer) {
  write_model(7);
  write(kA, 0, number(0));
  write(kB, 0, number(0));
  fail("sum", 0);
  write_frame(1);
  stage_.throw_at_ = 1.0F;
  const auto found = results();
  EXPECT_THAT(verdicts(found), ElementsAre(Verdict::differs, Verdict::differs));
  EXPECT_EQ(found[0].note, "failed then (no luck), does not fail now");
  EXPECT_EQ(found[1].note, "did not fail then, fails now (no luck)");
}

TEST_F(CompareTest, FramesThatFailedBeforeAreTold) {
  write_model(7);
  write(kA, 0, number(0));
  fail("other", 0);
  write_frame(1);
  const auto found = results();
  ASSERT_THAT(found, SizeIs(2));
  EXPECT_EQ(found[0].verdict, Verdict::not_comparable);
  EXPECT_EQ(found[0].note, "failed at other");
}

TEST_F(CompareTest, TopicsThatWereNotRecordedAreNamed) {
  Recording other(folder_ / "y.mcap", graph_, {kTopics[kA], kTopics[kOut], kTopics[kFailure]});
  other.close("stopped", std::vector<std::uint64_t>(3));
  const McapReader reader(folder_ / "y.mcap");
  const StageWiring wiring =
      wiring_of(graph_, "sum", graph::info_of("sum", [] { return std::make_unique<Sum>(); }));
  try {
    StageFrames(reader, wiring, StageFrames::Want::inputs_and_outputs, 2, 0, 1);
    FAIL() << "read";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("y.mcap: was recorded without g/other/b, g/model/m"));
  }
}

// -- differences ---------------------------------------------------------------------------------

template <class Value>
std::vector<Difference> differences_of(const Value& before, const Value& now) {
  return differences(idl::type_name<Value>(), idl::encode({}, before), idl::encode({}, now));
}

TEST(Differences, OfEqualMessagesAreNone) {
  const Cloud cloud{.xyz = {1, NAN, 3}, .width = 1};
  EXPECT_THAT(differences_of(cloud, cloud), IsEmpty()) << "a NaN is the same as itself";
}

TEST(Differences, CountLabelsAndSizes) {
  const Labelling before{.label_names = {"a", "b"}, .point_label = {0, 1, 1, 0}};
  const Labelling now{.label_names = {"a", "c"}, .point_label = {0, 0, 0, 0, 1}};
  const auto found = differences_of(before, now);
  ASSERT_THAT(found, SizeIs(2));
  EXPECT_EQ(found[0].member, "label_names");
  EXPECT_EQ(found[0].changed, 1U);
  EXPECT_EQ(found[1].member, "point_label");
  EXPECT_EQ(found[1].changed, 2U);
  EXPECT_EQ(found[1].size_before, 4U);
  EXPECT_EQ(found[1].size, 5U);
  EXPECT_FALSE(found[1].is_real);
}

TEST(Differences, FromWhatIsNotANumberAreInfinite) {
  const auto found =
      differences_of(Cloud{.xyz = {1, 2, 3}, .width = 1}, Cloud{.xyz = {1, NAN, 3}, .width = 1});
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_TRUE(std::isinf(found[0].largest));
}

TEST(Differences, TellMembersThatCameAndWent) {
  const Descriptors one{.channels = {{"fpfh", 1, {0}, {1}}}};
  const Descriptors none{};
  EXPECT_THAT(differences_of(one, none), SizeIs(4));
  EXPECT_EQ(differences_of(one, none)[0].size, 0U);
  EXPECT_EQ(differences_of(none, one)[0].size_before, 0U);
}

}  // namespace
}  // namespace cosegraph::recording
