// `cosegraph up`: every stage a process, and none of them left behind.
#include <gmock/gmock.h>

#include <csignal>
#include <set>
#include <thread>

#include "end_to_end/world.hpp"
#include "io/cloud_io.hpp"

namespace cosegraph::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;

// Processes whose command line names `text`, other than `except`.
std::vector<pid_t> processes_naming(const std::string& text, pid_t except) {
  std::vector<pid_t> result;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    const pid_t pid = std::stoi(name);
    if (pid == except || pid == ::getpid()) continue;
    if (slurp(entry.path() / "cmdline").find(text) != std::string::npos) result.push_back(pid);
  }
  return result;
}

std::set<std::string> shared_memory_files() {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator("/dev/shm"))
    if (entry.path().filename().string().find("fastrtps") != std::string::npos)
      names.insert(entry.path().filename());
  return names;
}

class Up : public testing::Test {
 protected:
  Up() {
    fs::create_directories(world_.path("stream"));
    for (int i = 0; i < 100; ++i)
      fs::copy_file(world_.path("queries/query-view0.ply"),
                    world_.path("stream/q" + std::to_string(i) + ".ply"));
    // The graph's name makes its processes recognisable.
    std::string text = slurp(fs::path(COSEGRAPH_SOURCE_DIR) / "config/graphs/segment.yaml");
    text.replace(text.find("graph: segment"), 14, "graph: " + name_);
    std::ofstream(world_.path("graph.yaml")) << text;
  }

  std::vector<std::string> command(const std::string& query) const {
    return {"cosegraph",
            "up",
            world_.path("graph.yaml"),
            "--param",
            "model.file=" + world_.path("model.coseg"),
            "--param",
            "source.path=" + world_.path(query),
            "--param",
            "sink.folder=" + world_.path("out")};
  }

  // Waits until stage processes are at work and a result has been written.
  std::vector<pid_t> wait_until_running(pid_t parent) const {
    for (int i = 0; i < 300; ++i) {
      std::vector<pid_t> pids = children(parent);
      if (pids.size() == 10 && fs::exists(world_.path("out/q0.ply"))) return pids;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    ADD_FAILURE() << "the graph did not start";
    return {};
  }

  // Stops the process for longer than a silent participant is waited for.
  static void pause(pid_t pid) {
    ::kill(pid, SIGSTOP);
    std::this_thread::sleep_for(std::chrono::seconds(3));
    ::kill(pid, SIGCONT);
  }

  void expect_all_labelled(Program& program) const {
    const Outcome outcome = program.wait();
    EXPECT_EQ(outcome.status, 0) << outcome.errors;
    EXPECT_THAT(outcome.output,
                HasSubstr("admitted 100 = labelled 100 + consumed 0 + failed 0; dropped 0"));
  }

  static std::vector<pid_t> children(pid_t parent) {
    std::vector<pid_t> result;
    for (const pid_t pid : processes_naming("cosegraph-", parent)) {
      const std::string stat = slurp("/proc/" + std::to_string(pid) + "/stat");
      const std::size_t after_name = stat.rfind(')');
      if (after_name == std::string::npos) continue;
      if (std::stoi(stat.substr(after_name + 4)) == parent) result.push_back(pid);
    }
    return result;
  }

  static void expect_gone(const std::vector<pid_t>& pids) {
    for (const pid_t pid : pids) {
      for (int i = 0; i < 100 && ::kill(pid, 0) == 0; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
      EXPECT_NE(::kill(pid, 0), 0) << "process " << pid << " was left behind";
    }
  }

  const std::string name_ = "up" + std::to_string(::getpid());
  World world_;
};

TEST_F(Up, InterruptLeavesNoProcessAndNoSharedMemory) {
  const std::set<std::string> before = shared_memory_files();
  Program program(command("stream"));
  const std::vector<pid_t> pids = wait_until_running(program.pid());
  ::kill(program.pid(), SIGINT);
  EXPECT_EQ(program.wait().status, 1);
  expect_gone(pids);
  std::set<std::string> left = shared_memory_files();
  for (const auto& name : before) left.erase(name);
  EXPECT_THAT(left, IsEmpty());
}

TEST_F(Up, InterruptIsHowALiveStreamEnds) {
  std::vector<std::string> words = command("stream");
  for (auto& word : words)
    if (word.starts_with("source.path=")) word = "source.ros2.topic=/nobody/" + name_;
  Program program(words);
  for (int i = 0; i < 300 && children(program.pid()).size() < 10; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  ::kill(program.pid(), SIGINT);
  const Outcome outcome = program.wait();
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.errors, Not(HasSubstr("stopped before")));
  EXPECT_THAT(outcome.output, HasSubstr("admitted 0 = labelled 0"));
}

TEST_F(Up, StagesDieWithAParentThatIsKilled) {
  Program program(command("stream"));
  const std::vector<pid_t> pids = wait_until_running(program.pid());
  ::kill(program.pid(), SIGKILL);
  EXPECT_EQ(program.wait().status, 128 + SIGKILL);
  expect_gone(pids);
}

TEST_F(Up, DeathOfAStageEndsTheRunWithItsName) {
  Program program(command("stream"));
  const std::vector<pid_t> pids = wait_until_running(program.pid());
  const std::vector<pid_t> cpc = processes_naming("cosegraph-cpc", program.pid());
  for (const pid_t pid : cpc)
    if (std::ranges::find(pids, pid) != pids.end()) ::kill(pid, SIGKILL);
  const Outcome outcome = program.wait();
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.errors, HasSubstr("stage cpc was killed by Killed"));
  expect_gone(pids);
}

TEST_F(Up, StageThatIsRestartedFinishesTheStream) {
  std::string text = slurp(world_.path("graph.yaml"));
  text.replace(text.find("    use: cpc\n"), 13,
               "    use: cpc\n    restart: {policy: on-failure, max: 3}\n");
  std::ofstream(world_.path("graph.yaml")) << text;
  Program program(command("stream"));
  const std::vector<pid_t> pids = wait_until_running(program.pid());
  for (const pid_t pid : processes_naming("cosegraph-cpc", program.pid()))
    if (std::ranges::find(pids, pid) != pids.end()) ::kill(pid, SIGKILL);
  const Outcome outcome = program.wait();
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.errors, HasSubstr("starting it again"));
  EXPECT_THAT(outcome.output,
              HasSubstr("admitted 100 = labelled 100 + consumed 0 + failed 0; dropped 0"));
}

// A machine that is suspended, a debugger, a host without CPU to spare.
TEST_F(Up, NothingIsLostWhenAStagePauses) {
  Program program(command("stream"));
  const std::vector<pid_t> pids = wait_until_running(program.pid());
  for (const pid_t pid : processes_naming("cosegraph-descriptors", program.pid()))
    if (std::ranges::find(pids, pid) != pids.end()) pause(pid);
  expect_all_labelled(program);
}

TEST_F(Up, NothingIsLostWhenARunInOneProcessPauses) {
  std::vector<std::string> words = command("stream");
  words[1] = "run";
  Program program(words);
  for (int i = 0; i < 300 && !fs::exists(world_.path("out/q0.ply")); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  pause(program.pid());
  expect_all_labelled(program);
}

TEST_F(Up, StageMayBeAProgramOfItsOwn) {
  std::string text = slurp(world_.path("graph.yaml"));
  text.replace(text.find("    use: cpc\n"), 13,
               "    exec: " COSEGRAPH_BINARY_DIR
               "/bin/cosegraph-cpc\n"
               "    outputs: {segments: Segments}\n");
  std::ofstream(world_.path("graph.yaml")) << text;
  const Outcome outcome = run(command("queries"));
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, HasSubstr("labelled 2"));
}

TEST_F(Up, NewModelIsTakenOverBetweenTwoFrames) {
  World::expect_fine({"cosegraph", "train", "--reference", world_.path("reference.off"), "--param",
                      "source.camera.count=3", "-o", world_.path("new.coseg")});
  const auto labels_of = [&](const char* model) {
    const std::string folder = world_.path(std::string("by_") + model);
    World::expect_fine({"cosegraph", "segment", "--model", world_.path(model),
                        world_.path("queries/query-view0.ply"), "-o", folder});
    return slurp(folder + "/query-view0.ply");
  };
  const std::string old_labels = labels_of("model.coseg");
  const std::string new_labels = labels_of("new.coseg");
  ASSERT_NE(old_labels, new_labels) << "the models cannot be told apart by what they say";

  Program program(command("stream"));
  wait_until_running(program.pid());
  const Outcome swap = run({"cosegraph", "swap", "model", "--param",
                            "file=" + world_.path("new.coseg"), "--graph", name_});
  EXPECT_EQ(swap.status, 0) << swap.errors << swap.output;
  expect_all_labelled(program);
  // Each frame is wholly of one model, and the new one stays.
  int of_old = 0;
  for (int i = 0; i < 100; ++i) {
    const std::string labels = slurp(world_.path("out/q" + std::to_string(i) + ".ply"));
    if (labels == old_labels && of_old == i)
      ++of_old;
    else
      ASSERT_EQ(labels, new_labels) << "frame " << i;
  }
  EXPECT_GT(of_old, 0);
  EXPECT_LT(of_old, 100);
}

TEST_F(Up, ModelThatTheStagesDoNotFitIsRefused) {
  World::expect_fine({"cosegraph", "train", "--reference", world_.path("reference.off"), "--param",
                      "source.camera.count=3", "--config", "shot+fv", "-o",
                      world_.path("other.coseg")});
  Program program(command("stream"));
  wait_until_running(program.pid());
  const Outcome swap = run({"cosegraph", "swap", "model", "--param",
                            "file=" + world_.path("other.coseg"), "--graph", name_});
  EXPECT_EQ(swap.status, 1) << swap.output;
  EXPECT_THAT(swap.errors, HasSubstr("do not fit"));
  expect_all_labelled(program);
}

// Without multicast: participants of this host find each other by its address.
TEST_F(Up, FindsItsStagesByPeers) {
  std::string text = slurp(world_.path("graph.yaml"));
  text.insert(text.find("window:"), "dds: {discovery: {peers: [127.0.0.1]}}\n");
  std::ofstream(world_.path("graph.yaml")) << text;
  const Outcome outcome = run(command("queries"));
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, HasSubstr("labelled 2"));
}

TEST_F(Up, StageThatCannotStartEndsTheRun) {
  std::vector<std::string> words = command("queries");
  words.insert(words.end(), {"--param", "model.file=" + world_.path("absent.coseg")});
  const Outcome outcome = run(words);
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.errors, HasSubstr("absent.coseg"));
}

}  // namespace
}  // namespace cosegraph::test
