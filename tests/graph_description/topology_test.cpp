#include <gmock/gmock.h>

#include "graph_description/random_graph.hpp"

namespace cosegraph::graph::test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(Topology, OfTheWholeGraph) {
  const GraphDescription graph = parsed(kSegmentGraph);
  const Catalog catalog = fake_catalog();
  EXPECT_EQ(source_of(graph, catalog).name, "camera");
  EXPECT_THAT(leaves_of(graph, catalog), ElementsAre("sink"));
  EXPECT_THAT(
      downstream_of(graph, "camera", catalog),
      ElementsAre("supervoxels", "cpc", "features", "spectra", "fisher", "svm", "astar", "sink"));
  EXPECT_THAT(downstream_of(graph, "spectra", catalog), ElementsAre("astar", "sink"));
  EXPECT_THAT(downstream_of(graph, "sink", catalog), IsEmpty());
  EXPECT_THAT(downstream_of(graph, "model", catalog), IsEmpty());  // latched edges only
  EXPECT_EQ(topic_name(graph, "camera", "dense"), "segment/camera/dense");
}

TEST(Topology, StagesThatMakeOnlyModelsAreLeaves) {
  const GraphDescription graph = parsed(
      "{version: 1, graph: g, stages: {camera: {use: source},"
      " features: {use: descriptors, inputs: {cloud: camera/cloud}},"
      " training: {use: training, inputs: {cloud: camera/cloud, descriptors:"
      " features/descriptors}}, keep: {use: archive, inputs: {appearance: training/appearance}}}}");
  EXPECT_THAT(leaves_of(graph, fake_catalog()), ElementsAre("training"));
}

TEST(Topology, EqualsBruteForceOnRandomGraphs) {
  Random random(1);
  const Catalog catalog = join_catalog();
  for (int i = 0; i < 200; ++i) {
    const auto graph = random_acyclic_graph(2 + random.below(15), random);
    const auto reach = reachability(graph);
    EXPECT_EQ(source_of(graph, catalog).name, "s0");
    std::vector<std::string> leaves;
    for (const auto& stage : graph.stages) {
      std::vector<std::string> downstream;
      for (const auto& other : graph.stages)
        if (reach[number_of(stage.name)][number_of(other.name)]) downstream.push_back(other.name);
      ASSERT_EQ(downstream_of(graph, stage.name, catalog), downstream);
      if (downstream.empty()) leaves.push_back(stage.name);
    }
    ASSERT_EQ(leaves_of(graph, catalog), leaves);
  }
}

TEST(Topology, GivesExecStagesThePortsThatFeedThem) {
  const GraphDescription graph = parsed(
      "{version: 1, graph: g, stages: {camera: {use: source}, model: {use: model},"
      " mine: {exec: bin/mine, inputs: {points: camera/cloud, parts: model/appearance},"
      " outputs: {labels: Labelling, learnt: RelationModel}},"
      " sink: {use: sink, inputs: {cloud: camera/cloud, labelling: mine/labels}}}}");
  const StageInfo alone = info_of(*graph.stage("mine"), fake_catalog());
  EXPECT_EQ(alone.kind, "mine");
  EXPECT_EQ(alone.input("points")->type, "");
  EXPECT_FALSE(alone.output("labels")->latched);
  EXPECT_TRUE(alone.output("learnt")->latched);  // models always are

  const StageInfo wired = infos_of(graph, fake_catalog())[2];
  EXPECT_EQ(wired.input("points")->type, "Cloud");
  EXPECT_FALSE(wired.input("points")->latched);
  EXPECT_EQ(wired.input("parts")->type, "AppearanceModel");
  EXPECT_TRUE(wired.input("parts")->latched);
  EXPECT_THAT(leaves_of(graph, fake_catalog()), ElementsAre("sink"));
  EXPECT_THAT(downstream_of(graph, "camera", fake_catalog()), ElementsAre("mine", "sink"));
}

TEST(Topology, RefusesWhatIsNotThere) {
  GraphDescription graph = parsed(kSegmentGraph);
  const Catalog catalog = fake_catalog();
  EXPECT_THROW(downstream_of(graph, "nobody", catalog), Error);
  graph.stages[0].use = "nothing";
  EXPECT_THROW(info_of(graph.stages[0], catalog), Error);
  EXPECT_THROW(leaves_of(graph, catalog), Error);
  graph.stages.erase(graph.stages.begin());
  graph.stages = {graph.stages.at(4)};  // the model
  EXPECT_THROW(source_of(graph, catalog), Error);
}

}  // namespace
}  // namespace cosegraph::graph::test
