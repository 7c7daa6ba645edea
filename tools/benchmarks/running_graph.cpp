#include "tools/benchmarks/running_graph.hpp"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <thread>

#include "io/cloud_io.hpp"
#include "model/model.hpp"
#include "pipeline/pipeline.hpp"

namespace cosegraph::bench {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

bool is_output(const fs::path& file) {
  return file.extension() == ".ply";
}

}  // namespace

pid_t start_program(std::vector<std::string> words, const fs::path& output,
                    const fs::path& errors) {
  std::vector<char*> arguments;
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC;
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(), kFlags, 0600);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, errors.c_str(), kFlags, 0600);
  pid_t pid = -1;
  const int status =
      ::posix_spawn(&pid, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (status != 0) throw Error("cannot run " + words[0]);
  return pid;
}

RunningGraph::RunningGraph(const Subject& subject, const Options& options) {
  const fs::path& folder = folder_.path();
  ::setenv("COSEGRAPH_RUNTIME_DIR", (folder / "runtime").c_str(), 1);
  pipeline::Config config = pipeline::config_from_name(options.config);
  config.descriptors.threads = 1;
  io::write_file(folder / "model.coseg",
                 model::to_bytes(pipeline::train(subject.reference, config)));
  fs::create_directories(folder / "views");
  fs::create_directories(folder / "stream");
  const auto view = [&](std::size_t i) { return folder / "views" / (std::to_string(i) + ".ply"); };
  for (std::size_t i = 0; i < subject.queries.size(); ++i)
    io::write_cloud(view(i), subject.queries[i]);
  for (int i = 0; i < options.frames; ++i)
    fs::create_symlink(view(static_cast<std::size_t>(i) % subject.queries.size()),
                       folder / "stream" / ("q" + std::to_string(i) + ".ply"));

  const std::string shipped = std::string(COSEGRAPH_SOURCE_DIR) + "/config/graphs/segment.yaml";
  graph::GraphDescription graph = graph::parse(io::read_file(shipped), shipped);
  for (auto& stage : graph.stages)
    stage.restart = {.policy = graph::RestartPolicy::on_failure, .max = 1000, .backoff = 0.01};
  graph::set_param(graph, "model", "file", {(folder / "model.coseg").string()});
  graph::set_param(graph, "source", "path", {(folder / "stream").string()});
  graph::set_param(graph, "sink", "folder", {(folder / "out").string()});
  for (const auto& field : describe(config.descriptors))
    graph::set_param(graph, "descriptors", field.name, field.get());
  options.change(graph);
  io::write_file(file(), graph::to_yaml(graph));
  pid_ = start_program({program(), "up", file().string(), "--json"}, folder / "up.json",
                       folder / "up.log");
}

RunningGraph::~RunningGraph() {
  if (pid_ > 0) ::kill(pid_, SIGTERM);
  if (pid_ > 0) ::waitpid(pid_, nullptr, 0);
  ::unsetenv("COSEGRAPH_RUNTIME_DIR");
}

bool RunningGraph::running() {
  if (pid_ > 0 && ::waitpid(pid_, nullptr, WNOHANG) == pid_) pid_ = -1;
  return pid_ > 0;
}

void RunningGraph::await_end() {
  while (running()) std::this_thread::sleep_for(20ms);
}

void RunningGraph::stop() {
  if (running()) ::kill(pid_, SIGINT);
  await_end();
}

void RunningGraph::await_written(int frames) {
  while (running() && written() < frames) std::this_thread::sleep_for(20ms);
}

int RunningGraph::written() const {
  std::error_code ignored;
  return static_cast<int>(
      std::ranges::count_if(fs::directory_iterator(folder_.path() / "out", ignored),
                            [](const auto& entry) { return is_output(entry.path()); }));
}

std::vector<RunningGraph::Clock::time_point> RunningGraph::outputs() const {
  std::vector<Clock::time_point> result;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder_.path() / "out", ignored))
    if (is_output(entry.path()))
      result.push_back(std::chrono::file_clock::to_sys(entry.last_write_time()));
  std::ranges::sort(result);
  return result;
}

std::uint64_t RunningGraph::memory() const {
  std::uint64_t sum = 0;
  for_each_process([&](pid_t pid, const std::string&) {
    std::uint64_t size = 0;
    std::uint64_t resident = 0;
    std::ifstream("/proc/" + std::to_string(pid) + "/statm") >> size >> resident;
    sum += resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  });
  return sum;
}

bool RunningGraph::kill_stage(const std::string& stage) const {
  bool done = false;
  for_each_process([&](pid_t pid, const std::string& line) {
    if (line.find("--stage " + stage + " ") == std::string::npos) return;
    ::kill(pid, SIGKILL);
    done = true;
  });
  return done;
}

nlohmann::json RunningGraph::swap(const std::string& stage) const {
  const fs::path report = folder_.path() / "swap.json";
  const std::string command = program() + " swap " + stage + " --json > " + report.string() +
                              " 2> " + (folder_.path() / "swap.log").string();
  if (std::system(command.c_str()) != 0) return {};
  return nlohmann::json::parse(io::read_file(report), nullptr, false);
}

nlohmann::json RunningGraph::account() const {
  const auto report =
      nlohmann::json::parse(io::read_file(folder_.path() / "up.json"), nullptr, false);
  if (!report.is_object())
    throw Error("the graph did not end: " + io::read_file(folder_.path() / "up.log"));
  return report["account"];
}

double RunningGraph::rate() const {
  const auto outputs = this->outputs();
  const std::size_t first = outputs.size() / 10;
  const std::size_t last = outputs.size() * 9 / 10;
  return static_cast<double>(last - first) /
         std::chrono::duration<double>(outputs.at(last) - outputs.at(first)).count();
}

void RunningGraph::for_each_process(
    const std::function<void(pid_t, const std::string&)>& visit) const {
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

}  // namespace cosegraph::bench
