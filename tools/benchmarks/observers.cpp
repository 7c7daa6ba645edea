#include <signal.h>
#include <sys/wait.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <thread>

#include "tools/benchmarks/bench.hpp"
#include "tools/benchmarks/running_graph.hpp"

// A running graph, to which by turns a monitor, a recorder of all topics and three `topic echo` are
// attached.
namespace cosegraph::bench {
namespace {

namespace fs = std::filesystem;

using namespace std::chrono_literals;
using Clock = RunningGraph::Clock;

constexpr std::array kEchoed = {"source/dense", "descriptors/descriptors", "svm/scores"};
constexpr auto kSettle = 7s;       // what has started or ended has done so
constexpr auto kWindow = 4s;       // in which frames are counted
constexpr int kMostFrames = 1000;  // per turn: a stream that does not end before its time

// CPU seconds of a process so far.
double cpu_of(pid_t pid) {
  clockid_t clock{};
  timespec time{};
  if (::clock_getcpuclockid(pid, &clock) != 0 || ::clock_gettime(clock, &time) != 0) return 0.0;
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

class Observers {
 public:
  explicit Observers(const RunningGraph& graph)
      : graph_(graph.file().string()), folder_(graph.folder()) {
    fs::remove(recording());
    start("recorder", {"record", graph_, "-o", recording().string()});
    start("monitor", {"monitor", graph_, "--port", "0"});
    for (const char* topic : kEchoed)
      start(std::string("echo ") + topic, {"topic", "echo", topic, "-g", graph_});
  }
  Observers(const Observers&) = delete;
  Observers& operator=(const Observers&) = delete;
  ~Observers() { end(); }

  // CPU seconds of each by its name.
  std::map<std::string, double> spent() const {
    std::map<std::string, double> result;
    for (const auto& [name, pid] : pids_) result[name] = cpu_of(pid);
    return result;
  }

  void end() {
    for (const auto& [name, pid] : pids_) ::kill(pid, SIGINT);
    for (const auto& [name, pid] : pids_) ::waitpid(pid, nullptr, 0);
    pids_.clear();
  }

  // Whether `cosegraph info` calls it complete.
  bool is_recording_complete() const {
    const fs::path answer = folder_ / "info.json";
    const std::string command =
        program() + " info " + recording().string() + " --json > " + answer.string();
    if (std::system(command.c_str()) != 0) return false;
    const auto info = nlohmann::json::parse(io::read_file(answer), nullptr, false);
    return info.is_object() && info["complete"] == true;
  }
  fs::path recording() const { return folder_ / "run.mcap"; }

 private:
  void start(const std::string& name, std::vector<std::string> words) {
    words.insert(words.begin(), program());
    const std::string files = "observer" + std::to_string(pids_.size());
    pids_.emplace_back(name, start_program(std::move(words), folder_ / (files + ".out"),
                                           folder_ / (files + ".err")));
  }

  std::string graph_;
  fs::path folder_;
  std::vector<std::pair<std::string, pid_t>> pids_;
};

struct Window {
  Clock::time_point begin;
  Clock::time_point end;
};

Window pass() {
  Window window{.begin = Clock::now()};
  std::this_thread::sleep_for(kWindow);
  window.end = Clock::now();
  return window;
}

struct Outcome {
  std::vector<double> alone;            // frames/s of each turn
  std::vector<double> observed;         // the same
  std::vector<double> change;           // of each against the turns alone before and after it
  std::map<std::string, double> spent;  // CPU ms per frame of each observer, in the last turn
  std::uint64_t recorded = 0;           // bytes, in all
  bool whole = true;                    // no frame has failed, all messages are recorded
};

Outcome run(const Subject& subject, int turns, double pace) {
  RunningGraph graph(
      subject,
      {.frames = kMostFrames * (turns + 1), .change = [&](graph::GraphDescription& description) {
         graph::set_param(description, "source", "rate", {std::to_string(pace)});
       }});
  graph.await_written(1);
  Outcome outcome;
  std::vector<Window> alone;
  std::vector<Window> observed;
  std::map<std::string, double> seconds;
  std::this_thread::sleep_for(kSettle);
  alone.push_back(pass());
  for (int turn = 0; turn < turns && graph.running(); ++turn) {
    Observers observers(graph);
    std::this_thread::sleep_for(kSettle);
    const auto before = observers.spent();
    observed.push_back(pass());
    seconds = observers.spent();
    for (const auto& [name, time] : before) seconds[name] -= time;
    observers.end();
    outcome.recorded += fs::file_size(observers.recording());
    outcome.whole = outcome.whole && observers.is_recording_complete();
    std::this_thread::sleep_for(kSettle);
    alone.push_back(pass());
  }
  if (!graph.running()) throw Error("the graph has ended before its time");
  graph.stop();
  outcome.whole = outcome.whole && graph.account()["failed"] == 0;

  const auto outputs = graph.outputs();
  const auto rate = [&](const Window& window) {
    const auto frames = std::ranges::lower_bound(outputs, window.end) -
                        std::ranges::lower_bound(outputs, window.begin);
    return static_cast<double>(frames) /
           std::chrono::duration<double>(window.end - window.begin).count();
  };
  for (const auto& window : alone) outcome.alone.push_back(rate(window));
  for (std::size_t i = 0; i < observed.size(); ++i) {
    outcome.observed.push_back(rate(observed[i]));
    outcome.change.push_back(2.0 * outcome.observed[i] / (outcome.alone[i] + outcome.alone[i + 1]) -
                             1.0);
  }
  const double frames = outcome.observed.back() * std::chrono::duration<double>(kWindow).count();
  for (const auto& [name, time] : seconds) outcome.spent[name] = 1e3 * time / frames;
  return outcome;
}

}  // namespace

int bench_observers(int turns) {
  const Subject subject = load_subject();
  std::printf("observers: %s, fpfh+fv+iso, %d turns, a process per stage, one thread each\n",
              subject.name.c_str(), turns);
  bool all_whole = true;
  double full = 0.0;
  constexpr std::array<std::pair<const char*, double>, 2> kPaces{
      {{"full speed", 0.0}, {"half speed", 0.5}}};
  for (const auto& [pace, share] : kPaces) {
    const Outcome outcome = run(subject, turns, share * full);
    full = median(outcome.alone);
    std::printf(
        "  %s: alone %.2f frames/s, observed %.2f; change %+.1f %% (quartiles %+.1f, %+.1f)\n",
        pace, full, median(outcome.observed), 1e2 * median(outcome.change),
        1e2 * quantile(outcome.change, 0.25), 1e2 * quantile(outcome.change, 0.75));
    for (const auto& [name, time] : outcome.spent)
      std::printf("    %-30s %6.2f ms CPU per frame\n", name.c_str(), time);
    std::printf("    recorded %.1f MB, %s\n", 1e-6 * static_cast<double>(outcome.recorded),
                outcome.whole ? "complete" : "INCOMPLETE, or frames failed");
    std::fflush(stdout);
    all_whole = all_whole && outcome.whole;
  }
  return all_whole ? 0 : 1;
}

}  // namespace cosegraph::bench
