#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <thread>

#include "graph/run.hpp"
#include "graph/runs.hpp"
#include "graph/watch.hpp"
#include "io/file.hpp"

namespace cosegraph::graph {
namespace {

using namespace std::chrono_literals;
using SteadyClock = std::chrono::steady_clock;

constexpr auto kStopPatience = 5s;  // between SIGTERM and SIGKILL

struct Process {
  const StageNode* node = nullptr;
  std::vector<std::string> command;
  pid_t pid = -1;  // -1: not running
  int output = -1;
  std::string partial_line;
  int restarts = 0;
  SteadyClock::time_point restart_at{};
};

std::string exit_text(int status) {
  if (WIFSIGNALED(status)) return std::string("was killed by ") + strsignal(WTERMSIG(status));
  return "exited with status " + std::to_string(WEXITSTATUS(status));
}

class Processes {
 public:
  Processes(const GraphDescription& graph, const Catalog& catalog, const LaunchOptions& launch)
      : launch_(launch) {
    const std::filesystem::path file = folder_ / "graph.yaml";
    std::ofstream(file) << to_yaml(graph);
    std::string leaves;
    for (const auto& leaf : leaves_of(graph, catalog)) leaves += (leaves.empty() ? "" : ",") + leaf;
    for (const auto& node : graph.stages) {
      const std::string program =
          node.exec.empty() ? (launch.executables / ("cosegraph-" + node.use)).string() : node.exec;
      if (::access(program.c_str(), X_OK) != 0)
        throw Error("stage " + node.name + ": cannot run " + program + ": " + std::strerror(errno));
      processes_.push_back({.node = &node,
                            .command = {program, "--graph", file.string(), "--stage", node.name,
                                        "--instance", graph.instance, "--leaves", leaves}});
    }
    for (auto& process : processes_) start(process);
  }

  ~Processes() { stop(); }
  Processes(const Processes&) = delete;
  Processes& operator=(const Processes&) = delete;

  // Passes output on and restarts what may be restarted. Returns why the graph cannot go on, or "".
  std::string attend(std::chrono::milliseconds patience) {
    forward_output(patience);
    for (auto& process : processes_) {
      if (process.pid < 0) {
        if (SteadyClock::now() >= process.restart_at) start(process);
        continue;
      }
      int status = 0;
      if (::waitpid(process.pid, &status, WNOHANG) != process.pid) continue;
      process.pid = -1;
      forward_output(0ms);
      const std::string text = "stage " + process.node->name + " " + exit_text(status);
      if (process.node->restart.policy != RestartPolicy::on_failure ||
          process.restarts >= process.node->restart.max)
        return text;
      ++process.restarts;
      process.restart_at = SteadyClock::now() + 50ms * (1 << std::min(process.restarts - 1, 6));
      launch_.on_output(process.node->name, text + ", starting it again");
    }
    return "";
  }

 private:
  void start(Process& process) {
    int pipe_ends[2];
    if (::pipe2(pipe_ends, O_CLOEXEC) != 0)
      throw Error(std::string("cannot make a pipe: ") + std::strerror(errno));
    std::vector<std::string> words = process.command;
    words.insert(words.end(), {"--generation", std::to_string(process.restarts)});
    std::vector<char*> arguments;
    for (auto& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    const pid_t parent = ::getpid();
    const pid_t pid = ::fork();
    if (pid < 0) throw Error(std::string("cannot start a process: ") + std::strerror(errno));
    if (pid == 0) {  // only async-signal-safe calls from here on
      ::prctl(PR_SET_PDEATHSIG, SIGTERM);
      if (::getppid() != parent) ::_exit(1);
      ::setpgid(0, 0);  // Ctrl-C reaches the parent alone, which then stops everybody in order
      ::dup2(pipe_ends[1], STDOUT_FILENO);
      ::dup2(pipe_ends[1], STDERR_FILENO);
      ::execv(arguments[0], arguments.data());
      ::_exit(127);
    }
    ::close(pipe_ends[1]);
    if (process.output >= 0) ::close(process.output);
    process.pid = pid;
    process.output = pipe_ends[0];
    ::fcntl(process.output, F_SETFL, O_NONBLOCK);
  }

  void forward_output(std::chrono::milliseconds patience) {
    std::vector<pollfd> waits;
    for (const auto& process : processes_)
      waits.push_back({.fd = process.output, .events = POLLIN, .revents = 0});
    if (::poll(waits.data(), waits.size(), static_cast<int>(patience.count())) <= 0) return;
    for (auto& process : processes_) read_lines(process);
  }

  void read_lines(Process& process) {
    char buffer[4096];
    ssize_t count = 0;
    while (process.output >= 0 && (count = ::read(process.output, buffer, sizeof buffer)) > 0) {
      process.partial_line.append(buffer, static_cast<std::size_t>(count));
      std::size_t end = 0;
      while ((end = process.partial_line.find('\n')) != std::string::npos) {
        launch_.on_output(process.node->name, process.partial_line.substr(0, end));
        process.partial_line.erase(0, end + 1);
      }
    }
    if (count == 0 && process.output >= 0) {  // the other end is closed
      ::close(process.output);
      process.output = -1;
    }
  }

  void stop() {
    signal_all(SIGTERM);
    const auto limit = SteadyClock::now() + kStopPatience;
    while (reap() > 0 && SteadyClock::now() < limit) forward_output(10ms);
    signal_all(SIGKILL);
    while (reap() > 0) std::this_thread::sleep_for(5ms);
    for (auto& process : processes_)
      if (process.output >= 0) ::close(process.output);
  }

  void signal_all(int signal) const {
    for (const auto& process : processes_)
      if (process.pid > 0) ::kill(process.pid, signal);
  }

  // How many still run.
  int reap() {
    int running = 0;
    for (auto& process : processes_) {
      if (process.pid > 0 && ::waitpid(process.pid, nullptr, WNOHANG) == process.pid)
        process.pid = -1;
      running += process.pid > 0 ? 1 : 0;
    }
    return running;
  }

  io::TemporaryFolder folder_;
  LaunchOptions launch_;
  std::vector<Process> processes_;
};

}  // namespace

RunReport run_processes(const GraphDescription& description, const Catalog& catalog,
                        const RunOptions& options, const LaunchOptions& launch) {
  const GraphDescription graph = fresh_instance(description);
  const RunFolder folder(graph, "");
  Processes processes(graph, catalog, launch);
  Watch watch(graph, catalog, options);
  std::string error;
  while (error.empty() && watch.step(20ms)) error = processes.attend(0ms);
  if (!error.empty()) {
    RunReport report = watch.report();
    report.error = error;
    return report;
  }
  return watch.report();
}

}  // namespace cosegraph::graph
