#include "graph/join.hpp"

#include <gtest/gtest.h>

#include <set>

#include "core/random.hpp"

namespace cosegraph::graph {
namespace {

using Kind = Join::Released::Kind;

idl::FrameHeader frame(std::uint64_t sequence, std::uint64_t epoch = 1) {
  return {.epoch = epoch, .sequence = sequence};
}

Sample sample() {
  return std::make_shared<const idl::Bytes>();
}

TEST(Join, FrameIsReleasedOnceAllPortsHaveDelivered) {
  Join join({"a", "b"});
  join.add("a", frame(0), sample());
  EXPECT_FALSE(join.take());
  join.add("b", frame(0), sample());
  const auto released = join.take();
  ASSERT_TRUE(released);
  EXPECT_EQ(released->kind, Kind::frame);
  EXPECT_EQ(released->inputs.size(), 2U);
  EXPECT_FALSE(join.take());
}

// Whatever the order of arrival, and however often a message comes, each frame is released exactly
// once and in sequence.
TEST(Join, ReleasesInSequenceForAnyOrderOfArrival) {
  Random random(5);
  for (int round = 0; round < 200; ++round) {
    const std::vector<std::string> ports{"a", "b", "c"};
    std::vector<std::pair<std::string, std::uint64_t>> messages;
    for (std::uint64_t sequence = 0; sequence < 8; ++sequence)
      for (const auto& port : ports)
        for (std::size_t copy = 0; copy <= random.below(2); ++copy)
          messages.emplace_back(port, sequence);
    random.shuffle(std::span(messages));
    Join join(ports);
    std::vector<std::uint64_t> released;
    for (const auto& [port, sequence] : messages) {
      join.add(port, frame(sequence), sample());
      while (const auto next = join.take()) released.push_back(next->header.sequence);
    }
    EXPECT_EQ(released, (std::vector<std::uint64_t>{0, 1, 2, 3, 4, 5, 6, 7}));
    EXPECT_EQ(join.waiting(), 0U);
  }
}

TEST(Join, TombstoneReleasesAFrameThatWillNeverBeComplete) {
  Join join({"a", "b"});
  join.add("a", frame(0), sample());
  join.fail(frame(0), "cpc", "no supervoxels");
  join.add("a", frame(1), sample());
  join.add("b", frame(1), sample());
  const auto failed = join.take();
  ASSERT_TRUE(failed);
  EXPECT_EQ(failed->kind, Kind::failed);
  EXPECT_EQ(failed->failed_stage, "cpc");
  EXPECT_EQ(failed->reason, "no supervoxels");
  EXPECT_EQ(join.take()->kind, Kind::frame);
}

TEST(Join, InputThatArrivesAfterItsTombstoneIsIgnored) {
  Join join({"a"});
  join.fail(frame(0), "source", "timeout");
  EXPECT_EQ(join.take()->kind, Kind::failed);
  join.add("a", frame(0), sample());
  EXPECT_FALSE(join.take());
  EXPECT_EQ(join.ignored(), 1U);
}

TEST(Join, EndComesAfterTheLastFrameEvenIfAnnouncedFirst) {
  Join join({"a"});
  join.end(frame(2), 2);
  join.add("a", frame(1), sample());
  EXPECT_FALSE(join.ready());
  join.add("a", frame(0), sample());
  EXPECT_EQ(join.take()->header.sequence, 0U);
  EXPECT_EQ(join.take()->header.sequence, 1U);
  EXPECT_EQ(join.take()->kind, Kind::ended);
  EXPECT_FALSE(join.take()) << "the end is released once";
}

TEST(Join, EmptyStreamEndsAtOnce) {
  Join join({"a"});
  join.end(frame(0), 0);
  EXPECT_EQ(join.take()->kind, Kind::ended);
}

TEST(Join, NewEpochForgetsTheOldOne) {
  Join join({"a", "b"});
  join.add("a", frame(0, 1), sample());
  join.add("a", frame(0, 2), sample());
  join.add("b", frame(0, 1), sample());
  EXPECT_FALSE(join.ready()) << "inputs of two epochs must not meet";
  join.add("b", frame(0, 2), sample());
  EXPECT_EQ(join.take()->header.epoch, 2U);
}

using Start = JoinOptions::Start;

// Releases everything that is ready; the sequences.
std::vector<std::uint64_t> all_ready(Join& join) {
  std::vector<std::uint64_t> result;
  while (const auto next = join.take())
    if (next->kind != Kind::ended) result.push_back(next->header.sequence);
  return result;
}

using Sequences = std::vector<std::uint64_t>;

TEST(Join, RestartedStageGoesOnBehindTheFramesThatAreOver) {
  Join join({"a", "b"}, {.start = Start::resume});
  for (std::uint64_t sequence = 4; sequence < 9; ++sequence) {
    join.add("a", frame(sequence), sample());
    join.add("b", frame(sequence), sample());
  }
  EXPECT_FALSE(join.ready()) << "some of these may be over";
  join.settle({1, 6});
  EXPECT_EQ(all_ready(join), (Sequences{6, 7, 8}));
  join.add("a", frame(5), sample());
  EXPECT_EQ(join.ignored(), 1U);
}

TEST(Join, RestartedStageWaitsForWhatUpstreamHasToDoAgain) {
  Join join({"a"}, {.start = Start::resume});
  join.settle({1, 6});
  join.add("a", frame(7), sample());
  EXPECT_FALSE(join.ready());
  join.add("a", frame(6), sample());
  EXPECT_EQ(all_ready(join), (Sequences{6, 7}));
}

TEST(Join, WithoutWordFromTheSourceTheFirstFrameThatCanBeCompletedIsNext) {
  Join join({"a", "b"}, {.start = Start::resume});
  join.resume_anyway();
  join.add("a", frame(6), sample());
  join.add("a", frame(7), sample());
  EXPECT_FALSE(join.ready()) << "b may still have older frames to give";
  join.add("b", frame(7), sample());
  EXPECT_EQ(join.take()->header.sequence, 7U);
  join.add("a", frame(9), sample());
  join.add("b", frame(9), sample());
  EXPECT_FALSE(join.ready()) << "from here on without gaps";
}

TEST(Join, FramesThatAreOverForEverybodyAreNotWaitedFor) {
  Join join({"a"});
  join.add("a", frame(0), sample());
  join.add("a", frame(3), sample());
  EXPECT_EQ(all_ready(join), (Sequences{0}));
  join.settle({1, 3});
  EXPECT_EQ(all_ready(join), (Sequences{3}));
}

TEST(Join, WordOfANewEpochEndsTheOldOne) {
  Join join({"a"});
  join.add("a", frame(0, 1), sample());
  join.settle({2, 0});
  EXPECT_FALSE(join.ready());
  join.add("a", frame(0, 2), sample());
  EXPECT_TRUE(join.ready());
}

TEST(Join, StandbyReleasesNothingUntilItIsToldWhereToBegin) {
  Join join({"a"}, {.start = Start::standby});
  for (std::uint64_t sequence = 0; sequence < 6; ++sequence)
    join.add("a", frame(sequence), sample());
  join.settle({1, 2});
  EXPECT_FALSE(join.ready());
  join.activate({1, 4});
  EXPECT_EQ(join.position(), (StreamPosition{1, 4}));
  EXPECT_EQ(all_ready(join), (Sequences{4, 5}));
}

TEST(Join, StandbyIsBoundedByTheWindow) {
  Join join({"a"}, {.start = Start::standby, .window = 3});
  for (std::uint64_t sequence = 0; sequence < 1000; ++sequence)
    join.add("a", frame(sequence), sample());
  EXPECT_LE(join.waiting(), 8U);
  join.activate({1, 998});
  EXPECT_EQ(all_ready(join), (Sequences{998, 999}));
}

// The one that was to be replaced died: everything that is not over is done again.
TEST(Join, StandbyWithoutAPositionDoesAllThatIsNotOver) {
  Join join({"a"}, {.start = Start::standby});
  for (std::uint64_t sequence = 0; sequence < 6; ++sequence)
    join.add("a", frame(sequence), sample());
  join.settle({1, 3});
  join.activate({});
  EXPECT_EQ(all_ready(join), (Sequences{3, 4, 5}));
}

TEST(Join, StandbyThatIsActivatedBeforeTheStreamBeginsTakesItFromTheBeginning) {
  Join join({"a"}, {.start = Start::standby});
  join.activate({});
  join.add("a", frame(0), sample());
  EXPECT_EQ(all_ready(join), (Sequences{0}));
}

// For any order of arrival the replicas together release every frame once, each in sequence.
TEST(Join, ReplicasShareFramesOut) {
  constexpr int kReplicas = 3;
  std::vector<Join> joins;
  for (int i = 0; i < kReplicas; ++i)
    joins.emplace_back(std::vector<std::string>{"a"},
                       JoinOptions{.window = 4, .replica = i, .replicas = kReplicas});
  std::multiset<std::uint64_t> released;
  for (std::uint64_t sequence = 0; sequence < 30; ++sequence)
    for (auto& join : joins) {
      join.add("a", frame(sequence), sample());
      const auto own = all_ready(join);
      released.insert(own.begin(), own.end());
    }
  EXPECT_EQ(released.size(), 30U);
  EXPECT_EQ(std::set<std::uint64_t>(released.begin(), released.end()).size(), 30U);
  for (auto& join : joins) {
    EXPECT_EQ(join.waiting(), 0U);
    join.end(frame(30), 30);
    EXPECT_EQ(join.take()->kind, Kind::ended);
  }
}

TEST(Join, FramesOfAReplicaThatIsGivenUpFallToTheNextOne) {
  Join join({"a"}, {.window = 8, .replica = 1, .replicas = 3});
  for (std::uint64_t sequence = 0; sequence < 6; ++sequence)
    join.add("a", frame(sequence), sample());
  EXPECT_EQ(all_ready(join), (Sequences{1, 4}));
  join.settle({1, 2});
  join.give_up(0, true);
  EXPECT_EQ(all_ready(join), (Sequences{3})) << "0 is over";
  join.add("a", frame(6), sample());
  join.add("a", frame(7), sample());
  EXPECT_EQ(all_ready(join), (Sequences{6, 7}));
  join.give_up(0, false);
  join.add("a", frame(9), sample());
  EXPECT_EQ(all_ready(join), (Sequences{})) << "9 is the returned one's";
}

// A stranger can claim any frame.
TEST(Join, OfFramesFarAheadOnlyTheNearestAreKept) {
  Join join({"a", "b"}, {.window = 3});
  for (std::uint64_t i = 0; i < 5000; ++i) join.add("a", frame(1'000'000 + i), sample());
  EXPECT_LE(join.waiting(), 1024U);
  EXPECT_EQ(join.ignored(), 5000 - join.waiting());
  for (std::uint64_t i = 0; i < 20; ++i)
    for (const char* port : {"a", "b"}) join.add(port, frame(i), sample());
  for (std::uint64_t i = 0; i < 20; ++i) {
    const auto released = join.take();
    ASSERT_TRUE(released) << i;
    EXPECT_EQ(released->header.sequence, i);
    EXPECT_EQ(released->inputs.size(), 2U);
  }
}

TEST(Join, OfLargeFramesFarAheadFewAreKept) {
  constexpr std::size_t kSize = 40U << 20U;
  const auto large = std::make_shared<const idl::Bytes>(kSize);  // shared: it costs once
  Join join({"a"}, {.window = 1});
  for (std::uint64_t i = 100; i < 200; ++i) join.add("a", frame(i), large);
  EXPECT_LE(join.waiting() * kSize, std::size_t{256} << 20U);
  join.add("a", frame(0), large);
  EXPECT_EQ(join.take()->header.sequence, 0U);
}

TEST(Join, FailuresFarAheadAreShedToo) {
  Join join({"a"}, {.window = 1});
  for (std::uint64_t i = 1; i < 3000; ++i) join.fail(frame(i), "x", "made up");
  EXPECT_LE(join.waiting(), 1024U);
}

// One that takes only its share drops what is behind the newest: it must not be led astray.
TEST(Join, ReplicaDoesNotFollowAFrameThatNoStreamCanHaveReached) {
  Join join({"a"}, {.window = 2, .replica = 0, .replicas = 2});
  join.settle({1, 0});
  join.add("a", frame(std::uint64_t{1} << 60U), sample());
  join.add("a", frame(0), sample());
  ASSERT_TRUE(join.ready());
  EXPECT_EQ(join.take()->header.sequence, 0U);
}

}  // namespace
}  // namespace cosegraph::graph
