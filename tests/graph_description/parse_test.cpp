#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "core/random.hpp"
#include "graph_description/fake_catalog.hpp"

namespace cosegraph::graph::test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

// Everything but marks and the file's name, in one comparable text.
std::string content_of(GraphDescription graph) {
  std::string text = graph.graph + "|" + recipe(describe(graph)) + "|" +
                     recipe(describe(graph.dds)) + "|" +
                     std::to_string(static_cast<int>(graph.dds.discovery)) + "|" + graph.dds.server;
  const auto add = [&](const std::string& part) {
    text += "|" + std::to_string(part.size()) + ":" + part;
  };
  for (const auto& peer : graph.dds.peers) add("peer " + peer);
  for (const auto& host : graph.hosts) add("host " + host.name + " " + host.address);
  for (auto& stage : graph.stages) {
    add("stage " + stage.name + " " + stage.use + " " + stage.exec + " " + stage.host);
    for (const auto& input : stage.inputs)
      add("input " + input.port + " " + input.from_stage + "/" + input.from_port);
    for (const auto& output : stage.outputs) add("output " + output.name + " " + output.type);
    for (const auto& setting : stage.params) {
      add((setting.is_list ? "list " : "value ") + setting.name);
      for (const auto& value : setting.value) add(value);
    }
    for (const auto& share : stage.replicas)
      add("replicas " + share.host + " " + std::to_string(share.count));
    add(recipe(describe(stage.restart)));
  }
  return text;
}

void expect_round_trip(const GraphDescription& graph) {
  const std::string yaml = to_yaml(graph);
  std::vector<Fault> faults;
  const GraphDescription again = parse(yaml, "again.yaml", faults);
  ASSERT_THAT(lines_of(faults), IsEmpty()) << yaml;
  ASSERT_EQ(content_of(again), content_of(graph)) << yaml;
  ASSERT_EQ(to_yaml(again), yaml);
}

std::string random_name(Random& random) {
  static constexpr std::string_view kLetters = "abcxyz019_-";
  std::string name(1, static_cast<char>('a' + random.below(26)));
  for (std::size_t i = random.below(8); i > 0; --i) name += kLetters[random.below(kLetters.size())];
  return name;
}

// Of all bytes that YAML can hold, those with a meaning in it often.
std::string random_value(Random& random) {
  static const std::vector<std::string> kPieces = {
      "a",    "0",    ".",   "-",    " ",    ":",    "#",    "'", "\"", "\\", "\n",
      "\t",   "\r",   ",",   "[",    "]",    "{",    "}",    "&", "*",  "!",  "|",
      ">",    "%",    "@",   "`",    "~",    "?",    "=",    "/", ": ", " #", "- ",
      "null", "true", "1e5", "\x01", "\x04", "\x1f", "\x7f", "é", "日", "..."};
  std::string value;
  for (std::size_t i = random.below(7); i > 0; --i) value += kPieces[random.below(kPieces.size())];
  if (random.below(20) == 0) value += '\0';
  return value;
}

GraphDescription random_graph(Random& random) {
  GraphDescription graph{.file = "made", .graph = random_name(random)};
  graph.dds.domain = static_cast<int>(random.below(233));
  graph.dds.discovery = static_cast<Discovery>(random.below(3));
  graph.dds.rate = random.uniform(0.0, 1000.0);
  if (graph.dds.discovery == Discovery::peers)
    graph.dds.peers = {random_value(random) + "x", random_name(random)};
  if (graph.dds.discovery == Discovery::server) graph.dds.server = random_name(random) + ":7400";
  graph.window = 1 + static_cast<int>(random.below(64));
  graph.deadline = random.uniform(0.001, 86400.0);
  for (int i = 0; i < static_cast<int>(random.below(3)); ++i)
    graph.hosts.push_back(
        {.name = random_name(random) + std::to_string(i), .address = random_value(random) + "x"});
  for (int i = 0; i <= static_cast<int>(random.below(4)); ++i) {
    StageNode stage{.name = random_name(random) + std::to_string(i)};
    (random.below(2) == 0 ? stage.use : stage.exec) = random_value(random) + "x";
    if (random.below(2) == 0) stage.host = random_name(random);
    for (int k = 0; k < static_cast<int>(random.below(6)); ++k)
      stage.inputs.push_back({.port = random_name(random) + std::to_string(k),
                              .from_stage = random_name(random),
                              .from_port = random_name(random)});
    if (!stage.exec.empty())
      for (int k = 0; k < static_cast<int>(random.below(3)); ++k)
        stage.outputs.push_back(
            {.name = random_name(random) + std::to_string(k), .type = random_value(random) + "T"});
    for (int k = 0; k < static_cast<int>(random.below(4)); ++k) {
      Setting setting{.name = random_value(random) + std::to_string(k),
                      .is_list = random.below(2) == 0};
      setting.value.resize(setting.is_list ? random.below(4) : 1);
      for (auto& value : setting.value) value = random_value(random);
      stage.params.push_back(setting);
    }
    stage.restart.policy = static_cast<RestartPolicy>(random.below(2));
    stage.restart.max = static_cast<int>(random.below(9));
    stage.restart.backoff = 0.25 * static_cast<double>(random.below(5));
    if (random.below(3) == 0) {
      stage.replicas.push_back({.count = 1 + static_cast<int>(random.below(5))});
    } else {
      for (int k = 0; k < static_cast<int>(random.below(3)); ++k)
        stage.replicas.push_back({.host = random_name(random) + std::to_string(k),
                                  .count = 1 + static_cast<int>(random.below(5))});
    }
    graph.stages.push_back(stage);
  }
  return graph;
}

TEST(Parse, ReadsEveryKey) {
  const GraphDescription graph = parsed(kSegmentGraph);
  EXPECT_EQ(graph.file, "test.yaml");
  EXPECT_EQ(graph.graph, "segment");
  EXPECT_EQ(graph.dds.domain, 7);
  EXPECT_EQ(graph.dds.rate, 80.5);
  EXPECT_EQ(graph.dds.discovery, Discovery::peers);
  EXPECT_THAT(graph.dds.peers, ElementsAre("10.0.0.2", "rack.local"));
  EXPECT_EQ(graph.window, 8);
  EXPECT_EQ(graph.deadline, 2.5);
  ASSERT_EQ(graph.hosts.size(), 2U);
  EXPECT_EQ(graph.hosts[1].name, "rack");
  EXPECT_EQ(graph.hosts[1].address, "rack.local");
  ASSERT_EQ(graph.stages.size(), 10U);

  const StageNode& features = *graph.stage("features");
  EXPECT_EQ(features.use, "descriptors");
  EXPECT_EQ(features.exec, "");
  EXPECT_EQ(features.host, "rack");
  ASSERT_EQ(features.inputs.size(), 1U);
  EXPECT_EQ(features.inputs[0].port, "cloud");
  EXPECT_EQ(features.inputs[0].from_stage, "camera");
  EXPECT_EQ(features.inputs[0].from_port, "cloud");
  ASSERT_EQ(features.params.size(), 1U);
  EXPECT_TRUE(features.params[0].is_list);
  EXPECT_THAT(features.params[0].value, ElementsAre("fpfh:0.08", "shot:0.13"));
  EXPECT_EQ(features.restart.policy, RestartPolicy::on_failure);
  EXPECT_EQ(features.restart.max, 2);
  EXPECT_EQ(graph.stage("svm")->restart.policy, RestartPolicy::never);
  EXPECT_EQ(graph.stage("nobody"), nullptr);
}

TEST(Parse, ReplicasAreOnTheStagesHostOrSharedOutOverHosts) {
  const GraphDescription graph = parsed(
      "version: 1\ngraph: g\nstages:\n"
      "  one: {use: cpc, host: robot}\n"
      "  three: {use: cpc, host: robot, replicas: 3}\n"
      "  spread: {use: cpc, host: robot, replicas: {rack: 2, robot: 1}}\n");
  EXPECT_THAT(hosts_of(*graph.stage("one")), ElementsAre("robot"));
  EXPECT_THAT(hosts_of(*graph.stage("three")), ElementsAre("robot", "robot", "robot"));
  EXPECT_THAT(hosts_of(*graph.stage("spread")), ElementsAre("rack", "rack", "robot"));
}

TEST(Parse, ReadsWhatExecStagesDeclare) {
  const GraphDescription graph = parsed(
      "version: 1\ngraph: g\nstages:\n"
      "  mine: {exec: bin/mine, inputs: {a: b/c}, outputs: {labels: Labelling, more: Scores}}\n");
  EXPECT_EQ(graph.stages[0].exec, "bin/mine");
  ASSERT_EQ(graph.stages[0].outputs.size(), 2U);
  EXPECT_EQ(graph.stages[0].outputs[0].name, "labels");
  EXPECT_EQ(graph.stages[0].outputs[0].type, "Labelling");
}

TEST(Parse, LeavesDefaultsWhereKeysAreAbsent) {
  const GraphDescription graph = parsed("{version: 1, graph: g, stages: {a: {use: source}}}");
  const GraphDescription defaults;
  EXPECT_EQ(graph.window, defaults.window);
  EXPECT_EQ(graph.deadline, defaults.deadline);
  EXPECT_EQ(graph.dds.domain, 0);
  EXPECT_EQ(graph.dds.rate, 0.0);
  EXPECT_EQ(graph.dds.discovery, Discovery::multicast);
}

TEST(Parse, KnowsAllFormsOfDiscovery) {
  const auto discovery = [](const std::string& text) {
    return parsed("{version: 1, graph: g, dds: {discovery: " + text + "}, stages: {a: {use: b}}}")
        .dds;
  };
  EXPECT_EQ(discovery("multicast").discovery, Discovery::multicast);
  EXPECT_EQ(discovery("{peers: [a]}").discovery, Discovery::peers);
  EXPECT_EQ(discovery("{server: 10.0.0.1:11811}").discovery, Discovery::server);
  EXPECT_EQ(discovery("{server: 10.0.0.1:11811}").server, "10.0.0.1:11811");
  EXPECT_EQ(discovery("{server: '[::1]:11811'}").server, "[::1]:11811");
}

TEST(Parse, FollowsAliases) {
  const GraphDescription graph = parsed(
      "version: 1\ngraph: g\nstages:\n  a: {use: x, params: &p {k: v}}\n  b: {use: x, params: *p}");
  ASSERT_EQ(graph.stages[1].params.size(), 1U);
  EXPECT_THAT(graph.stages[1].params[0].value, ElementsAre("v"));
}

TEST(Parse, MarksWhereThingsStand) {
  const GraphDescription graph = parsed(
      "version: 1\ngraph: g\nstages:\n  a:\n    use: source\n    inputs: {x: b/c}\n"
      "    params:\n      size:\n        4\n");
  const StageNode& stage = graph.stages[0];
  EXPECT_EQ(graph.mark, (Mark{3, 1}));
  EXPECT_EQ(stage.mark, (Mark{4, 3}));
  EXPECT_EQ(stage.marks.at("use"), (Mark{5, 10}));
  EXPECT_EQ(stage.inputs[0].mark, (Mark{6, 14}));
  EXPECT_EQ(stage.inputs[0].value_mark, (Mark{6, 17}));
  EXPECT_EQ(stage.params[0].mark, (Mark{8, 7}));
  EXPECT_EQ(stage.params[0].value_mark, (Mark{9, 9}));
}

TEST(Parse, SurvivesDamagedFiles) {
  Random random(1);
  for (int i = 0; i < 2000; ++i) {
    std::string yaml = kSegmentGraph;
    for (std::size_t edits = 1 + random.below(4); edits > 0; --edits) {
      const std::size_t at = random.below(yaml.size());
      const std::size_t kind = random.below(3);
      if (kind == 0) yaml.erase(at, 1 + random.below(20));
      if (kind == 1) yaml.insert(at, random_value(random));
      if (kind == 2) yaml[at] = static_cast<char>(random.below(256));
    }
    std::vector<Fault> faults;
    const GraphDescription graph = parse(yaml, "damaged.yaml", faults);
    for (const auto& fault : faults) ASSERT_GE(fault.mark.line, 1) << yaml << fault.message;
    check(graph, fake_catalog());
  }
}

TEST(ToYaml, RoundTripsTheExample) {
  expect_round_trip(parsed(kSegmentGraph));
}

TEST(ToYaml, RoundTripsWhateverTheStrings) {
  Random random(2);
  for (int i = 0; i < 2000; ++i) expect_round_trip(random_graph(random));
}

TEST(ToYaml, IsPlainWherePlainWillDo) {
  GraphDescription graph = parsed(
      "{version: 1, graph: g, hosts: {h: {address: 10.0.0.2}}, stages: {a: {use: source, host: h,"
      " inputs: {x: b/c}, params: {size: -0.5, path: /tmp/a b, empty: '', list: []}}}}");
  EXPECT_EQ(to_yaml(graph),
            "version: 1\n"
            "graph: g\n"
            "dds: {domain: 0, rate: 0, discovery: multicast}\n"
            "window: 4\n"
            "deadline: 60\n"
            "hosts:\n"
            "  h: {address: 10.0.0.2}\n"
            "stages:\n"
            "  a:\n"
            "    use: source\n"
            "    host: h\n"
            "    inputs: {x: b/c}\n"
            "    params:\n"
            "      size: -0.5\n"
            "      path: \"/tmp/a b\"\n"
            "      empty: \"\"\n"
            "      list: []\n");
}

TEST(SetParam, ReplacesAndAdds) {
  GraphDescription graph = parsed(kSegmentGraph);
  set_param(graph, "camera", "path", {"other"});
  set_param(graph, "camera", "size", {"0.1"});
  set_param(graph, "features", "channels", {"shot:0.1", "fpfh:0.2"});
  const auto& camera = graph.stage("camera")->params;
  ASSERT_EQ(camera.size(), 3U);
  EXPECT_EQ(camera[0].name, "path");
  EXPECT_THAT(camera[0].value, ElementsAre("other"));
  EXPECT_EQ(camera[2].name, "size");
  EXPECT_FALSE(camera[2].is_list);
  EXPECT_TRUE(graph.stage("features")->params[0].is_list);
  EXPECT_THAT(check(graph, fake_catalog()), IsEmpty());
  expect_round_trip(graph);
}

TEST(SetParam, RefusesAnUnknownStage) {
  GraphDescription graph = parsed(kSegmentGraph);
  EXPECT_THAT([&] { set_param(graph, "camra", "path", {"x"}); },
              ThrowsMessage<ParameterError>("unknown stage 'camra'; did you mean 'camera'?"));
}

TEST(SetParam, IsCheckedLaterWithoutAPlaceInTheFile) {
  GraphDescription graph = parsed(kSegmentGraph);
  set_param(graph, "cpc", "threads", {"many"});
  const auto faults = check(graph, fake_catalog());
  ASSERT_EQ(faults.size(), 1U);
  EXPECT_EQ(to_text(faults[0]), "test.yaml: stage 'cpc': threads: 'many' is not an integer");
}

TEST(Load, ResolvesExecutablesAgainstTheFile) {
  const auto folder = std::filesystem::path(::testing::TempDir()) / "cosegraph_load_test";
  std::filesystem::create_directories(folder / "bin");
  std::ofstream(folder / "bin" / "mine") << "#!/bin/sh\n";
  std::filesystem::permissions(folder / "bin" / "mine", std::filesystem::perms::owner_all);
  std::ofstream(folder / "g.yaml")
      << "version: 1\ngraph: g\nstages:\n  camera: {use: source}\n"
         "  mine: {exec: bin/../bin/mine, inputs: {a: camera/cloud}}\n";
  const GraphDescription graph = load(folder / "g.yaml", fake_catalog());
  EXPECT_EQ(graph.stage("mine")->exec, (folder / "bin" / "mine").string());
  EXPECT_TRUE(std::filesystem::path(graph.stage("mine")->exec).is_absolute());
  std::filesystem::remove_all(folder);
}

TEST(Load, SaysWhichFileCannotBeOpened) {
  EXPECT_THAT([] { load("nowhere/g.yaml", fake_catalog()); },
              ThrowsMessage<GraphError>("nowhere/g.yaml: cannot be opened"));
}

TEST(Load, RefusesAFolder) {
  EXPECT_THAT([] { load(COSEGRAPH_SOURCE_DIR "/tests", fake_catalog()); },
              ThrowsMessage<GraphError>(COSEGRAPH_SOURCE_DIR "/tests: is a folder"));
}

TEST(GraphError, ListsEveryFaultOnALine) {
  const GraphError error({{"a.yaml", {1, 2}, "first"}, {"a.yaml", {}, "second"}});
  EXPECT_STREQ(error.what(), "a.yaml:1:2: first\na.yaml: second");
  EXPECT_EQ(error.faults().size(), 2U);
}

TEST(RestartPolicyNames, RoundTrip) {
  for (const auto& [value, name] : names<RestartPolicy>()) {
    EXPECT_EQ(from_name<RestartPolicy>(name), value);
    EXPECT_EQ(to_name(value), name);
  }
}

}  // namespace
}  // namespace cosegraph::graph::test
