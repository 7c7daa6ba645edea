#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/random.hpp"
#include "graph/description.hpp"
#include "io/cloud_io.hpp"
#include "io/file.hpp"
#include "model/model.hpp"
#include "pipeline/pipeline.hpp"
#include "tools/benchmarks/bench.hpp"

// Stages of a running graph are swapped, and killed, while frames flow.
namespace cosegraph::bench {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using SystemClock = std::chrono::system_clock;

constexpr std::array kStages = {"supervoxels", "cpc",     "descriptors", "fisher",
                                "svm",         "spectra", "astar",       "sink"};

double milliseconds(SystemClock::duration time) {
  return std::chrono::duration<double, std::milli>(time).count();
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  return values[std::min(values.size() - 1,
                         static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

// Fixed by a seed: the order in which stages are hit.
std::string stage_at(int i, Random& random) {
  return i % 10 == 9 ? "source" : kStages.at(random.below(kStages.size()));
}

// `cosegraph up` on a stream of query views, each of them many times.
class RunningGraph {
 public:
  RunningGraph(const Subject& subject, int frames) {
    ::setenv("COSEGRAPH_RUNTIME_DIR", (folder_.path() / "runtime").c_str(), 1);
    pipeline::Config config = pipeline::config_from_name("fpfh+fv+iso");
    config.descriptors.threads = 1;
    io::write_file(folder_.path() / "model.coseg",
                   model::to_bytes(pipeline::train(subject.reference, config)));
    fs::create_directories(folder_.path() / "views");
    fs::create_directories(folder_.path() / "stream");
    for (std::size_t i = 0; i < subject.queries.size(); ++i)
      io::write_cloud(view(i), subject.queries[i]);
    for (int i = 0; i < frames; ++i)
      fs::create_symlink(view(static_cast<std::size_t>(i) % subject.queries.size()),
                         folder_.path() / "stream" / ("q" + std::to_string(i) + ".ply"));
    start();
  }
  ~RunningGraph() {
    if (pid_ > 0) ::kill(pid_, SIGTERM);
    if (pid_ > 0) ::waitpid(pid_, nullptr, 0);
    ::unsetenv("COSEGRAPH_RUNTIME_DIR");
  }

  bool running() {
    if (pid_ > 0 && ::waitpid(pid_, nullptr, WNOHANG) == pid_) pid_ = -1;
    return pid_ > 0;
  }
  void await_end() {
    while (running()) std::this_thread::sleep_for(20ms);
  }

  // How many frames have come out. Asked while times are taken: looks at names alone.
  int written() const {
    std::error_code ignored;
    return static_cast<int>(
        std::ranges::count_if(fs::directory_iterator(folder_.path() / "out", ignored),
                              [](const auto& entry) { return is_output(entry.path()); }));
  }

  // When each frame has come out, in order.
  std::vector<SystemClock::time_point> outputs() const {
    std::vector<SystemClock::time_point> result;
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(folder_.path() / "out", ignored))
      if (is_output(entry.path()))
        result.push_back(std::chrono::file_clock::to_sys(entry.last_write_time()));
    std::ranges::sort(result);
    return result;
  }

  // Resident memory of all stages, bytes.
  std::uint64_t memory() const {
    std::uint64_t sum = 0;
    for_each_process([&](pid_t pid, const std::string&) {
      std::uint64_t size = 0;
      std::uint64_t resident = 0;
      std::ifstream("/proc/" + std::to_string(pid) + "/statm") >> size >> resident;
      sum += resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
    });
    return sum;
  }

  bool kill_stage(const std::string& stage) const {
    bool done = false;
    for_each_process([&](pid_t pid, const std::string& line) {
      if (line.find("--stage " + stage + " ") == std::string::npos) return;
      ::kill(pid, SIGKILL);
      done = true;
    });
    return done;
  }

  nlohmann::json swap(const std::string& stage) const {
    const fs::path report = folder_.path() / "swap.json";
    const std::string command = program() + " swap " + stage + " --json > " + report.string() +
                                " 2> " + (folder_.path() / "swap.log").string();
    if (std::system(command.c_str()) != 0) return {};
    return nlohmann::json::parse(io::read_file(report), nullptr, false);
  }

  // Throws Error with what `up` has said if it did not come to its end.
  nlohmann::json account() const {
    const auto report =
        nlohmann::json::parse(io::read_file(folder_.path() / "up.json"), nullptr, false);
    if (!report.is_object())
      throw Error("the graph did not end: " + io::read_file(folder_.path() / "up.log"));
    return report["account"];
  }

 private:
  static bool is_output(const fs::path& file) { return file.extension() == ".ply"; }
  static std::string program() {
    return (fs::read_symlink("/proc/self/exe").parent_path() / "cosegraph").string();
  }
  fs::path view(std::size_t i) const {
    return folder_.path() / "views" / (std::to_string(i) + ".ply");
  }

  void start() {
    const std::string file = std::string(COSEGRAPH_SOURCE_DIR) + "/config/graphs/segment.yaml";
    graph::GraphDescription graph = graph::parse(io::read_file(file), file);
    for (auto& stage : graph.stages)
      stage.restart = {.policy = graph::RestartPolicy::on_failure, .max = 1000, .backoff = 0.01};
    graph::set_param(graph, "model", "file", {(folder_.path() / "model.coseg").string()});
    graph::set_param(graph, "source", "path", {(folder_.path() / "stream").string()});
    graph::set_param(graph, "sink", "folder", {(folder_.path() / "out").string()});
    graph::set_param(graph, "descriptors", "threads", {"1"});
    io::write_file(folder_.path() / "graph.yaml", graph::to_yaml(graph));
    std::vector<std::string> words{program(), "up", (folder_.path() / "graph.yaml").string(),
                                   "--json"};
    std::vector<char*> arguments;
    for (auto& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC;
    const std::string output = (folder_.path() / "up.json").string();
    const std::string errors = (folder_.path() / "up.log").string();
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(), kFlags, 0600);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, errors.c_str(), kFlags, 0600);
    const int status =
        ::posix_spawn(&pid_, arguments[0], &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (status != 0) throw Error("cannot run " + words[0]);
  }

  void for_each_process(const std::function<void(pid_t, const std::string&)>& visit) const {
    for (const auto& entry : fs::directory_iterator("/proc")) {
      const std::string name = entry.path().filename();
      if (name.find_first_not_of("0123456789") != std::string::npos) continue;
      std::ifstream file(entry.path() / "cmdline", std::ios::binary);
      std::string line{std::istreambuf_iterator<char>(file), {}};
      std::ranges::replace(line, '\0', ' ');
      if (line.find(folder_.path().string()) != std::string::npos &&
          line.find("--journal") != std::string::npos)
        visit(std::stoi(name), line);
    }
  }

  const io::TemporaryFolder folder_;
  pid_t pid_ = -1;
};

// Calls `disturb` with 0, 1, ... `count`-1, each after `spacing` more frames have come out.
void disturb_along(RunningGraph& graph, int count, int spacing,
                   const std::function<void(int)>& disturb) {
  for (int i = 0; i < count; ++i) {
    while (graph.running() && graph.written() < (i + 1) * spacing)
      std::this_thread::sleep_for(20ms);
    if (!graph.running()) return;
    disturb(i);
  }
}

bool print_account(const nlohmann::json& account, int frames) {
  const int labelled = account["labelled"];
  const int failed = account["failed"];
  const bool closed = account["admitted"] == frames && labelled + failed == frames;
  std::printf("  account: admitted %d = labelled %d + failed %d%s\n",
              account["admitted"].get<int>(), labelled, failed, closed ? "" : ": does not close");
  return closed;
}

bool soak_swaps(const Subject& subject, int swaps) {
  constexpr int kSpacing = 40;
  const int frames = kSpacing * (swaps + 2);
  RunningGraph graph(subject, frames);
  Random random(1);
  std::vector<double> excess;
  std::uint64_t lost = 0;
  std::uint64_t doubled = 0;
  int done = 0;
  disturb_along(graph, swaps, kSpacing, [&](int i) {
    const std::string stage = stage_at(i, random);
    const auto report = graph.swap(stage);
    if (!report.is_object() || !report.contains("lost")) {
      std::printf("  swap %d of %s failed\n", i, stage.c_str());
      return;
    }
    ++done;
    lost += report["lost"].get<std::uint64_t>();
    doubled += report["doubled"].get<std::uint64_t>();
    excess.push_back(report["pause_ms"].get<double>() - report["usual_ms"].get<double>());
  });
  graph.await_end();
  std::printf("soak, swaps: %d frames, %d of %d swaps done, %llu lost, %llu doubled\n", frames,
              done, swaps, static_cast<unsigned long long>(lost),
              static_cast<unsigned long long>(doubled));
  std::printf(
      "  longest interval around a swap beyond the usual: median %.0f ms, p90 %.0f, "
      "longest %.0f\n",
      quantile(excess, 0.5), quantile(excess, 0.9), quantile(excess, 1.0));
  return print_account(graph.account(), frames) && done == swaps && lost + doubled == 0;
}

bool soak_kills(const Subject& subject, int kills) {
  constexpr int kSpacing = 30;
  const int frames = kSpacing * (kills + 2);
  RunningGraph graph(subject, frames);
  Random random(2);
  std::vector<SystemClock::time_point> times;
  std::uint64_t memory_before = 0;
  std::uint64_t memory_after = 0;
  int of_sources = 0;
  disturb_along(graph, kills, kSpacing, [&](int i) {
    memory_after = graph.memory();
    if (i == kills / 10) memory_before = memory_after;
    const std::string stage = stage_at(i, random);
    if (!graph.kill_stage(stage)) return;
    of_sources += stage == "source" ? 1 : 0;
    times.push_back(SystemClock::now());
  });
  graph.await_end();
  const auto outputs = graph.outputs();
  std::vector<double> usual;
  std::vector<double> pauses(times.size(), 0.0);
  for (std::size_t i = 1; i < outputs.size(); ++i) {
    const double interval = milliseconds(outputs[i] - outputs[i - 1]);
    usual.push_back(interval);
    for (std::size_t k = 0; k < times.size(); ++k)
      if (outputs[i] > times[k] && outputs[i - 1] < times[k] + 2s)
        pauses[k] = std::max(pauses[k], interval);
  }
  std::printf("soak, kills: %d frames, %zu kills (%d of the source)\n", frames, times.size(),
              of_sources);
  std::printf(
      "  longest interval after a kill: median %.0f ms, p90 %.0f, longest %.0f; usual %.0f\n",
      quantile(pauses, 0.5), quantile(pauses, 0.9), quantile(pauses, 1.0), median(usual));
  std::printf("  memory of all stages: %.0f MB after a tenth of the kills, %.0f MB at the last\n",
              1e-6 * static_cast<double>(memory_before), 1e-6 * static_cast<double>(memory_after));
  return print_account(graph.account(), frames);
}

}  // namespace

int bench_soak(int repeats) {
  const Subject subject = load_subject();
  std::printf("soak: %s, fpfh+fv+iso, a process per stage\n", subject.name.c_str());
  const bool swaps = soak_swaps(subject, 10 * repeats);
  const bool kills = soak_kills(subject, 40 * repeats);
  return swaps && kills ? 0 : 1;
}

}  // namespace cosegraph::bench
