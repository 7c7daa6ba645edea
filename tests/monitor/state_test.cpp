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
using namespace std::chrono_literals;

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
  return {{.name = "g/camera/dense", .type = "Cloud", .stage = "camera"},
          {.name = "g/camera/cloud", .type = "Cloud", .stage = "camera"},
          {.name = "g/cpc/segments", .type = "Segments", .stage = "cpc"},
          {.name = "g/astar/labelling", .type = "Labelling", .stage = "astar"},
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

const GraphState::Time kNow{std::chrono::hours(1)};

graph::Observed observed(std::string stage, idl::StageStatus status,
                         GraphState::Time heard = kNow) {
  return {.header = {.stage = std::move(stage)}, .status = std::move(status), .heard = heard};
}

json json_of(const GraphState& state) {
  return json::parse(state.to_json(kNow, 5'000'000));
}

TEST(GraphState, FollowsTheRun) {
  GraphState state(small_graph(), small_topics());
  EXPECT_EQ(state.state(kNow), RunState::waiting);
  idl::StageStatus status{.state = idl::State::working, .account = {.admitted = 2}};
  state.hear({{"camera", observed("camera", status)}}, {});
  EXPECT_EQ(state.state(kNow + 1s), RunState::running);
  EXPECT_EQ(state.state(kNow + 9s), RunState::silent);
  status.state = idl::State::finished;
  state.hear({{"camera", observed("camera", status)}}, {});
  EXPECT_EQ(state.state(kNow + 99s), RunState::finished);
  state.end();
  EXPECT_EQ(state.state(kNow), RunState::ended);
}

TEST(GraphState, EveryNameOfAStateCanBeRead) {
  for (const auto& [state, name] : names<RunState>()) EXPECT_EQ(from_name<RunState>(name), state);
}

TEST(GraphState, ShowsEveryProcessOfAStage) {
  graph::GraphDescription graph = small_graph();
  graph.stages[1].replicas = {{.count = 2}};
  GraphState state(graph, small_topics());
  state.hear({{"cpc.0", observed("cpc", {.frames_out = 5})},
              {"cpc.1", observed("cpc", {.frames_out = 7}, kNow - 2s)}},
             {});
  const json all = json_of(state);
  ASSERT_THAT(all["stages"][1]["processes"], SizeIs(2));
  EXPECT_EQ(all["stages"][1]["processes"][1]["process"], "cpc.1");
  EXPECT_EQ(all["stages"][1]["processes"][1]["frames_out"], 7);
  EXPECT_EQ(all["stages"][1]["processes"][1]["heard_ms_ago"], 2000);
  EXPECT_THAT(all["stages"][0]["processes"], IsEmpty());
}

TEST(GraphState, TellsHowTheGraphIsWired) {
  const json all = json_of(GraphState(small_graph(), small_topics()));
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

TEST(GraphState, TellsParametersAndThoseOfASwappedStage) {
  graph::GraphDescription graph = small_graph();
  auto value = std::make_shared<double>(0.25);
  std::vector<graph::StageInfo> infos(3);
  infos[1].parameters = {number_field("cut", *value, 0.0, 1.0, "scale", "where to cut")};
  GraphState state(graph, small_topics(), infos);
  json param = json_of(state)["stages"][1]["params"][0];
  EXPECT_EQ(param["value"], "0.25");
  EXPECT_EQ(param["unit"], "scale");
  graph.stages[1].params = {{.name = "cut", .value = {"0.5"}}};
  state.change(graph, infos);
  param = json_of(state)["stages"][1]["params"][0];
  EXPECT_EQ(param["value"], "0.5");
  EXPECT_EQ(param["default"], "0.25");
}

TEST(GraphState, KeepsTheNewestFailuresAndCountsAll) {
  GraphState state(small_graph(), small_topics());
  std::vector<graph::ObservedFailure> failures;
  for (std::uint64_t i = 0; i < 300; ++i)
    failures.push_back({.stage = "cpc", .frame = "f", .sequence = i, .reason = "no \xff"});
  state.hear({}, failures);
  const json all = json_of(state);
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
