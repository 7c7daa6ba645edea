// Files of whole recordings: graph, topics, completeness, splitting, the newest seconds.
#include "tools/recording/recording.hpp"

#include <gmock/gmock.h>

#include <random>

#include "io/file.hpp"

namespace cosegraph::recording {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const std::vector<Topic> kTopics{
    {.name = "g/source/out", .type = "Cloud", .stage = "source", .upstream = {"source"}},
    {.name = "g/model/m",
     .type = "RelationModel",
     .stage = "model",
     .latched = true,
     .taken = true},
    {.name = "g/frame_failure", .type = "FrameFailure"},
    {.name = "g/stream_end", .type = "StreamEnd"}};
enum : std::size_t { kOut, kModel, kFailure, kEnd };

// Points that do not compress.
Entry frame(std::uint64_t sequence, std::size_t points = 1) {
  std::mt19937 random(static_cast<std::uint32_t>(sequence));
  Cloud cloud{.width = static_cast<std::uint32_t>(points)};
  for (std::size_t i = 0; i < 3 * points; ++i)
    cloud.xyz.push_back(std::uniform_real_distribution<float>(0, 1)(random));
  return {.topic = kOut,
          .time = 1000 + 10 * sequence,
          .sample = std::make_shared<idl::Bytes>(
              idl::encode({.stage = "source", .epoch = 5, .sequence = sequence}, cloud))};
}

Entry model(std::uint64_t id, std::uint64_t time) {
  return {.topic = kModel,
          .time = time,
          .sample = std::make_shared<idl::Bytes>(
              idl::encode({.stage = "model", .model_id = id},
                          RelationModel{.id = id, .label_names = {"a"}, .neighbours = {1}}))};
}

class RecordingTest : public testing::Test {
 protected:
  static graph::GraphDescription graph() {
    std::vector<graph::Fault> faults;
    return graph::parse("version: 1\ngraph: g\nwindow: 7\nstages: {source: {use: source}}\n",
                        "g.yaml", faults);
  }
  std::filesystem::path file(const std::string& name = "x.mcap") const { return folder_ / name; }
  static std::vector<std::uint64_t> no_loss() { return std::vector<std::uint64_t>(kTopics.size()); }

  // Sequence numbers (or model ids) and log times of a topic.
  static std::vector<std::pair<std::uint64_t, std::uint64_t>> messages_of(
      const std::filesystem::path& file, std::size_t topic) {
    const McapReader reader(file);
    EXPECT_EQ(reader.damage(), "");
    std::vector<std::pair<std::uint64_t, std::uint64_t>> result;
    for (auto messages = reader.messages(); const auto message = messages.next();) {
      if (reader.channels().at(message->channel).topic != kTopics[topic].name) continue;
      const idl::FrameHeader header = idl::decode_header(message->data);
      result.emplace_back(topic == kModel ? header.model_id : header.sequence, message->log_time);
    }
    return result;
  }

  const io::TemporaryFolder folder_;
};

TEST_F(RecordingTest, HoldsGraphTopicsAndCompleteness) {
  Recording recording(file(), graph(), kTopics);
  recording.write(model(7, 900));
  for (std::uint64_t i = 0; i < 3; ++i) recording.write(frame(i));
  recording.close("stopped", {2, 0, 0, 0});
  EXPECT_THAT(recording.files(), ElementsAre(file()));

  const McapReader reader(file());
  EXPECT_EQ(graph_in(reader).window, 7);
  std::vector<Topic> topics;
  for (const auto& [id, topic] : topics_in(reader)) topics.push_back(topic);
  EXPECT_EQ(topics, kTopics);
  const Completeness found = completeness_in(reader);
  EXPECT_EQ(found, recording.completeness());
  EXPECT_EQ(found.ended, "stopped");
  EXPECT_EQ(found.topics.at("g/source/out").lost, 2U);
  EXPECT_FALSE(found.has_all());
}

TEST_F(RecordingTest, CutOffFileTellsWhatItLacks) {
  {
    Recording recording(file(), graph(), kTopics);
    for (const std::uint64_t i : {0, 1, 2, 4, 5}) recording.write(frame(i));
    recording.flush();
  }
  const McapReader reader(file());
  EXPECT_NE(reader.damage(), "");
  const Completeness found = completeness_in(reader);
  EXPECT_EQ(found.ended, "");
  EXPECT_THAT(found.topics.at("g/source/out").missing, ElementsAre(Range{5, 3, 3}));
}

TEST_F(RecordingTest, SplitFilesCanBeUsedAlone) {
  Recording recording(file(), graph(), kTopics, {.max_size = 40'000, .split = true});
  recording.write(model(6, 900));
  recording.write(model(7, 901));
  recording.write(model(8, 902));
  for (std::uint64_t i = 0; i < 20; ++i) recording.write(frame(i, 500));
  recording.close("stopped", no_loss());
  ASSERT_THAT(recording.files(), SizeIs(testing::Gt(2U)));
  EXPECT_EQ(recording.files()[1], file("x_1.mcap"));
  std::vector<std::uint64_t> sequences;
  for (std::size_t k = 0; k < recording.files().size(); ++k) {
    const auto frames = messages_of(recording.files()[k], kOut);
    ASSERT_FALSE(frames.empty());
    EXPECT_LE(std::filesystem::file_size(recording.files()[k]), 60'000U) << "with its summary";
    for (const auto& [sequence, time] : frames) sequences.push_back(sequence);
    if (k > 0) {
      EXPECT_THAT(messages_of(recording.files()[k], kModel),
                  ElementsAre(std::pair(7, frames[0].second), std::pair(8, frames[0].second)));
    }
    EXPECT_EQ(graph_in(McapReader(recording.files()[k])).graph, "g");
  }
  ASSERT_THAT(sequences, SizeIs(20));
  for (std::uint64_t i = 0; i < 20; ++i) EXPECT_EQ(sequences[i], i);
  EXPECT_THAT(completeness_in(McapReader(recording.files()[0])).ended, HasSubstr("next file"));
  EXPECT_TRUE(recording.completeness().has_all());
}

TEST_F(RecordingTest, IsFullAtItsSize) {
  Recording recording(file(), graph(), kTopics, {.max_size = 100'000});
  std::uint64_t count = 0;
  for (; !recording.full(); ++count) recording.write(frame(count, 500));
  recording.close("full", no_loss());
  EXPECT_GT(count, 1U);
  EXPECT_THAT(messages_of(file(), kOut), SizeIs(count));
}

TEST_F(RecordingTest, FilesOfOthersAreToldApart) {
  {
    McapWriter writer(file());
    writer.add_channel("scan", writer.add_schema("sensor_msgs/Scan", "ros2msg", ""), "cdr");
    writer.close();
  }
  const McapReader reader(file());
  try {
    topics_in(reader);
    FAIL() << "read";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("x.mcap: channel scan was not recorded by cosegraph"));
  }
  EXPECT_THROW(graph_in(reader), InputError);
}

// -- Ring ----------------------------------------------------------------------------------------

std::vector<bool> latched() {
  return {false, true, false, false};
}

TEST(Ring, KeepsWhatIsYoungEnough) {
  Ring ring(latched(), 50, 1U << 20U);
  EXPECT_THAT(ring.entries(), IsEmpty());
  for (std::uint64_t i = 0; i < 20; ++i) ring.push(frame(i));
  std::vector<std::uint64_t> times;
  for (const auto& entry : ring.entries()) times.push_back(entry.time);
  EXPECT_THAT(times, ElementsAre(1140, 1150, 1160, 1170, 1180, 1190));
  EXPECT_FALSE(ring.was_full());
}

TEST(Ring, KeepsTheNewestModelsHoweverOld) {
  Ring ring(latched(), 50, 1U << 20U);
  for (std::uint64_t id = 1; id <= 3; ++id) ring.push(model(id, id));
  for (std::uint64_t i = 0; i < 20; ++i) ring.push(frame(i));
  const auto entries = ring.entries();
  ASSERT_THAT(entries, SizeIs(8));
  EXPECT_EQ(idl::decode_header(*entries[0].sample).model_id, 2U);
  EXPECT_EQ(idl::decode_header(*entries[1].sample).model_id, 3U);
  EXPECT_EQ(entries[0].time, 1140U) << "of the first message that is kept";
}

TEST(Ring, KeepsNoMoreThanItsMemory) {
  const std::uint64_t size = frame(0).sample->size();
  Ring ring(latched(), 1'000'000, 4 * size);
  for (std::uint64_t i = 0; i < 20; ++i) ring.push(frame(i));
  EXPECT_THAT(ring.entries(), SizeIs(4));
  EXPECT_TRUE(ring.was_full());
  Ring tiny(latched(), 1'000'000, 1);
  tiny.push(frame(0));
  EXPECT_THAT(tiny.entries(), SizeIs(1)) << "the newest is always there";
}

}  // namespace
}  // namespace cosegraph::recording
