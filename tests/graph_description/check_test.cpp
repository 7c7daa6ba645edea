#include <gmock/gmock.h>

#include <regex>
#include <set>

#include "graph_description/random_graph.hpp"

namespace cosegraph::graph::test {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::string> faults_of(const GraphDescription& graph) {
  return lines_of(check(graph, fake_catalog()));
}

// The stages that a fault names as a cycle, first and last alike.
std::vector<std::string> named_cycle(const std::string& message) {
  std::vector<std::string> result;
  const std::regex name("s[0-9]+");
  const std::string list = message.substr(message.rfind("cycle: ") + 7);
  for (std::sregex_iterator it(list.begin(), list.end(), name), end; it != end; ++it)
    result.push_back(it->str());
  return result;
}

bool feeds(const GraphDescription& graph, const std::string& from, const std::string& to) {
  for (const auto& input : graph.stage(to)->inputs)
    if (input.from_stage == from) return true;
  return false;
}

TEST(Check, PassesTheWholeGraph) {
  EXPECT_THAT(faults_of(parsed(kSegmentGraph)), IsEmpty());
}

TEST(Check, PassesATrainingGraphWhoseModelsNobodyReads) {
  EXPECT_THAT(faults_of(parsed("{version: 1, graph: g, stages: {camera: {use: source},"
                               " features: {use: descriptors, inputs: {cloud: camera/cloud}},"
                               " training: {use: training, inputs: {cloud: camera/cloud,"
                               " descriptors: features/descriptors}}}}")),
              IsEmpty());
}

TEST(Check, PassesLatchedOutputsOfStagesThatTakeFrames) {
  EXPECT_THAT(
      faults_of(parsed("{version: 1, graph: g, stages: {camera: {use: source},"
                       " features: {use: descriptors, inputs: {cloud: camera/cloud}},"
                       " training: {use: training, inputs: {cloud: camera/cloud,"
                       " descriptors: features/descriptors}},"
                       " keep: {use: archive, inputs: {appearance: training/appearance}}}}")),
      IsEmpty());
}

TEST(Check, TakesASingleValueForAList) {
  EXPECT_THAT(faults_of(parsed("{version: 1, graph: g, stages: {camera: {use: source},"
                               " features: {use: descriptors, inputs: {cloud: camera/cloud},"
                               " params: {channels: 'shot:0.2'}}}}")),
              IsEmpty());
}

TEST(Check, PassesRandomAcyclicGraphs) {
  Random random(1);
  for (int i = 0; i < 300; ++i) {
    const auto graph = random_acyclic_graph(2 + random.below(15), random);
    ASSERT_THAT(lines_of(check(graph, join_catalog())), IsEmpty()) << to_yaml(graph);
  }
}

TEST(Check, ReportsEveryBackEdgeAsACycleThatIsThere) {
  Random random(2);
  int tried = 0;
  while (tried < 300) {
    auto graph = random_acyclic_graph(3 + random.below(12), random);
    const auto reach = reachability(graph);
    const std::size_t to = 1 + random.below(graph.stages.size() - 1);
    const std::size_t from = 1 + random.below(graph.stages.size() - 1);
    if (from != to && !reach[to][from]) continue;
    ++tried;
    graph.stage("s" + std::to_string(to))
        ->inputs.push_back(
            {.port = "back", .from_stage = "s" + std::to_string(from), .from_port = "cloud"});
    const auto faults = lines_of(check(graph, join_catalog()));
    ASSERT_THAT(faults, Contains(HasSubstr("the stages form a cycle"))) << to_yaml(graph);
    for (const auto& fault : faults) {
      const auto cycle = named_cycle(fault);
      ASSERT_GE(cycle.size(), 2U) << fault;
      ASSERT_EQ(cycle.front(), cycle.back());
      for (std::size_t k = 1; k < cycle.size(); ++k)
        ASSERT_TRUE(feeds(graph, cycle[k - 1], cycle[k])) << fault << "\n" << to_yaml(graph);
    }
  }
}

TEST(Check, NamesEveryStageThatIsOnACycle) {
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    auto graph = random_acyclic_graph(4 + random.below(8), random);
    for (auto& stage : graph.stages)
      if (stage.name != "s0" && random.below(4) == 0)
        stage.inputs.push_back(
            {.port = "back",
             .from_stage = "s" + std::to_string(random.below(graph.stages.size())),
             .from_port = "cloud"});
    std::set<std::string> named;
    for (const auto& fault : lines_of(check(graph, join_catalog())))
      for (const auto& name : named_cycle(fault)) named.insert(name);
    const auto reach = reachability(graph);
    for (const auto& stage : graph.stages) {
      const std::size_t number = number_of(stage.name);
      ASSERT_EQ(named.contains(stage.name), reach[number][number]) << to_yaml(graph);
    }
  }
}

TEST(Check, FindsEveryRemovedConnection) {
  const GraphDescription whole = parsed(kSegmentGraph);
  for (std::size_t s = 0; s < whole.stages.size(); ++s) {
    for (std::size_t i = 0; i < whole.stages[s].inputs.size(); ++i) {
      GraphDescription graph = whole;
      const std::string port = graph.stages[s].inputs[i].port;
      graph.stages[s].inputs.erase(graph.stages[s].inputs.begin() + static_cast<long>(i));
      const bool is_optional = info_of(graph.stages[s], fake_catalog()).input(port)->optional;
      if (is_optional) {
        EXPECT_THAT(faults_of(graph), IsEmpty());
      } else {
        EXPECT_THAT(faults_of(graph), ElementsAre(HasSubstr("input '" + port + "' (")));
      }
    }
  }
}

// A graph made by a program has no marks, and may be wrong in ways a file cannot.
TEST(Check, RefusesWhatOnlyProgramsCanMake) {
  GraphDescription graph{.file = "made", .graph = "g"};
  EXPECT_THAT(faults_of(graph), ElementsAre("0:0: no stage is a source of frames",
                                            "0:0: no stage takes frames: none would ever be done"));
  graph.hosts = {{.name = "h", .address = "a"}, {.name = "h", .address = "b"}};
  graph.stages = {{.name = "camera", .use = "source"},
                  {.name = "camera", .use = "source"},
                  {.name = "nothing"},
                  {.name = "work",
                   .use = "supervoxels",
                   .inputs = {{.port = "cloud", .from_stage = "camera", .from_port = "dense"},
                              {.port = "cloud", .from_stage = "camera", .from_port = "cloud"}},
                   .params = {{.name = "size", .value = {"0.1"}},
                              {.name = "size", .value = {"0.1", "0.2"}},
                              {.name = "seed", .value = {}}}},
                  {.name = "loose", .use = "spectra", .inputs = {{.port = "cloud"}}}};
  EXPECT_THAT(faults_of(graph),
              ElementsAre("0:0: two stages are called 'camera'", "0:0: two hosts are called 'h'",
                          "0:0: stage 'nothing': needs 'use' or 'exec'",
                          "0:0: stage 'work': input 'cloud' is fed twice",
                          "0:0: stage 'work': parameter 'size' is given twice",
                          "0:0: stage 'work': size: expected one value, not a list",
                          "0:0: stage 'work': seed: expected one value, not a list",
                          "0:0: stage 'loose': input 'cloud' names no stage",
                          "0:0: stage 'camera': a second source of frames beside 'camera'; a graph"
                          " has one"));
}

TEST(Check, DoesNotChangeTheCatalogsDefaults) {
  GraphDescription graph = parsed(kSegmentGraph);
  const Catalog catalog = fake_catalog();
  const std::string before = recipe(catalog.at("source")().parameters);
  check(graph, catalog);
  EXPECT_EQ(recipe(catalog.at("source")().parameters), before);
}

}  // namespace
}  // namespace cosegraph::graph::test
