// Every link between two stages can break, and the first broken one is named.
#include "graph/why.hpp"

#include <gmock/gmock.h>

#include "graph/control.hpp"

namespace cosegraph::graph {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::IsNull;

const auto kNow = std::chrono::steady_clock::time_point(100s);

// "numbers" writes, "sum" reads two inputs; all is well.
struct World {
  World() {
    std::vector<Fault> faults;
    graph = parse(R"(version: 1
graph: g
stages:
  numbers: {use: numbers}
  other: {use: numbers}
  sum: {use: sum, inputs: {a: numbers/out, b: other/out}}
)",
                  "", faults);
    graph.instance = "1";
    for (const std::string name : {"numbers", "other", "sum"}) {
      domain.peers[name] = {.guid = name, .name = "g/" + name};
      Observed& seen = look[name];
      seen.header.stage = name;
      seen.heard = kNow;
      seen.status.host = "robot";
      seen.status.pid = 7;
      seen.status.state = idl::State::waiting;
      seen.status.frames_in = seen.status.frames_out = 5;
    }
    for (const std::string name : {"numbers", "other"}) {
      look[name].status.ports = {{.name = "out", .output = true, .messages = 5}};
      domain.endpoints.push_back(endpoint(name, "g/" + name + "/out", true));
      domain.endpoints.push_back(endpoint("sum", "g/" + name + "/out", false));
    }
    look["sum"].status.ports = {{.name = "a", .messages = 5}, {.name = "b", .messages = 5}};
  }

  static Endpoint endpoint(const std::string& stage, const std::string& topic, bool is_writer) {
    return {.guid = stage + topic,
            .participant = stage,
            .is_writer = is_writer,
            .topic = topic,
            .type = "cosegraph::msg::Cloud",
            .partitions = {"g.1"},
            .qos = {.durability = Durability::transient_local}};
  }

  Endpoint& writer() { return domain.endpoints[0]; }
  Endpoint& reader() { return domain.endpoints[1]; }
  idl::StageStatus& status(const std::string& name) { return look[name].status; }

  std::vector<Link> links(bool latched = false) const {
    const StageNode& sum = *graph.stage("sum");
    return links_of({.graph = graph,
                     .stage = sum,
                     .input = sum.inputs[0],
                     .latched = latched,
                     .domain = domain,
                     .look = look,
                     .failures = failures,
                     .now = kNow});
  }

  // "NAME: TEXT | REMEDY" of the first broken link.
  std::string broken() const {
    const auto all = links();
    const Link* link = first_broken(all);
    return link == nullptr ? "nothing" : link->name + ": " + link->text + " | " + link->remedy;
  }

  GraphDescription graph;
  Domain domain;
  Look look;
  std::vector<ObservedFailure> failures;
};

TEST(Why, NothingIsBrokenWhereFramesFlow) {
  const World world;
  for (const auto& link : world.links())
    EXPECT_EQ(link.verdict, Verdict::fine) << link.name << ": " << link.text;
  EXPECT_THAT(first_broken(world.links(true)), IsNull());
}

TEST(Why, ProcessesThatAreMissingSilentStoppedOrFailed) {
  World gone;
  gone.look.erase("numbers");
  gone.domain.peers.erase("numbers");
  EXPECT_THAT(gone.broken(), HasSubstr("process: nobody has heard of numbers"));
  EXPECT_THAT(gone.broken(), HasSubstr("cosegraph start numbers"));
  World silent;
  silent.look["sum"].heard = kNow - 3500ms;
  EXPECT_THAT(silent.broken(), HasSubstr("process: sum is silent for 3.5 s"));
  World stopped;
  stopped.status("numbers").state = idl::State::stopped;
  EXPECT_THAT(stopped.broken(), HasSubstr("process: numbers was stopped"));
  World failed;
  failed.status("numbers").state = idl::State::failed;
  failed.status("numbers").activity = "disk full";
  EXPECT_THAT(failed.broken(), HasSubstr("process: numbers has failed: disk full"));
}

TEST(Why, ParticipantsThatAreNotDiscovered) {
  World world;
  world.domain.peers.erase("sum");
  EXPECT_THAT(world.broken(), HasSubstr("participant: g/sum is not found in DDS domain 0"));
}

TEST(Why, EndpointsThatAreMissing) {
  World world;
  world.domain.endpoints.erase(world.domain.endpoints.begin() + 1);
  EXPECT_THAT(world.broken(), HasSubstr("topic: sum has no reader for g/numbers/out"));
  world.domain.endpoints.erase(world.domain.endpoints.begin());
  EXPECT_THAT(world.broken(), HasSubstr("topic: numbers has no writer for g/numbers/out"));
}

TEST(Why, TypesAndPolicies) {
  World type;
  type.writer().type = "cosegraph::msg::Segments";
  EXPECT_THAT(type.broken(), HasSubstr("type: the writer has cosegraph::msg::Segments"));
  World reliability;
  reliability.writer().qos.reliable = false;
  EXPECT_THAT(reliability.broken(), HasSubstr("reliability: the writer offers best_effort"));
  World durability;
  durability.writer().qos.durability = Durability::volatile_;
  EXPECT_THAT(durability.broken(), HasSubstr("durability: the writer offers volatile"));
}

TEST(Why, AStageOfAnotherRunIsInAnotherPartition) {
  World world;
  world.writer().partitions = {"g.2"};
  world.look.erase("numbers");  // its status is in that partition as well
  EXPECT_THAT(world.broken(), HasSubstr("partition: the writer is in 'g.2', the reader in 'g.1'"));
  EXPECT_THAT(world.broken(), HasSubstr("--instance"));
}

TEST(Why, OtherRunsOfTheGraphDoNotDisturb) {
  World world;
  for (std::size_t i = 0; i < 4; ++i) {
    Endpoint other = world.domain.endpoints[i];
    other.guid += "x";
    other.partitions = {"g.2"};
    world.domain.endpoints.insert(world.domain.endpoints.begin(), other);
  }
  EXPECT_EQ(world.broken(), "nothing");
}

TEST(Why, NothingIsSent) {
  World world;
  world.status("numbers").ports[0].messages = 0;
  world.status("numbers").frames_failed = 2;
  world.failures.push_back({.stage = "numbers", .frame = "x.pcd", .reason = "cannot be read"});
  world.status("sum").ports[0].messages = 0;
  EXPECT_THAT(world.broken(), HasSubstr("sent: numbers has written nothing on 'out'"));
  EXPECT_THAT(world.broken(), HasSubstr("x.pcd: cannot be read"));
}

TEST(Why, WhatIsSentDoesNotArrive) {
  World world;
  world.status("sum").ports[0].messages = 0;
  EXPECT_THAT(world.broken(), HasSubstr("received: nothing has arrived of 5 messages"));
}

TEST(Why, FramesWaitForAnotherInput) {
  World world;
  world.status("sum").ports[1].messages = 0;
  world.status("sum").frames_in = world.status("sum").frames_out = 0;
  world.status("sum").queue = 4;
  EXPECT_THAT(world.broken(), HasSubstr("joined: 4 frames waiting for other inputs: b"));
  EXPECT_THAT(world.broken(), HasSubstr("cosegraph why g sum/b"));
}

TEST(Why, EveryFrameFails) {
  World world;
  world.status("sum").frames_out = 0;
  world.status("sum").frames_failed = 5;
  world.failures.push_back({.stage = "sum", .frame = "x.pcd", .reason = "another recipe"});
  EXPECT_THAT(world.broken(), HasSubstr("accepted: 5 frames failed, none done"));
  EXPECT_THAT(world.broken(), HasSubstr("another recipe"));
}

TEST(Why, LinksBehindABrokenOneAreJudgedOrUnknown) {
  World world;
  world.look.clear();
  world.domain = {};
  for (const auto& link : world.links()) {
    EXPECT_NE(link.verdict, Verdict::fine) << link.name;
    EXPECT_FALSE(link.text.empty()) << link.name;
  }
}

TEST(Why, EveryVerdictHasAName) {
  for (const auto& [value, name] : names<Verdict>()) EXPECT_EQ(from_name<Verdict>(name), value);
}

}  // namespace
}  // namespace cosegraph::graph
