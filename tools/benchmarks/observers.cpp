#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <map>

#include "tools/benchmarks/bench.hpp"
#include "tools/benchmarks/running_graph.hpp"

// A graph that nobody looks at, and the same with a monitor, a recorder of all topics and three
// `topic echo` attached.
namespace cosegraph::bench {
namespace {

namespace fs = std::filesystem;

constexpr std::array kEchoed = {"source/dense", "descriptors/descriptors", "svm/scores"};

class Observers {
 public:
  explicit Observers(const RunningGraph& graph)
      : graph_(graph.file().string()), folder_(graph.folder()) {
    start("recorder", {"record", graph_, "-o", recording().string()});
    start("monitor", {"monitor", graph_, "--port", "0"});
    for (const char* topic : kEchoed)
      start(std::string("echo ") + topic, {"topic", "echo", topic, "-g", graph_});
  }
  Observers(const Observers&) = delete;
  Observers& operator=(const Observers&) = delete;
  ~Observers() { end(); }

  // CPU milliseconds of each by its name. The recorder comes to its end with the stream.
  std::map<std::string, double> end() {
    std::map<std::string, double> spent;
    for (const auto& [name, pid] : pids_) {
      if (name != "recorder") ::kill(pid, SIGINT);
      rusage usage{};
      int status = 0;
      ::wait4(pid, &status, 0, &usage);
      spent[name] = milliseconds(usage.ru_utime) + milliseconds(usage.ru_stime);
    }
    pids_.clear();
    return spent;
  }

  // As `cosegraph info` tells it; null if there is none.
  nlohmann::json recorded() const {
    const fs::path answer = folder_ / "info.json";
    const std::string command =
        program() + " info " + recording().string() + " --json > " + answer.string();
    if (std::system(command.c_str()) != 0) return {};
    return nlohmann::json::parse(io::read_file(answer), nullptr, false);
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

struct Run {
  double rate = 0.0;                    // frames/s in the second half
  std::map<std::string, double> spent;  // CPU ms per frame of each observer, with its start
  std::uint64_t recorded = 0;           // bytes
  bool whole = false;                   // all frames are labelled, all messages recorded
};

Run run(const Subject& subject, int frames, double pace, bool observed) {
  RunningGraph graph(subject,
                     {.frames = frames, .change = [&](graph::GraphDescription& description) {
                        graph::set_param(description, "source", "rate", {std::to_string(pace)});
                      }});
  graph.await_written(1);
  std::optional<Observers> observers;
  if (observed) observers.emplace(graph);
  graph.await_end();
  Run result;
  result.rate = graph.rate(0.5);  // observers take a while to start
  result.whole = graph.account()["labelled"] == frames;
  if (!observers) return result;
  for (const auto& [name, time] : observers->end()) result.spent[name] = time / frames;
  const nlohmann::json recorded = observers->recorded();
  result.recorded = fs::file_size(observers->recording());
  result.whole = result.whole && recorded.is_object() && recorded["complete"] == true;
  return result;
}

}  // namespace

int bench_observers(int frames) {
  const Subject subject = load_subject();
  std::printf("observers: %s, fpfh+fv+iso, %d frames, a process per stage, one thread each\n",
              subject.name.c_str(), frames);
  bool all_whole = true;
  double full = 0.0;
  constexpr std::array<std::pair<const char*, double>, 2> kPaces{
      {{"full speed", 0.0}, {"half speed", 0.5}}};
  for (const auto& [pace, share] : kPaces) {
    constexpr int kRounds = 3;  // in turn, so that both see the same machine
    std::vector<double> alone;
    std::vector<double> watched;
    Run last;
    for (int round = 0; round < kRounds; ++round) {
      alone.push_back(run(subject, frames, share * full, false).rate);
      last = run(subject, frames, share * full, true);
      watched.push_back(last.rate);
      all_whole = all_whole && last.whole;
    }
    std::printf("  %s: alone %.2f frames/s, observed %.2f (%+.1f %%)\n", pace, median(alone),
                median(watched), 1e2 * (median(watched) / median(alone) - 1.0));
    for (const auto& [name, time] : last.spent)
      std::printf("    %-30s %6.2f ms CPU per frame\n", name.c_str(), time);
    std::printf("    recorded %.1f MB, %s\n", 1e-6 * static_cast<double>(last.recorded),
                last.whole ? "complete" : "INCOMPLETE, or frames failed");
    full = median(alone);
  }
  return all_whole ? 0 : 1;
}

}  // namespace cosegraph::bench
