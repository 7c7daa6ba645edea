#include "graph/topics.hpp"

#include <gmock/gmock.h>

#include <set>

#include "graph_description/fake_catalog.hpp"

namespace cosegraph::graph::test {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Not;

GraphDescription segment_graph() {
  std::vector<Fault> faults;
  return parse(kSegmentGraph, "graph.yaml", faults);
}

TopicRights rights(const Identity& identity) {
  return rights_of(segment_graph(), fake_catalog(), identity);
}

TEST(Rights, OfTheSource) {
  const TopicRights source = rights(Identity::of_stage("camera"));
  EXPECT_THAT(source.writes,
              ElementsAre("segment/camera/cloud", "segment/camera/dense", "segment/frame_failure",
                          "segment/stage_status", "segment/stream_end"));
  EXPECT_THAT(source.reads,
              ElementsAre("segment/command", "segment/frame_done", "segment/stage_status"));
}

TEST(Rights, OfAStageInTheMiddle) {
  const TopicRights svm = rights(Identity::of_stage("svm"));
  EXPECT_THAT(svm.writes,
              ElementsAre("segment/frame_failure", "segment/stage_status", "segment/svm/scores"));
  EXPECT_THAT(svm.reads, ElementsAre("segment/command", "segment/fisher/encodings",
                                     "segment/frame_failure", "segment/model/appearance",
                                     "segment/stage_status", "segment/stream_end"));
}

TEST(Rights, OfALeaf) {
  EXPECT_THAT(rights(Identity::of_stage("sink")).writes,
              ElementsAre("segment/frame_done", "segment/frame_failure", "segment/stage_status"));
}

TEST(Rights, OfThoseWhoLook) {
  const TopicRights observer = rights(Identity::observer());
  EXPECT_THAT(observer.writes, ElementsAre("segment/command"));
  EXPECT_THAT(observer.reads, ElementsAre("segment/*"));
  const TopicRights agent = rights(Identity::agent());
  EXPECT_THAT(agent.writes, ElementsAre("segment/agent_status", "segment/command", "segment/log",
                                        "segment/reply", "segment/stage_status"));
  EXPECT_THAT(agent.reads, Not(Contains("segment/camera/cloud")));
}

// A law: a topic of frames has one stage that writes it, and who reads it is wired to it.
TEST(Rights, FollowTheWiring) {
  const GraphDescription graph = segment_graph();
  std::set<std::string> written;
  for (const auto& stage : graph.stages)
    for (const auto& port : info_of(stage, fake_catalog()).outputs)
      written.insert(topic_name(graph, stage.name, port.name));
  for (const auto& topic : written) {
    int writers = 0;
    for (const auto& stage : graph.stages) {
      const TopicRights own = rights(Identity::of_stage(stage.name));
      writers += static_cast<int>(std::ranges::count(own.writes, topic));
      const bool wired = std::ranges::any_of(stage.inputs, [&](const Connection& input) {
        return topic_name(graph, input.from_stage, input.from_port) == topic;
      });
      EXPECT_EQ(std::ranges::count(own.reads, topic), wired ? 1 : 0) << stage.name << " " << topic;
    }
    EXPECT_EQ(writers, 1) << topic;
  }
}

TEST(Rights, OfAStageThatIsNotThereAreRefused) {
  EXPECT_THROW(rights(Identity::of_stage("ghost")), Error);
}

TEST(Identities, AreTheStagesObserverAndAgent) {
  std::vector<std::string> names;
  for (const auto& identity : identities_of(segment_graph())) names.push_back(to_text(identity));
  ASSERT_EQ(names.size(), 12U);
  EXPECT_EQ(names.front(), "stage 'camera'");
  EXPECT_EQ(names[10], "observer");
  EXPECT_EQ(names[11], "agent");
}

}  // namespace
}  // namespace cosegraph::graph::test
