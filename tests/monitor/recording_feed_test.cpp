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

  static std::vector<Message> messages(Feed& feed, const std::string& topic) {
    for (std::size_t i = 0; i < feed.channels().size(); ++i)
      if (feed.channels()[i].topic == topic) return feed.subscribe(i);
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

TEST_F(RecordingFeedTest, LongOnesAreShownInParts) {
  constexpr std::uint64_t kCount = RecordingFeed::kMaxFrames + 30;
  write_frames(kCount);
  RecordingFeed beginning(folder_ / "run.mcap");
  EXPECT_THAT(messages(beginning, "g/cpc/segments"), SizeIs(RecordingFeed::kMaxFrames));
  EXPECT_THAT(state(beginning)["note"].get<std::string>(), HasSubstr("Frames 0 to 119 of 150"));
  RecordingFeed end(folder_ / "run.mcap", kCount - 2);
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
