#include "tools/monitor/recording_feed.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "core/error.hpp"
#include "io/file.hpp"
#include "tools/recording/recording.hpp"

namespace cosegraph::monitor {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

constexpr std::string_view kGraph =
    "version: 1\n"
    "graph: g\n"
    "stages:\n"
    "  source: {use: source, params: {path: x}}\n"
    "  cpc: {use: cpc, inputs: {cloud: source/out}}\n";

const std::vector<Topic> kTopics{
    {.name = "g/source/out", .type = "Cloud", .stage = "source", .taken = true},
    {.name = "g/cpc/segments", .type = "Segments", .stage = "cpc"},
    {.name = "g/cpc/model", .type = "RelationModel", .stage = "cpc", .latched = true},
    {.name = "g/stage_status", .type = "StageStatus"},
    {.name = "g/frame_failure", .type = "FrameFailure"}};

class RecordingFeedTest : public testing::Test {
 protected:
  template <class Value>
  void write(std::size_t topic, const idl::FrameHeader& header, const Value& value) {
    recording_.write({.topic = topic,
                      .time = ++time_,
                      .sample = std::make_shared<idl::Bytes>(idl::encode(header, value))});
  }

  static idl::FrameHeader frame(std::string stage, std::uint64_t sequence) {
    return {.graph = "g",
            .stage = std::move(stage),
            .epoch = 3,
            .sequence = sequence,
            .name = "f" + std::to_string(sequence)};
  }

  void write_frames(std::uint64_t count) {
    write(2, {.stage = "cpc"}, RelationModel{.id = 1, .label_names = {"a"}, .neighbours = {1}});
    for (std::uint64_t i = 0; i < count; ++i) {
      write(0, frame("source", i), Cloud{.xyz = {0, 0, 1, 0, 1, 1}, .width = 2});
      write(1, frame("cpc", i), Segments{.of_supervoxel = {0}, .of_point = {0, 0}, .count = 1});
      write(3, frame("cpc", i), idl::StageStatus{.state = idl::State::working, .frames_out = i});
    }
    write(4, frame("cpc", 1), idl::FrameFailure{"too flat"});
    recording_.close("asked to", std::vector<std::uint64_t>(kTopics.size()));
  }

  static std::vector<Message> messages(Feed& feed, const std::string& topic,
                                       std::optional<std::size_t> part = {}) {
    for (std::size_t i = 0; i < feed.channels().size(); ++i)
      if (feed.channels()[i].topic == topic) return feed.subscribe(i, part);
    ADD_FAILURE() << topic;
    return {};
  }
  static json state(Feed& feed) { return json::parse(*messages(feed, "g/monitor")[0].payload); }
  static std::string name_of(const Message& message) {
    return idl::decode_header(*message.payload).name;
  }

  const io::TemporaryFolder folder_;
  recording::Recording recording_{folder_ / "run.mcap", graph::parse(kGraph, "g.yaml"), kTopics};
  std::uint64_t time_ = 0;
};

TEST_F(RecordingFeedTest, HasItsTopicsFramesAndGraph) {
  write_frames(3);
  RecordingFeed feed(folder_ / "run.mcap");
  EXPECT_EQ(feed.name(), "run.mcap");
  EXPECT_THAT(messages(feed, "g/source/out"), SizeIs(3));
  EXPECT_TRUE(messages(feed, "g/source/out")[0].keep);
  EXPECT_THAT(messages(feed, "g/cpc/model"), SizeIs(1));
  EXPECT_THAT(messages(feed, "g/cpc/segments/points"), SizeIs(3));
  EXPECT_THAT(feed.channels()[0].schema, HasSubstr("struct Cloud"));

  const json all = state(feed);
  EXPECT_EQ(all["state"], "file");
  EXPECT_EQ(all["note"], "");
  EXPECT_EQ(all["stages"][1]["inputs"][0]["topic"], "g/source/out");
  EXPECT_EQ(all["stages"][1]["processes"][0]["frames_out"], 2);
  EXPECT_EQ(all["failures"][0]["reason"], "too flat");
}

// Of one that began in the middle of a stream. What was not done when it ended may tell why.
TEST_F(RecordingFeedTest, BeginsWithTheFirstFrameThatItHasWhole) {
  for (std::uint64_t i = 0; i < 4; ++i) {
    if (i > 0) write(0, frame("source", i), Cloud{.xyz = {0, 0, 1}, .width = 1});
    if (i < 3) write(1, frame("cpc", i), Segments{.of_point = {0}, .count = 1});
  }
  recording_.close("asked to", std::vector<std::uint64_t>(kTopics.size()));
  RecordingFeed feed(folder_ / "run.mcap");
  const json frames = state(feed)["frames"];
  ASSERT_THAT(frames, SizeIs(3));
  EXPECT_EQ(frames.front()["name"], "f1");
  EXPECT_EQ(frames.back()["name"], "f3");
  EXPECT_THAT(messages(feed, "g/cpc/segments"), SizeIs(2));
}

TEST_F(RecordingFeedTest, AnyPartOfALongOneCanBeHad) {
  constexpr std::uint64_t kCount = 2 * FrameIndex::kPartFrames + 30;
  write_frames(kCount);
  RecordingFeed feed(folder_ / "run.mcap");
  const json all = state(feed);
  ASSERT_THAT(all["frames"], SizeIs(kCount));
  EXPECT_EQ(all["frames"][109], (json{{"epoch", "3"},
                                      {"sequence", 109},
                                      {"name", "f109"},
                                      {"time", 0}}));  // ms of the recording's time
  EXPECT_EQ(all["parts"], (json{0, 40, 80}));
  EXPECT_EQ(all["first"], 0);
  ASSERT_EQ(feed.parts(), 3U);
  // In any order, all topics of it, and each frame once.
  std::vector<std::string> names(kCount);
  for (const std::size_t part : {2, 0, 1})
    for (const std::string topic : {"g/cpc/segments", "g/source/out", "g/cpc/segments/points"}) {
      const auto got = messages(feed, topic, part);
      ASSERT_THAT(got, SizeIs(part == 2 ? 30 : 40)) << topic;
      if (topic.ends_with("points")) continue;
      for (std::size_t i = 0; i < got.size(); ++i)
        EXPECT_EQ(name_of(got[i]), "f" + std::to_string(40 * part + i)) << topic;
    }
  EXPECT_THAT(messages(feed, "g/cpc/model", 2), SizeIs(1));
}

TEST_F(RecordingFeedTest, WhoAsksForNoPartGetsTheFramesFromTheFirst) {
  constexpr std::uint64_t kCount = RecordingFeed::kMaxFrames + 30;
  write_frames(kCount);
  RecordingFeed beginning(folder_ / "run.mcap");
  EXPECT_THAT(messages(beginning, "g/cpc/segments"), SizeIs(RecordingFeed::kMaxFrames));
  RecordingFeed end(folder_ / "run.mcap", kCount - 2);
  EXPECT_EQ(state(end)["first"], kCount - 2);
  const auto clouds = messages(end, "g/source/out");
  ASSERT_THAT(clouds, SizeIs(2));
  EXPECT_EQ(name_of(clouds[0]), "f148");
  EXPECT_THAT(messages(end, "g/cpc/model"), SizeIs(1));
  EXPECT_THROW(RecordingFeed(folder_ / "run.mcap", kCount), InputError);
}

TEST_F(RecordingFeedTest, OthersFilesAreRefusedByName) {
  io::write_file(folder_ / "other.mcap", "nonsense");
  try {
    const RecordingFeed feed(folder_ / "other.mcap");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("other.mcap"));
  }
}

}  // namespace
}  // namespace cosegraph::monitor
