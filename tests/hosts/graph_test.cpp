// Graphs whose stages run on several hosts: every way to find each other, bad links, broken links.
#include <gmock/gmock.h>

#include <csignal>
#include <fstream>
#include <optional>

#include "graph_agent/toy_graph.hpp"
#include "hosts/lab.hpp"

namespace cosegraph::test {
namespace {

using namespace std::chrono_literals;
using testing::Contains;
using testing::Each;
using testing::HasSubstr;

constexpr const char* kNames[] = {"one", "two", "three"};

// A lab with an agent on every host, and the graph they run.
class HostsTest : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string reason = Lab::unavailable(); !reason.empty()) GTEST_SKIP() << reason;
  }

  void make_lab(const LabOptions& options) { lab_.emplace(options); }

  std::string address(int host) { return lab_->host(host).address(); }

  // The lines of a graph file that tell about the hosts; `dds` is what stands under that key.
  std::string lines(const std::string& dds) {
    std::string hosts;
    for (int i = 0; i < lab_->size(); ++i)
      hosts += (i == 0 ? "" : ", ") + std::string(kNames[i]) + ": {address: " + address(i) + "}";
    return "dds: {" + dds + "}\nhosts: {" + hosts + "}\n";
  }

  // numbers, left, right and keep on hosts one, two, three and one.
  void start_diamond(const std::string& dds, int frames) {
    graph_ = std::make_unique<ToyGraph>(ToyGraph::Options{
        .count = frames,
        .hosts = lines(dds),
        .host_of = {{"numbers", "one"}, {"left", "two"}, {"right", "three"}, {"keep", "one"}}});
    start_agents();
  }

  // numbers on host one, which feeds keep on host two, with clouds of so many points.
  void start_pair(const std::string& dds, const std::string& numbers) {
    graph_ = std::make_unique<ToyGraph>();
    const std::string program = std::string(COSEGRAPH_BINARY_DIR) + "/tests/toy-";
    io::write_file(graph_->file(),
                   "version: 1\ngraph: " + graph_->name() + "\nwindow: 4\n" + lines(dds) +
                       "stages:\n  numbers: {exec: " + program +
                       "numbers, host: one, outputs: {out: Cloud}, params: {" + numbers +
                       "}}\n  keep: {exec: " + program +
                       "keep, host: two, inputs: {a: numbers/out}, params: {folder: " +
                       graph_->out().string() + "}}\n");
    if (dds.find("security") != std::string::npos) make_keys();
    start_agents();
  }

  void make_keys() {
    const Outcome keys = run({"cosegraph", "keys", "init", graph_->file()});
    EXPECT_EQ(keys.status, 0) << keys.errors;
  }

  void start_agents() {
    for (int i = 0; i < lab_->size(); ++i)
      agents_.push_back(lab_->host(i).start(
          {"cosegraph", "agent", "--host", kNames[i], graph_->file(), "--allow-exec"}));
  }

  nlohmann::json ps(int host) {
    const Outcome outcome =
        lab_->host(host).run({"cosegraph", "ps", graph_->file(), "--edges", "--json"});
    EXPECT_EQ(outcome.status, 0) << outcome.errors;
    return nlohmann::json::parse(outcome.output, nullptr, false);
  }

  // All frames came out, as seen from `host`, and none of them failed.
  void expect_all_labelled(int frames, int host) {
    nlohmann::json account;
    ToyGraph::await(
        [&] {
          account = ps(host)["account"];
          return account.is_object() && account["labelled"] == frames;
        },
        "the account to close");
    if (!account.is_object()) return;
    EXPECT_EQ(account["admitted"], frames) << account;
    EXPECT_EQ(account["failed"], 0) << account;
  }

  void expect_diamond_works(int frames) {
    graph_->await_written(frames);
    for (int i = 0; i < frames; ++i) EXPECT_EQ(graph_->value(i), 2.0 * i + 3.0);
    expect_all_labelled(frames, 2);
    std::vector<std::string> ways;
    const nlohmann::json seen = ps(1);
    for (const auto& edge : seen["edges"]) ways.push_back(edge["via"]);
    EXPECT_THAT(ways, testing::SizeIs(4));
    EXPECT_THAT(ways, Each("UDP between hosts"));
    const Outcome down = lab_->host(2).run({"cosegraph", "down", graph_->file()});
    EXPECT_EQ(down.status, 0) << down.errors;
    for (auto& agent : agents_) {
      const Outcome outcome = agent.wait(20s);
      EXPECT_EQ(outcome.status, 0) << outcome.errors;
    }
  }

  // How many IP fragments a host has received.
  long fragments(int host) {
    const std::string text =
        lab_->host(host)
            .run({"/bin/sh", "-c", "grep ^Ip: /proc/net/snmp | tail -n 1 | cut -d ' ' -f 15"})
            .output;
    return text.empty() ? -1 : std::stol(text);
  }

  std::optional<Lab> lab_;
  std::unique_ptr<ToyGraph> graph_;
  std::vector<Child> agents_;
};

// -- Discovery -----------------------------------------------------------------------------------

TEST_F(HostsTest, FindEachOtherByMulticast) {
  make_lab({.hosts = 3});
  start_diamond("discovery: multicast", 60);
  expect_diamond_works(60);
}

TEST_F(HostsTest, FindEachOtherByPeersWhereThereIsNoMulticast) {
  make_lab({.hosts = 3, .subnets = 2, .multicast = false});
  start_diamond("discovery: {peers: [" + address(0) + ", " + address(1) + ", " + address(2) + "]}",
                60);
  expect_diamond_works(60);
}

TEST_F(HostsTest, FindEachOtherByAServerThatMayDie) {
  make_lab({.hosts = 3, .subnets = 2, .multicast = false});
  start_diamond("discovery: {server: '" + address(0) + ":11811'}", 200);
  graph_->await_written(50);
  const auto kill_server = [&] {
    return lab_->host(0)
        .run({"/bin/sh", "-c",
              "pid=$(pgrep -P " + std::to_string(agents_[0].pid()) +
                  " -f fast-discovery) && kill -KILL $pid"})
        .status;
  };
  EXPECT_EQ(kill_server(), 0) << "the agent of the server's host runs it";
  // The stream does not notice, and who comes later finds the graph once the server is back.
  expect_diamond_works(200);
  EXPECT_THAT(agents_[0].errors(), HasSubstr("the discovery server was killed"));
}

// -- Cables that are out when a process starts ---------------------------------------------------

TEST_F(HostsTest, StageThatStartsWhileItsHostIsCutOffIsHeardWhenTheCableIsIn) {
  make_lab({.hosts = 3});
  lab_->host(1).cut();
  start_diamond("discovery: multicast", 60);
  ToyGraph::await([&] { return !graph_->pids("--stage left ").empty(); }, "the stage to start");
  std::this_thread::sleep_for(500ms);  // it is at work in the meantime
  lab_->host(1).restore();
  expect_diamond_works(60);
}

TEST_F(HostsTest, SourceThatStartsWhileItsHostIsCutOffIsHeardWhenTheCableIsIn) {
  make_lab({.hosts = 3});
  lab_->host(0).cut();
  start_diamond("discovery: multicast", 60);
  ToyGraph::await([&] { return !graph_->pids("--stage numbers ").empty(); }, "the source to start");
  std::this_thread::sleep_for(500ms);
  lab_->host(0).restore();
  expect_diamond_works(60);
}

// -- Links ---------------------------------------------------------------------------------------

constexpr int kTenMegabytes = 833'333;  // points of 12 bytes

TEST_F(HostsTest, LargeFramesPassALossyLinkWithDelay) {
  make_lab({.hosts = 2});
  start_pair("domain: 0", "count: 3, points: " + std::to_string(kTenMegabytes));
  lab_->host(1).shape({.loss = 0.01, .delay = 20ms});
  graph_->await_written(3);
  expect_all_labelled(3, 0);
  EXPECT_LT(fragments(1), 1000) << "30 MB are 22,000 packets";
}

// What participants prove themselves by is more than a packet.
TEST_F(HostsTest, KeysAreProvedOverALossyLinkWithDelay) {
  make_lab({.hosts = 2});
  lab_->host(1).shape({.loss = 0.01, .delay = 20ms});
  start_pair("security: keys", "count: 50, points: 1000");
  graph_->await_written(50);
  expect_all_labelled(50, 0);
}

TEST_F(HostsTest, StageThatKeepsToTheRateLosesNoPacketAtANarrowLink) {
  make_lab({.hosts = 2});
  lab_->host(0).shape({.rate = 80.0});
  const auto start = std::chrono::steady_clock::now();
  start_pair("rate: 60", "count: 4, points: 250000");
  graph_->await_written(4);
  EXPECT_GE(std::chrono::steady_clock::now() - start, 1500ms) << "12 MB at 60 Mbit/s";
  const std::string count = lab_->host(0).run({"/sbin/tc", "-s", "qdisc"}).output;
  EXPECT_THAT(count, HasSubstr("dropped 0,"));
  expect_all_labelled(4, 0);
}

TEST_F(HostsTest, NoFrameIsLostWhenALinkIsCutForLongerThanTheLease) {
  make_lab({.hosts = 2});
  start_pair("domain: 0", "count: 250, rate: 50");
  graph_->await_written(50);
  lab_->host(1).cut();
  std::this_thread::sleep_for(3s);
  lab_->host(1).restore();
  graph_->await_written(250);
  expect_all_labelled(250, 0);
}

}  // namespace
}  // namespace cosegraph::test
