#include "graph/join.hpp"

#include <gtest/gtest.h>

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

TEST(Join, RestartedStageBeginsWithTheFirstFrameItCanComplete) {
  Join join({"a", "b"}, true);
  join.add("a", frame(6), sample());
  join.add("a", frame(7), sample());
  EXPECT_FALSE(join.ready()) << "b may still have older frames to give";
  join.add("b", frame(7), sample());
  EXPECT_EQ(join.take()->header.sequence, 7U);
  join.add("a", frame(9), sample());
  join.add("b", frame(9), sample());
  EXPECT_FALSE(join.ready()) << "from here on without gaps";
}

}  // namespace
}  // namespace cosegraph::graph
