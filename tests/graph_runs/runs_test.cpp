#include "graph/runs.hpp"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <optional>

#include "io/file.hpp"

namespace cosegraph::graph {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class Runs : public testing::Test {
 protected:
  void SetUp() override { ::setenv("COSEGRAPH_RUNTIME_DIR", folder_.path().c_str(), 1); }
  void TearDown() override { ::unsetenv("COSEGRAPH_RUNTIME_DIR"); }

  static GraphDescription graph(const std::string& name, const std::string& instance) {
    return {.graph = name,
            .instance = instance,
            .window = 7,
            .stages = {{.name = "source", .use = "source"}}};
  }
  template <class Action>
  static std::string refusal(Action action) {
    try {
      action();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  io::TemporaryFolder folder_;
};

TEST_F(Runs, AreSeenWhileTheirKeeperLives) {
  {
    const RunFolder kept(graph("mugs", "abc"), "");
    const auto runs = live_runs();
    ASSERT_THAT(runs, SizeIs(1));
    EXPECT_EQ(runs[0].graph, "mugs");
    EXPECT_EQ(runs[0].instance, "abc");
    EXPECT_EQ(runs[0].host, "");
    EXPECT_EQ(runs[0].pid, ::getpid());
  }
  EXPECT_THAT(live_runs(), IsEmpty());
  EXPECT_FALSE(fs::exists(folder_ / "mugs")) << "nothing is left behind";
}

TEST_F(Runs, AreFoundByNameAsTheyRun) {
  const RunFolder kept(graph("mugs", "abc"), "");
  const GraphDescription found = find_run({.graph = "mugs"});
  EXPECT_EQ(found.instance, "abc");
  EXPECT_EQ(found.window, 7);
  GraphDescription changed = graph("mugs", "abc");
  changed.window = 3;
  kept.publish(changed);
  EXPECT_EQ(find_run({.graph = "mugs"}).window, 3);
}

TEST_F(Runs, OfOneGraphAreToldApartByInstance) {
  const RunFolder first(graph("mugs", "abc"), "");
  const RunFolder second(graph("mugs", "xyz"), "");
  EXPECT_THAT(refusal([] { find_run({.graph = "mugs"}); }),
              HasSubstr("several runs of 'mugs': mugs (instance abc), mugs (instance xyz)"));
  EXPECT_EQ(find_run({.graph = "mugs", .instance = "x"}).instance, "xyz");
}

TEST_F(Runs, NeedNoNameIfThereIsOne) {
  EXPECT_THAT(refusal([] { find_run({}); }), HasSubstr("no graph runs on this machine"));
  const RunFolder first(graph("mugs", "abc"), "");
  EXPECT_EQ(find_run({}).graph, "mugs");
  const RunFolder second(graph("chairs", "xyz"), "");
  EXPECT_THAT(refusal([] { find_run({}); }), HasSubstr("several graphs run here: chairs"));
}

TEST_F(Runs, UnknownOnesAreRefusedNamingThoseThereAre) {
  const RunFolder kept(graph("mugs", "abc"), "");
  EXPECT_THAT(refusal([] { find_run({.graph = "chairs"}); }),
              HasSubstr("no run of 'chairs' is known on this machine; there are: mugs"));
}

TEST_F(Runs, OfAGraphFileThatIsRunElsewhereHaveNoInstance) {
  io::write_file(folder_ / "mugs.yaml", to_yaml(graph("mugs", "")));
  const GraphDescription found = find_run({.graph = (folder_ / "mugs.yaml").string()});
  EXPECT_EQ(found.graph, "mugs");
  EXPECT_EQ(found.instance, "");
}

TEST_F(Runs, HaveOneKeeperPerHost) {
  std::optional<RunFolder> rack(std::in_place, graph("mugs", ""), "rack");
  const RunFolder robot(graph("mugs", ""), "robot");
  EXPECT_THAT(refusal([] { RunFolder(graph("mugs", ""), "rack"); }),
              HasSubstr("graph 'mugs', host 'rack': is run already"));
  EXPECT_EQ(find_run({.graph = "mugs"}).instance, "") << "two hosts of one run are one run";
  rack.reset();
  EXPECT_TRUE(fs::exists(folder_ / "mugs/agents/rack/graph.yaml")) << "a new keeper may follow";
  rack.emplace(graph("mugs", ""), "rack");
  EXPECT_THAT(live_runs(), SizeIs(2));
  rack->discard();
}

// Each cleans up what it takes for abandoned when it begins, and after itself when it ends.
TEST_F(Runs, ThatBeginAndEndTogetherDoNotHinderEachOther) {
  std::vector<pid_t> children;
  for (int c = 0; c < 6; ++c) {
    const pid_t pid = ::fork();
    if (pid == 0) {
      try {
        for (int i = 0; i < 60; ++i) {
          const RunFolder kept(graph("mugs", std::to_string(c) + "-" + std::to_string(i)), "");
          if (!fs::exists(kept.path() / "graph.yaml")) ::_exit(2);
        }
        ::_exit(0);
      } catch (const std::exception& error) {
        std::fprintf(stderr, "%s\n", error.what());
        ::_exit(1);
      }
    }
    children.push_back(pid);
  }
  for (const pid_t pid : children) {
    int status = -1;
    ::waitpid(pid, &status, 0);
    EXPECT_EQ(status, 0);
  }
}

TEST_F(Runs, LeftByKilledKeepersAreCleanedUp) {
  const fs::path left = folder_ / "mugs/dead/all";
  fs::create_directories(left);
  std::ofstream(left / "keeper") << "1\n";
  EXPECT_THAT(live_runs(), IsEmpty());
  const RunFolder kept(graph("mugs", "abc"), "");
  EXPECT_FALSE(fs::exists(left));
}

}  // namespace
}  // namespace cosegraph::graph
