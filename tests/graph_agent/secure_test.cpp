// Graphs with security, run by agents: every stage, replica, newcomer and command has its keys.
#include <gmock/gmock.h>

#include "graph_agent/toy_graph.hpp"

namespace cosegraph::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

void expect_all_labelled(Program& program, int count) {
  const Outcome outcome = program.wait();
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  const auto account = ToyGraph::account(outcome);
  EXPECT_EQ(account["admitted"], count);
  EXPECT_EQ(account["labelled"], count) << outcome.errors;
}

TEST(SecureAgent, StagesAndCommandsFindEachOther) {
  const ToyGraph graph({.count = 1'000'000, .secure = true});
  const auto up = graph.up();
  graph.await_written(20);
  const auto ps = graph.ps();
  EXPECT_EQ(ps["processes"].size(), 4U) << ps;
  const Outcome swap = graph.order({"swap", "left", "--param", "value=1000", "--json"});
  ASSERT_EQ(swap.status, 0) << swap.errors;
  const auto report = nlohmann::json::parse(swap.output);
  EXPECT_EQ(report["lost"], 0);
  EXPECT_EQ(report["doubled"], 0);
  EXPECT_EQ(graph.value(0), 3.0);
  const int next = graph.written() + 10;
  graph.await_written(next + 10);
  EXPECT_EQ(graph.value(next), 2 * next + 1002.0);
  EXPECT_EQ(run({"cosegraph", "down", graph.name()}).status, 0);
  EXPECT_EQ(up->wait().status, 1) << "before the end of its stream";
}

TEST(SecureAgent, ReplicasAndStagesThatAreStartedAgainHaveTheKeysOfTheStage) {
  const ToyGraph graph({.count = 300, .extra = "replicas: 2, ", .secure = true});
  const auto up = graph.up();
  graph.await_written(20);
  graph.kill("right");
  graph.await_written(100);
  graph.kill("left");
  expect_all_labelled(*up, 300);
  for (int i = 0; i < 300; ++i) ASSERT_EQ(graph.value(i), 2 * i + 3.0) << i;
}

TEST(SecureAgent, StartsNothingWithoutKeys) {
  const ToyGraph graph({.secure = true});
  fs::remove_all(graph.file().parent_path() / "keys" / "stages" / "left");
  const Outcome up = graph.up()->wait();
  EXPECT_EQ(up.status, 1);
  EXPECT_THAT(up.errors, HasSubstr("graph.yaml:5:17"));
  EXPECT_THAT(up.errors, HasSubstr("stage 'left' has no keys in"));
}

// With a graph file that names no keys nobody is found, so nobody obeys.
TEST(SecureAgent, DoesNotObeyWhoHasNoKeys) {
  const ToyGraph graph({.count = 200, .secure = true});
  const auto agent = graph.agent();
  graph.await_written(10);
  std::string text = slurp(graph.file());
  const std::string security = "dds: {security: keys}\n";
  text.erase(text.find(security), security.size());
  const fs::path elsewhere = graph.file().parent_path() / "elsewhere";
  fs::create_directories(elsewhere);
  io::write_file(elsewhere / "graph.yaml", text);
  const std::string runtime = ::getenv("COSEGRAPH_RUNTIME_DIR");
  ::setenv("COSEGRAPH_RUNTIME_DIR", (elsewhere / "runtime").c_str(), 1);
  const Outcome strange = run({"cosegraph", "down", elsewhere / "graph.yaml"});
  ::setenv("COSEGRAPH_RUNTIME_DIR", runtime.c_str(), 1);
  EXPECT_EQ(strange.status, 1) << strange.output;
  EXPECT_EQ(graph.pids().size(), 4U);
  EXPECT_EQ(run({"cosegraph", "down", graph.name()}).status, 0);
  EXPECT_EQ(agent->wait().status, 0);
}

}  // namespace
}  // namespace cosegraph::test
