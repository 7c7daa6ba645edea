// The real stages on three hosts: the labels are those of one host, whichever stage is where.
#include <gmock/gmock.h>

#include <array>
#include <filesystem>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "end_to_end/world.hpp"
#include "hosts/lab.hpp"

namespace cosegraph::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr int kFrames = 60;
constexpr std::array kHosts = {"one", "two", "three"};

class PipelineOnThreeHosts : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (const std::string reason = Lab::unavailable(); !reason.empty()) GTEST_SKIP() << reason;
    ::setenv("COSEGRAPH_RUNTIME_DIR", world_.path("runtime").c_str(), 1);
    lab_.emplace(LabOptions{.hosts = 3, .subnets = 2, .multicast = false});
    World::expect_fine({"cosegraph", "segment", "--model", world_.path("model.coseg"),
                        world_.path("queries"), "-o", world_.path("expected")});
    fs::create_directories(world_.path("stream"));
    for (int i = 0; i < kFrames; ++i)
      fs::create_symlink(world_.path("queries/" + query_of(i)),
                         world_.path("stream/q" + std::to_string(i) + ".ply"));
  }
  void TearDown() override { ::unsetenv("COSEGRAPH_RUNTIME_DIR"); }

  static std::string query_of(int frame) {
    return "query-view" + std::to_string(frame % 2) + ".ply";
  }

  // The shipped graph, which finds its hosts by their addresses. Source and sink are on host one.
  // `rate`: of the frames, Hz; 0: as fast as it goes.
  void start(bool secure, int rate) {
    std::string text = slurp(std::string(COSEGRAPH_SOURCE_DIR) + "/config/graphs/segment.yaml");
    std::string peers;
    std::string hosts;
    for (int i = 0; i < lab_->size(); ++i) {
      const std::string comma = i == 0 ? "" : ", ";
      peers += comma + lab_->host(i).address();
      hosts += comma + kHosts.at(static_cast<std::size_t>(i)) +
               ": {address: " + lab_->host(i).address() + "}";
    }
    replace(text, "graph: segment", "graph: " + name_);
    replace(text, "stages:",
            "dds: {discovery: {peers: [" + peers + "]}" + (secure ? ", security: keys" : "") +
                "}\nhosts: {" + hosts + "}\nstages:");
    const std::map<std::string, std::string> host_of = {
        {"model", "one"}, {"source", "one"},  {"sink", "one"},          {"supervoxels", "two"},
        {"cpc", "two"},   {"spectra", "two"}, {"descriptors", "three"}, {"fisher", "three"},
        {"svm", "three"}, {"astar", "three"}};
    for (const auto& [stage, host] : host_of)
      replace(text, "\n  " + stage + ":\n", "\n  " + stage + ":\n    host: " + host + "\n");
    replace(text, "file: model.coseg", "file: " + world_.path("model.coseg"));
    replace(text, "path: [queries]",
            "path: [" + world_.path("stream") + "], rate: " + std::to_string(rate));
    replace(text, "folder: out", "folder: " + out());
    io::write_file(file(), text);
    if (secure) World::expect_fine({"cosegraph", "keys", "init", file()});
    started_ = Clock::now();
    for (int i = 0; i < lab_->size(); ++i)
      agents_.push_back(lab_->host(i).start(
          {"cosegraph", "agent", "--host", kHosts.at(static_cast<std::size_t>(i)), file()}));
  }

  static void replace(std::string& text, const std::string& old, const std::string& by) {
    const std::size_t at = text.find(old);
    ASSERT_NE(at, std::string::npos) << old;
    text.replace(at, old.size(), by);
  }

  std::string file() const { return world_.path("graph.yaml"); }
  std::string out() const { return world_.path("out"); }

  bool await_written(int frame) const {
    const std::string name = out() + "/q" + std::to_string(frame) + ".ply";
    for (const auto limit = Clock::now() + 60s; Clock::now() < limit;) {
      if (fs::exists(name)) return true;
      std::this_thread::sleep_for(10ms);
    }
    ADD_FAILURE() << name << " did not come out";
    for (auto& agent : agents_) std::cerr << agent.errors();
    return false;
  }

  nlohmann::json ps() {
    const Outcome outcome = lab_->host(1).run({"cosegraph", "ps", file(), "--json"});
    EXPECT_EQ(outcome.status, 0) << outcome.errors;
    const auto json = nlohmann::json::parse(outcome.output, nullptr, false);
    EXPECT_TRUE(json.is_object()) << outcome.output << outcome.errors;
    return json.is_object() ? json : nlohmann::json::object();
  }

  void expect_labels_of_one_host() {
    for (int i = 0; i < kFrames; ++i) {
      if (!await_written(i)) return;
      const std::string expected = slurp(world_.path("expected/" + query_of(i)));
      ASSERT_FALSE(expected.empty());
      EXPECT_EQ(slurp(out() + "/q" + std::to_string(i) + ".ply"), expected) << i;
    }
    nlohmann::json account;
    for (const auto limit = Clock::now() + 20s; Clock::now() < limit;) {
      account = ps()["account"];
      if (account.is_object() && account["labelled"] == kFrames) break;
    }
    EXPECT_EQ(account["labelled"], kFrames) << account;
    EXPECT_EQ(account["failed"], 0) << account;
  }

  const std::string name_ = "pipeline" + std::to_string(::getpid());
  World world_;
  std::optional<Lab> lab_;
  std::vector<Child> agents_;
  Clock::time_point started_;
};

TEST_P(PipelineOnThreeHosts, LabelsAsOneHostDoes) {
  start(GetParam() == std::string("secure"), 0);
  ASSERT_TRUE(await_written(0));
  std::cout << "first frame " << std::chrono::duration<double>(Clock::now() - started_).count()
            << " s after the agents were started\n";
  expect_labels_of_one_host();
}

INSTANTIATE_TEST_SUITE_P(Security, PipelineOnThreeHosts, testing::Values("plain", "secure"),
                         [](const auto& test) { return std::string(test.param); });

class StageOnThreeHosts : public PipelineOnThreeHosts {};

TEST_F(StageOnThreeHosts, MovesToAnotherHostWhileFramesFlow) {
  start(false, 8);
  ASSERT_TRUE(await_written(5));
  const Outcome swap = lab_->host(0).run(
      {"cosegraph", "swap", "cpc", "--host", "three", "--graph", file(), "--json"});
  ASSERT_EQ(swap.status, 0) << swap.errors;
  const auto report = nlohmann::json::parse(swap.output);
  EXPECT_EQ(report["lost"], 0) << report;
  EXPECT_EQ(report["doubled"], 0) << report;
  EXPECT_FALSE(fs::exists(out() + "/q" + std::to_string(kFrames - 1) + ".ply"))
      << "the stream was over before the stage moved";
  expect_labels_of_one_host();
  std::map<std::string, std::string> hosts;
  const nlohmann::json seen = ps();
  for (const auto& process : seen.at("processes"))
    hosts[process.at("process")] = process.at("host");
  EXPECT_EQ(hosts["cpc"], "three");
  EXPECT_EQ(hosts["supervoxels"], "two");
}

}  // namespace
}  // namespace cosegraph::test
