// Networks that come and go under a running graph.
#include <gmock/gmock.h>

#include <optional>

#include "graph_agent/toy_graph.hpp"
#include "hosts/lab.hpp"

namespace cosegraph::test {
namespace {

using namespace std::chrono_literals;

// numbers and keep run on host "one", left and right on "two".
class Network : public testing::Test {
 protected:
  void SetUp() override {
    if (const auto reason = Lab::unavailable(); !reason.empty()) GTEST_SKIP() << reason;
    lab_.emplace(LabOptions{.hosts = 2});
    graph_.emplace(ToyGraph::Options{
        .count = 100,
        .hosts = "hosts: {one: {address: " + lab_->host(0).address() +
                 "}, two: {address: " + lab_->host(1).address() + "}}\n",
        .host_of = {{"numbers", "one"}, {"left", "two"}, {"right", "two"}, {"keep", "one"}},
        .deadline = 30});
  }

  void start(int host) {
    agents_[static_cast<std::size_t>(host)].emplace(
        lab_->host(host).start({"cosegraph", "agent", "--host", host == 0 ? "one" : "two",
                                graph_->file(), "--allow-exec"}));
  }
  void await_process(const std::string& stage) const {
    ToyGraph::await([&] { return !graph_->pids("--stage " + stage + " ").empty(); },
                    "a process to start");
  }
  void expect_all_frames() const {
    graph_->await_written(100);
    for (int i = 0; i < 100; ++i) EXPECT_EQ(graph_->value(i), 2.0 * i + 3.0) << i;
  }
  void TearDown() override {
    if (!graph_) return;
    lab_->host(0).run({"cosegraph", "down", graph_->file()});
    for (auto& agent : agents_) {
      if (agent) {
        EXPECT_EQ(agent->wait(20s).status, 0);
      }
    }
  }

  std::optional<Lab> lab_;
  std::optional<ToyGraph> graph_;
  std::array<std::optional<Child>, 2> agents_;
};

TEST_F(Network, HostThatIsCutOffWhileItsStagesStartJoinsWhenTheCableIsIn) {
  start(0);
  await_process("keep");
  lab_->host(1).cut();
  start(1);
  await_process("right");
  std::this_thread::sleep_for(500ms);  // they are at work in the meantime
  lab_->host(1).restore();
  expect_all_frames();
}

TEST_F(Network, SourceThatStartsWhileItIsCutOffIsHeardWhenTheCableIsIn) {
  start(1);
  await_process("right");
  lab_->host(0).cut();
  start(0);
  await_process("numbers");
  std::this_thread::sleep_for(500ms);
  lab_->host(0).restore();
  expect_all_frames();
}

}  // namespace
}  // namespace cosegraph::test
