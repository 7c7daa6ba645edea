#include "tools/monitor/state.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tools/monitor/cloud_views.hpp"

namespace cosegraph::monitor {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr std::uint64_t kSecond = 1'000'000'000;

// camera -> cpc -> astar, and camera -> astar
graph::GraphDescription small_graph() {
  graph::GraphDescription graph;
  graph.graph = "g";
  graph.stages = {
      {.name = "camera", .use = "source"},
      {.name = "cpc", .use = "cpc", .inputs = {{"cloud", "camera", "dense", {}, {}}}},
      {.name = "astar",
       .use = "astar",
       .inputs = {{"segments", "cpc", "segments", {}, {}}, {"cloud", "camera", "cloud", {}, {}}}}};
  return graph;
}

std::vector<Topic> small_topics() {
  return {{.name = "g/camera/dense", .type = "Cloud", .stage = "camera", .port = "dense"},
          {.name = "g/camera/cloud", .type = "Cloud", .stage = "camera", .port = "cloud"},
          {.name = "g/cpc/segments", .type = "Segments", .stage = "cpc", .port = "segments"},
          {.name = "g/astar/labelling", .type = "Labelling", .stage = "astar", .port = "labelling"},
          {.name = "g/stage_status", .type = "StageStatus"}};
}

TEST(Topics, CloudsAResultCanBeAboutNearestFirst) {
  EXPECT_THAT(clouds_of(small_graph(), small_topics(), "cpc"), ElementsAre("g/camera/dense"));
  EXPECT_THAT(clouds_of(small_graph(), small_topics(), "astar"),
              ElementsAre("g/camera/cloud", "g/camera/dense"));
  EXPECT_THAT(clouds_of(small_graph(), small_topics(), "camera"), IsEmpty());
}

TEST(Topics, Readers) {
  EXPECT_THAT(readers_of(small_graph(), small_topics()[0]), ElementsAre("cpc"));
  EXPECT_THAT(readers_of(small_graph(), small_topics()[4]), IsEmpty());
}

TEST(GraphState, FollowsTheRun) {
  GraphState state(small_graph(), small_topics());
  EXPECT_EQ(state.state(kSecond), RunState::waiting);
  idl::StageStatus status{.state = idl::State::working, .account = {.admitted = 2}};
  state.add_status({.stage = "camera"}, status, kSecond);
  EXPECT_EQ(state.state(2 * kSecond), RunState::running);
  EXPECT_EQ(state.state(9 * kSecond), RunState::silent);
  status.state = idl::State::finished;
  state.add_status({.stage = "camera"}, status, 10 * kSecond);
  EXPECT_EQ(state.state(99 * kSecond), RunState::finished);
  state.end();
  EXPECT_EQ(state.state(99 * kSecond), RunState::ended);
}

TEST(GraphState, OldGenerationsAreNotShown) {
  GraphState state(small_graph(), small_topics());
  state.add_status({.stage = "cpc", .generation = 2}, {.frames_out = 5}, 1);
  state.add_status({.stage = "cpc", .generation = 1}, {.frames_out = 9}, 2);
  const json all = json::parse(state.to_json(3));
  EXPECT_EQ(all["stages"][1]["status"]["frames_out"], 5);
  EXPECT_EQ(all["stages"][1]["status"]["generation"], 2);
  EXPECT_TRUE(all["stages"][0]["status"].is_null());
}

TEST(GraphState, TellsHowTheGraphIsWired) {
  const json all = json::parse(GraphState(small_graph(), small_topics()).to_json(5'000'000));
  EXPECT_EQ(all["graph"], "g");
  EXPECT_EQ(all["state"], "waiting");
  EXPECT_EQ(all["time"], 5);
  EXPECT_EQ(all["stages"][2]["inputs"][0],
            (json{{"port", "segments"}, {"stage", "cpc"}, {"topic", "g/cpc/segments"}}));
  EXPECT_EQ(
      all["stages"][0]["outputs"][0],
      (json{
          {"port", "dense"}, {"topic", "g/camera/dense"}, {"type", "Cloud"}, {"latched", false}}));
}

TEST(GraphState, KeepsTheNewestFailuresAndCountsAll) {
  GraphState state(small_graph(), small_topics());
  for (std::uint64_t i = 0; i < 300; ++i)
    state.add_failure({.stage = "cpc", .sequence = i, .name = "f"}, {.reason = "no \xff"}, kSecond);
  const json all = json::parse(state.to_json(kSecond));
  EXPECT_EQ(all["failure_count"], 300);
  EXPECT_THAT(all["failures"], SizeIs(GraphState::kMaxFailures));
  EXPECT_EQ(all["failures"].back()["sequence"], 299);
}

Cloud cloud_of(std::size_t points) {
  return {.xyz = std::vector<float>(3 * points, 1.0F), .width = static_cast<std::uint32_t>(points)};
}

class Views : public testing::Test {
 protected:
  idl::FrameHeader frame(std::uint64_t sequence) const { return {.sequence = sequence}; }
  const std::vector<CloudView> views_ = cloud_views_of(small_graph(), small_topics());
  const std::vector<bool> all_ = std::vector<bool>(views_.size(), true);
  CloudViews joined_{views_, 3};
};

TEST_F(Views, WhatCanBeDrawn) {
  ASSERT_THAT(views_, SizeIs(4));
  EXPECT_EQ(views_[2].topic, "g/cpc/segments");
  EXPECT_THAT(views_[3].clouds, ElementsAre("g/camera/cloud", "g/camera/dense"));
}

TEST_F(Views, JoinsEitherWayRound) {
  const idl::Bytes segments =
      idl::encode(frame(1), Segments{.of_supervoxel = {0}, .of_point = {0, 0}, .count = 1});
  EXPECT_THAT(joined_.add("g/cpc/segments", segments, all_), IsEmpty());
  const auto drawn = joined_.add("g/camera/dense", idl::encode(frame(1), cloud_of(2)), all_);
  ASSERT_THAT(drawn, SizeIs(2));  // the cloud itself and the segments
  EXPECT_EQ(drawn[0].first, 0U);
  EXPECT_EQ(drawn[1].first, 2U);
  // The other way round, and each only once.
  const idl::Bytes labelling = idl::encode(frame(1), Labelling{.label_names = {"a"},
                                                               .segment_label = {0},
                                                               .segment_confidence = {1},
                                                               .point_label = {0, 0},
                                                               .point_confidence = {1, 1}});
  EXPECT_THAT(joined_.add("g/astar/labelling", labelling, all_), SizeIs(1));
  EXPECT_THAT(joined_.add("g/camera/cloud", idl::encode(frame(1), cloud_of(2)), all_), SizeIs(1));
}

TEST_F(Views, TakesTheCloudOfTheSameFrameAndSize) {
  const idl::Bytes segments =
      idl::encode(frame(1), Segments{.of_supervoxel = {0}, .of_point = {0, 0}, .count = 1});
  joined_.add("g/camera/dense", idl::encode(frame(2), cloud_of(2)), all_);
  EXPECT_THAT(joined_.add("g/cpc/segments", segments, all_), IsEmpty());
  EXPECT_THAT(joined_.add("g/camera/dense", idl::encode(frame(1), cloud_of(3)), all_), SizeIs(1));
}

TEST_F(Views, OldFramesAreForgotten) {
  const idl::Bytes segments =
      idl::encode(frame(1), Segments{.of_supervoxel = {0}, .of_point = {0, 0}, .count = 1});
  joined_.add("g/cpc/segments", segments, all_);
  for (std::uint64_t i = 2; i < 6; ++i)
    joined_.add("g/camera/dense", idl::encode(frame(i), cloud_of(2)), all_);
  EXPECT_THAT(joined_.add("g/camera/dense", idl::encode(frame(1), cloud_of(2)), all_), SizeIs(1));
}

TEST_F(Views, WhatNobodyWantsIsNotMade) {
  const std::vector<bool> none(views_.size(), false);
  EXPECT_THAT(joined_.add("g/camera/dense", idl::encode(frame(1), cloud_of(2)), none), IsEmpty());
}

TEST_F(Views, StrangersMessagesAreRefused) {
  EXPECT_THROW(joined_.add("g/camera/dense", {0, 1, 0, 0, 255}, all_), InputError);
}

}  // namespace
}  // namespace cosegraph::monitor
