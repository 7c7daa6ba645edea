#include "tools/recording/completeness.hpp"

#include <gmock/gmock.h>

#include <random>
#include <set>

#include "core/error.hpp"

namespace cosegraph::recording {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

TEST(Runs, AreTheSetTheyWereMadeFrom) {
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    Runs runs;
    std::set<std::uint64_t> oracle;
    for (int i = 0; i < 60; ++i) {
      const std::uint64_t number = random() % 50;
      runs.add(number);
      oracle.insert(number);
    }
    std::set<std::uint64_t> found;
    std::uint64_t before = 0;
    for (const auto& [first, last] : runs.runs()) {
      ASSERT_LE(first, last);
      ASSERT_TRUE(found.empty() || first > before + 1) << "neighbours are one run";
      for (std::uint64_t number = first; number <= last; ++number) found.insert(number);
      before = last;
    }
    ASSERT_EQ(found, oracle) << "seed " << seed;
    for (std::uint64_t number = 0; number < 52; ++number)
      ASSERT_EQ(runs.contains(number), oracle.contains(number));
  }
}

// source/a and source/b, grow/c made of a; a model; the control topics.
const std::vector<Topic> kTopics{
    {.name = "g/source/a", .type = "Cloud", .stage = "source", .upstream = {"source"}},
    {.name = "g/source/b", .type = "Cloud", .stage = "source", .upstream = {"source"}},
    {.name = "g/grow/c", .type = "Scores", .stage = "grow", .upstream = {"source", "grow"}},
    {.name = "g/model/m",
     .type = "RelationModel",
     .stage = "model",
     .latched = true,
     .taken = true},
    {.name = "g/frame_failure", .type = "FrameFailure"},
    {.name = "g/stream_end", .type = "StreamEnd"}};
enum : std::size_t { kA, kB, kC, kModel, kFailure, kEnd };

class CompletenessTest : public testing::Test {
 protected:
  void add(std::size_t topic, std::uint64_t sequence, std::uint64_t epoch = 5) {
    const idl::FrameHeader header{
        .stage = kTopics[topic].stage, .epoch = epoch, .sequence = sequence};
    tally_.add(topic, idl::encode(header, idl::StreamEnd{}));  // only the header counts
  }
  void add_all(std::uint64_t first, std::uint64_t last, std::uint64_t epoch = 5) {
    for (std::uint64_t sequence = first; sequence <= last; ++sequence)
      for (const std::size_t topic : {kA, kB, kC}) add(topic, sequence, epoch);
  }
  void fail(const std::string& stage, std::uint64_t sequence) {
    const idl::FrameHeader header{.stage = stage, .epoch = 5, .sequence = sequence};
    tally_.add(kFailure, idl::encode(header, idl::FrameFailure{"why"}));
  }
  std::vector<Range> missing(std::size_t topic) const {
    return tally_.completeness().topics.at(kTopics[topic].name).missing;
  }

  static constexpr int kHistory = 4;  // frames
  Tally tally_{kTopics, kHistory};
};

TEST_F(CompletenessTest, WholeStreamIsComplete) {
  add_all(0, 9);
  EXPECT_FALSE(tally_.has_whole_stream());
  add(kEnd, 10);
  EXPECT_TRUE(tally_.has_whole_stream());
  const Completeness found = tally_.completeness();
  EXPECT_TRUE(found.has_all());
  EXPECT_THAT(found.stretches, ElementsAre(Stretch{.frames = {5, 0, 9}, .to_end = true}));
  EXPECT_EQ(found.topics.at("g/source/a").messages, 10U);
  EXPECT_GT(found.topics.at("g/source/a").bytes, 0U);
}

TEST_F(CompletenessTest, WhatNeverCameIsMissing) {
  add_all(0, 3);
  add(kA, 4);
  add(kB, 4);
  add_all(5, 7);
  EXPECT_THAT(missing(kC), ElementsAre(Range{5, 4, 4}));
  EXPECT_THAT(missing(kA), IsEmpty());
  EXPECT_FALSE(tally_.completeness().has_all());
  add(kEnd, 10);
  EXPECT_THAT(missing(kC), ElementsAre(Range{5, 4, 4}, Range{5, 8, 9}));
  EXPECT_THAT(missing(kA), ElementsAre(Range{5, 8, 9}));
  EXPECT_FALSE(tally_.has_whole_stream());
}

TEST_F(CompletenessTest, FramesThatFailedBeforeAreNotMissing) {
  add_all(0, 3);
  add(kA, 4);
  add(kB, 4);
  fail("grow", 4);
  fail("source", 5);
  add_all(6, 6);
  add(kEnd, 7);
  const Completeness found = tally_.completeness();
  EXPECT_TRUE(found.has_all());
  EXPECT_EQ(found.stretches.at(0).failed, 2U);
  EXPECT_TRUE(tally_.has_whole_stream());
}

TEST_F(CompletenessTest, FailuresDownstreamExcuseNothing) {
  add_all(0, 3);
  add(kC, 4);
  fail("grow", 4);
  add_all(5, 5);
  EXPECT_THAT(missing(kA), ElementsAre(Range{5, 4, 4}));
}

TEST_F(CompletenessTest, FramesInWorkAtBothEndsAreNotMissing) {
  for (std::uint64_t sequence = 3; sequence <= 12; ++sequence) add(kA, sequence);
  for (std::uint64_t sequence = 2; sequence <= 12; ++sequence) add(kB, sequence);
  for (std::uint64_t sequence = 1; sequence <= 9; ++sequence) add(kC, sequence);
  const Completeness found = tally_.completeness();
  EXPECT_TRUE(found.has_all());
  EXPECT_THAT(found.stretches, ElementsAre(Stretch{.frames = {5, 3, 9}, .from_start = false}));
}

// What was on its way when the recorder came may have made room for newer frames before it could be
// sent again.
TEST_F(CompletenessTest, BeginsInMidStreamAfterTheHolesOfItsBeginning) {
  for (std::uint64_t sequence = 3; sequence <= 12; ++sequence) {
    if (sequence != 5) add(kA, sequence);
    if (sequence != 4) add(kB, sequence);
    add(kC, sequence);
  }
  EXPECT_TRUE(tally_.completeness().has_all());
  EXPECT_THAT(tally_.completeness().stretches,
              ElementsAre(Stretch{.frames = {5, 6, 12}, .from_start = false}));
}

TEST_F(CompletenessTest, HolesLaterThanThatOrInAWholeStreamAreMissing) {
  for (std::uint64_t sequence = 3; sequence <= 12; ++sequence) {
    if (sequence < 6 || sequence > 9) add(kA, sequence);
    add(kB, sequence);
    add(kC, sequence);
  }
  EXPECT_THAT(missing(kA), ElementsAre(Range{5, 7, 9}));
  for (std::uint64_t sequence = 0; sequence < 3; ++sequence)
    for (const std::size_t topic : {kB, kC}) add(topic, sequence);
  add(kA, 0);
  EXPECT_THAT(missing(kA), ElementsAre(Range{5, 1, 2}, Range{5, 6, 9}));
}

TEST_F(CompletenessTest, TopicThatNeverSpokeInMidStreamIsNotPassedOver) {
  for (std::uint64_t sequence = 3; sequence <= 5; ++sequence) {
    add(kA, sequence);
    add(kB, sequence);
  }
  add(kEnd, 6);
  EXPECT_THAT(missing(kC), ElementsAre(Range{5, 3, 5}));
}

TEST_F(CompletenessTest, TopicThatNeverSpokeLacksTheWholeStream) {
  for (std::uint64_t sequence = 0; sequence <= 4; ++sequence) {
    add(kA, sequence);
    add(kB, sequence);
  }
  EXPECT_THAT(tally_.completeness().stretches, IsEmpty()) << "nothing has come through yet";
  add(kEnd, 5);
  EXPECT_THAT(missing(kC), ElementsAre(Range{5, 0, 4}));
}

TEST_F(CompletenessTest, OrderAndRepetitionDoNotMatter) {
  std::mt19937 random(1);
  std::vector<std::pair<std::size_t, std::uint64_t>> all;
  for (std::uint64_t sequence = 0; sequence < 40; ++sequence)
    for (const std::size_t topic : {kA, kB, kC}) all.insert(all.end(), 2, {topic, sequence});
  std::ranges::shuffle(all, random);
  add(kEnd, 40);
  for (const auto& [topic, sequence] : all) add(topic, sequence);
  EXPECT_TRUE(tally_.completeness().has_all());
  EXPECT_TRUE(tally_.has_whole_stream());
}

TEST_F(CompletenessTest, EpochsAreJudgedApart) {
  add_all(0, 3, 5);
  add_all(0, 1, 6);
  add(kA, 2, 6);
  add_all(3, 3, 6);
  const Completeness found = tally_.completeness();
  EXPECT_THAT(found.stretches, SizeIs(2));
  EXPECT_THAT(missing(kC), ElementsAre(Range{6, 2, 2}));
}

TEST_F(CompletenessTest, ModelsThatFramesNameButDidNotComeAreMissing) {
  const auto add_with_model = [&](std::size_t topic, std::uint64_t model) {
    const idl::FrameHeader header{.stage = kTopics[topic].stage, .epoch = 5, .model_id = model};
    tally_.add(topic, idl::encode(header, idl::StreamEnd{}));
  };
  for (const std::size_t topic : {kA, kB, kC}) add_with_model(topic, 7);
  add(kEnd, 1);
  EXPECT_THAT(tally_.completeness().topics.at("g/model/m").missing_models, ElementsAre(7));
  EXPECT_FALSE(tally_.completeness().has_all());
  EXPECT_FALSE(tally_.has_whole_stream());
  EXPECT_EQ(completeness_of(to_metadata(tally_.completeness())), tally_.completeness());
  add_with_model(kModel, 6);
  EXPECT_FALSE(tally_.has_whole_stream());
  add_with_model(kModel, 7);
  EXPECT_TRUE(tally_.has_whole_stream());
  EXPECT_TRUE(tally_.completeness().has_all());
}

TEST_F(CompletenessTest, EmptyStreamIsWhole) {
  add(kEnd, 0);
  EXPECT_TRUE(tally_.has_whole_stream());
  EXPECT_TRUE(tally_.completeness().has_all());
}

TEST_F(CompletenessTest, SurvivesItsMetadata) {
  add_all(0, 3);
  add(kA, 4);
  add_all(5, 7);
  Completeness before = tally_.completeness();
  before.ended = "stopped";
  before.topics.at("g/source/b").lost = 3;
  EXPECT_EQ(completeness_of(to_metadata(before)), before);
  Metadata damaged = to_metadata(before);
  damaged.values["topics"] = "{";
  EXPECT_THROW(completeness_of(damaged), InputError);
}

TEST_F(CompletenessTest, MessagesWithoutHeaderAreRefused) {
  EXPECT_THROW(tally_.add(kA, idl::Bytes(20, 0xff)), InputError);
}

}  // namespace
}  // namespace cosegraph::recording
