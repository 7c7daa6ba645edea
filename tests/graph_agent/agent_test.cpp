// Graphs of processes that are swapped, killed, stopped and taken over while frames flow.
#include <gmock/gmock.h>

#include "graph_agent/toy_graph.hpp"

namespace cosegraph::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

void expect_all_labelled(Program& program, int count) {
  const Outcome outcome = program.wait();
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  const auto account = ToyGraph::account(outcome);
  EXPECT_EQ(account["admitted"], count);
  EXPECT_EQ(account["labelled"], count) << outcome.errors;
}

TEST(Agent, SwapChangesAStageBetweenTwoFrames) {
  const ToyGraph graph;
  const auto up = graph.up();
  graph.await_written(20);
  const Outcome swap = graph.order({"swap", "left", "--param", "value=1000", "--json"});
  ASSERT_EQ(swap.status, 0) << swap.errors;
  const auto report = nlohmann::json::parse(swap.output);
  EXPECT_EQ(report["lost"], 0);
  EXPECT_EQ(report["doubled"], 0);
  EXPECT_EQ(report["from_generation"], 0);
  EXPECT_EQ(report["to_generation"], 1);
  expect_all_labelled(*up, 300);
  // The old value up to some frame, the new one from there on.
  EXPECT_EQ(graph.value(0), 3.0);
  EXPECT_EQ(graph.value(299), 2 * 299 + 1002.0);
  int changes = 0;
  for (int i = 1; i < 300; ++i) changes += graph.value(i) - graph.value(i - 1) != 2.0 ? 1 : 0;
  EXPECT_EQ(changes, 1);
}

TEST(Agent, EveryKindOfStageCanBeSwappedAndNothingIsLost) {
  const ToyGraph graph({.count = 900, .rate = 80});
  const auto up = graph.up();
  graph.await_written(10);
  for (const std::string stage : {"numbers", "left", "keep"}) {
    const Outcome swap = graph.order({"swap", stage, "--json"});
    ASSERT_EQ(swap.status, 0) << stage << ": " << swap.errors;
    const auto report = nlohmann::json::parse(swap.output);
    EXPECT_EQ(report["lost"], 0) << stage << swap.output;
    EXPECT_EQ(report["doubled"], 0) << stage << swap.output;
  }
  expect_all_labelled(*up, 900);
  EXPECT_EQ(graph.written(), 900) << "each frame once";
  for (int i = 0; i < 900; ++i) ASSERT_EQ(graph.value(i), 2 * i + 3.0);
}

TEST(Agent, OldStageStaysIfTheNewcomerFails) {
  const ToyGraph graph({.count = 500});
  const auto up = graph.up();
  graph.await_written(10);
  const Outcome refused = graph.order({"swap", "left", "--param", "refuse=true"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.errors, HasSubstr("the newcomer exited with status 1; the old one goes on"));
  const Outcome absent = graph.order({"swap", "left", "--exec", "/no/such/program"});
  EXPECT_EQ(absent.status, 1);
  EXPECT_THAT(absent.errors, HasSubstr("/no/such/program"));
  const Outcome unknown = graph.order({"swap", "lift"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.errors, HasSubstr("did you mean 'left'"));
  expect_all_labelled(*up, 500);
  EXPECT_EQ(graph.value(499), 2 * 499 + 3.0);
}

TEST(Agent, StageOfAnotherRecipeIsNotTakenIn) {
  const ToyGraph graph({.count = 400, .left = "recipe: radius=1"});
  const auto up = graph.up();
  graph.await_written(10);
  const Outcome refused = graph.order({"swap", "left", "--param", "recipe=radius=2"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.errors, HasSubstr("would be made as [radius=2] instead of [radius=1]"));
  expect_all_labelled(*up, 400);
}

TEST(Agent, DryRunChangesNothing) {
  const ToyGraph graph;
  const auto up = graph.up();
  graph.await_written(10);
  const Outcome dry = graph.order({"swap", "left", "--param", "value=1000", "--dry-run"});
  EXPECT_EQ(dry.status, 0) << dry.errors;
  EXPECT_THAT(dry.output, HasSubstr("nothing was changed"));
  expect_all_labelled(*up, 300);
  EXPECT_EQ(graph.value(299), 2 * 299 + 3.0);
}

TEST(Agent, OneSwapAtATime) {
  const ToyGraph graph({.count = 300, .left = "sleep: 300", .deadline = 100});
  const auto up = graph.up();
  graph.await_written(2);
  Program first({"cosegraph", "swap", "left", "--graph", graph.name()});
  ToyGraph::await([&] { return graph.pids("--standby").size() == 1; }, "the newcomer");
  const Outcome second = graph.order({"swap", "right"});
  EXPECT_EQ(second.status, 1);
  EXPECT_THAT(second.errors, HasSubstr("busy: left is being swapped"));
  const Outcome one = first.wait();
  EXPECT_EQ(one.status, 0) << one.errors;
  EXPECT_EQ(run({"cosegraph", "down", graph.name()}).status, 0);
  EXPECT_EQ(up->wait().status, 1);
}

// Whoever is killed, every frame is accounted for and comes out once.
TEST(Agent, KilledStagesAreStartedAgainAndRedoWhatWasInFlight) {
  const ToyGraph graph({.count = 600, .rate = 100});
  const auto up = graph.up();
  for (int i = 0; i < 6; ++i) {
    graph.await_written(80 * i + 20);
    graph.kill(std::vector<std::string>{"left", "keep", "right"}[static_cast<std::size_t>(i % 3)]);
  }
  expect_all_labelled(*up, 600);
  EXPECT_EQ(graph.written(), 600);
  for (int i = 0; i < 600; ++i) ASSERT_EQ(graph.value(i), 2 * i + 3.0) << i;
}

TEST(Agent, KilledSourceGoesOnBehindTheFramesItHadTaken) {
  const ToyGraph graph({.count = 400, .rate = 100});
  const auto up = graph.up();
  for (int i = 0; i < 3; ++i) {
    graph.await_written(100 * i + 20);
    graph.kill("numbers");
  }
  const Outcome outcome = up->wait();
  const auto account = ToyGraph::account(outcome);
  EXPECT_EQ(account["admitted"], 400) << outcome.errors;
  const int failed = account["failed"];
  EXPECT_EQ(account["labelled"].get<int>() + failed, 400);
  EXPECT_LE(failed, 3 * 4) << "no more than was in flight";
}

TEST(Agent, FrameThatKillsItsStageTwiceFailsAndTheOthersGoOn) {
  const ToyGraph graph({.count = 60, .left = "die_at: 30"});
  const auto up = graph.up();
  const Outcome outcome = up->wait();
  const auto account = ToyGraph::account(outcome);
  EXPECT_EQ(account["labelled"], 59) << outcome.errors;
  EXPECT_EQ(account["failed"], 1);
  EXPECT_THAT(outcome.errors, HasSubstr("n30 failed at left: its process has died 2 times over"));
}

TEST(Agent, StageThatDiesTooOftenIsGivenUp) {
  const ToyGraph graph({.count = 100000, .max_restarts = 1});
  const auto up = graph.up();
  graph.await_written(10);
  graph.kill("left");
  const int before = graph.written();
  graph.await_written(before + 20);
  graph.kill("left");
  const Outcome outcome = up->wait();
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.errors, HasSubstr("stage left was killed by Killed"));
  EXPECT_THAT(graph.pids(), IsEmpty());
}

TEST(Agent, ReplicasShareFramesAndSurviveADeath) {
  const ToyGraph graph({.count = 400, .rate = 0, .left = "sleep: 5", .extra = "replicas: 3, "});
  const auto up = graph.up();
  graph.await_written(100);
  EXPECT_THAT(graph.pids("--stage left "), SizeIs(3));
  const auto replicas = graph.pids("--stage left ");
  ASSERT_FALSE(replicas.empty());
  ::kill(replicas[0], SIGKILL);
  const Outcome outcome = up->wait();
  const auto report = nlohmann::json::parse(outcome.output, nullptr, false);
  ASSERT_FALSE(report.is_discarded());
  EXPECT_EQ(report["account"]["labelled"], 400) << outcome.errors;
  for (int i = 0; i < 400; ++i) ASSERT_EQ(graph.value(i), 2 * i + 3.0) << i;
  int working = 0;
  for (const char* name : {"left.0", "left.1", "left.2"})
    working += report["stages"][name]["frames"].get<int>() > 0 ? 1 : 0;
  EXPECT_GE(working, 2);
}

TEST(Agent, StagesCanBeStoppedStartedAndRestarted) {
  const ToyGraph graph({.count = 400, .rate = 60});
  const auto up = graph.up();
  graph.await_written(10);
  EXPECT_EQ(graph.order({"stop", "left"}).status, 0);
  EXPECT_THAT(graph.pids("--stage left "), IsEmpty());
  EXPECT_EQ(graph.order({"start", "left"}).status, 0);
  EXPECT_EQ(graph.order({"restart", "right"}).status, 0);
  expect_all_labelled(*up, 400);
}

TEST(Agent, ProgramsOutsideTheGraphsFolderAreNotRunUnasked) {
  const ToyGraph graph;
  const Outcome outcome = run({"cosegraph", "up", graph.file()});
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.errors, HasSubstr("it is run only with --allow-exec"));
  EXPECT_THAT(graph.pids(), IsEmpty());
}

class KeptAgent : public testing::Test {
 protected:
  // The graph runs by an agent, not by `up`.
  std::unique_ptr<Program> start() {
    auto agent = graph_.agent();
    graph_.await_written(10);
    return agent;
  }
  const ToyGraph graph_{{.count = 1000000, .rate = 100}};
};

TEST_F(KeptAgent, IsFollowedByOneThatTakesItsStagesOver) {
  auto first = start();
  const auto before = graph_.pids();
  ASSERT_THAT(before, SizeIs(4));
  ::kill(first->pid(), SIGKILL);
  first->wait();
  EXPECT_EQ(graph_.pids(), before) << "the stages go on";
  graph_.await_written(graph_.written() + 20);
  graph_.kill("left");  // with nobody to start it again

  Program second({"cosegraph", "agent", graph_.file(), "--allow-exec"});
  ToyGraph::await([&] { return graph_.pids().size() == 4; }, "the missing stage");
  graph_.await_written(graph_.written() + 20);
  EXPECT_EQ(graph_.order({"swap", "left", "--param", "value=5"}).status, 0);
  EXPECT_EQ(run({"cosegraph", "down", graph_.name()}).status, 0);
  EXPECT_EQ(second.wait().status, 0);
  EXPECT_THAT(graph_.pids(), IsEmpty());
}

TEST_F(KeptAgent, StopsItsStagesWhenItIsAskedTo) {
  auto agent = start();
  const Outcome other = run({"cosegraph", "agent", graph_.file(), "--allow-exec"});
  EXPECT_EQ(other.status, 1);
  EXPECT_THAT(other.errors, HasSubstr("is run already by another process"));
  ::kill(agent->pid(), SIGTERM);
  EXPECT_EQ(agent->wait().status, 0);
  EXPECT_THAT(graph_.pids(), IsEmpty());
}

TEST_F(KeptAgent, IsSeenByPsAndLogs) {
  auto agent = start();
  const auto ps = graph_.ps();
  ASSERT_THAT(ps["processes"], SizeIs(4));
  EXPECT_EQ(ps["agents"][0]["pid"], agent->pid());
  for (const auto& process : ps["processes"]) {
    EXPECT_TRUE(process["state"] == "waiting" || process["state"] == "working") << process;
    EXPECT_THAT(graph_.pids(), testing::Contains(process["pid"].get<pid_t>()));
  }
  EXPECT_THAT(ps["edges"], SizeIs(4));
  graph_.kill("right");
  Outcome logs;
  ToyGraph::await(
      [&] {
        logs = run({"cosegraph", "logs", "right", "--graph", graph_.name()});
        return !logs.output.empty();
      },
      "the log");
  EXPECT_THAT(logs.output, HasSubstr("[right] was killed by Killed, starting it again"));
  EXPECT_EQ(run({"cosegraph", "down", graph_.name()}).status, 0);
  agent->wait();
}

}  // namespace
}  // namespace cosegraph::test
