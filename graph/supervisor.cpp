#include "graph/supervisor.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "graph/child_process.hpp"
#include "graph/control.hpp"
#include "graph/journal.hpp"
#include "io/file.hpp"

namespace cosegraph::graph {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using idl::ProcessState;

constexpr auto kStopPatience = 5s;  // between SIGTERM and SIGKILL
constexpr auto kLongestBackoff = 5s;
constexpr auto kWellAfter = 10s;        // a process that ran so long has not failed to start
constexpr off_t kLargestLog = 8 << 20;  // bytes

int pidfd_open(pid_t pid) {
  return static_cast<int>(::syscall(SYS_pidfd_open, pid, 0));
}

std::string exit_text(const siginfo_t& info) {
  if (info.si_code == CLD_EXITED) return "exited with status " + std::to_string(info.si_status);
  return std::string("was killed by ") + strsignal(info.si_status);
}

// How a process that has ended did so; nothing if it still runs.
std::optional<std::string> ended(int pidfd) {
  siginfo_t info{};
  if (::waitid(static_cast<idtype_t>(P_PIDFD), static_cast<id_t>(pidfd), &info,
               WEXITED | WNOHANG) == 0)
    return info.si_pid == 0 ? std::nullopt : std::optional(exit_text(info));
  // Not a child of ours: it was taken over.
  pollfd wait{.fd = pidfd, .events = POLLIN, .revents = 0};
  return ::poll(&wait, 1, 0) > 0 ? std::optional<std::string>("ended") : std::nullopt;
}

void signal_process(int pidfd, int signal) {
  if (pidfd >= 0) ::syscall(SYS_pidfd_send_signal, pidfd, signal, nullptr, 0);
}

bool is_below(const fs::path& file, const fs::path& folder) {
  if (folder.empty()) return false;
  const auto relative = fs::weakly_canonical(file).lexically_relative(fs::weakly_canonical(folder));
  return !relative.empty() && *relative.begin() != "..";
}

// Empty if the process has just ended or is another user's.
std::vector<std::string> command_line(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/cmdline", std::ios::binary);
  std::vector<std::string> words;
  for (std::string word; std::getline(file, word, '\0');) words.push_back(word);
  return words;
}

std::string option(const std::vector<std::string>& words, std::string_view name) {
  for (std::size_t i = 0; i + 1 < words.size(); ++i)
    if (words[i] == name) return words[i + 1];
  return "";
}

}  // namespace

Supervisor::Supervisor(SupervisorOptions options, Output output)
    : options_(std::move(options)), output_(std::move(output)) {}

Supervisor::~Supervisor() {
  if (!options_.detached) stop_all("");
  for (const auto& process : processes_) {
    if (process.pidfd >= 0) ::close(process.pidfd);
    if (process.log >= 0) ::close(process.log);
  }
}

// FOLDER/cpc.1.journal: of all generations of a replica; graph files are of one.
fs::path Supervisor::file_of(const Process& process, std::string_view extension) const {
  std::string name = process.info.stage + "." + std::to_string(process.info.replica);
  if (extension == "yaml") name += "." + std::to_string(process.info.generation);
  return options_.folder / (name + "." + std::string(extension));
}

std::size_t Supervisor::adopt() {
  const fs::path own = fs::weakly_canonical(options_.folder);
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    const auto pid = static_cast<pid_t>(std::stol(name));
    const auto words = command_line(pid);
    const std::string journal = option(words, "--journal");
    if (journal.empty() || fs::weakly_canonical(journal).parent_path() != own) continue;
    Process process;
    process.info = {.stage = option(words, "--stage"),
                    .replica = static_cast<std::uint32_t>(
                        std::strtoul(option(words, "--replica").c_str(), nullptr, 10)),
                    .generation = static_cast<std::uint32_t>(
                        std::strtoul(option(words, "--generation").c_str(), nullptr, 10)),
                    .pid = static_cast<std::uint32_t>(pid),
                    .state = ProcessState::running};
    process.pidfd = pidfd_open(pid);
    if (process.pidfd < 0) continue;
    const std::string file = option(words, "--graph");
    process.graph = parse(io::read_file(file), file);
    process.graph.instance = option(words, "--instance");
    process.info.candidate = std::ranges::find(words, "--standby") != words.end();
    process.started = Clock::now();
    open_log(process);
    processes_.push_back(std::move(process));
  }
  // A candidate that has taken its place is one no longer; what it replaced is gone, or going.
  for (auto& process : processes_)
    process.info.candidate =
        process.info.candidate && std::ranges::any_of(processes_, [&](const auto& other) {
          return other.info.stage == process.info.stage && &other != &process &&
                 other.info.replica == process.info.replica;
        });
  for (const auto& process : processes_)
    if (process.info.candidate) allow_restart(process.info.stage, process.info.generation, false);
  return processes_.size();
}

std::string Supervisor::program_of(const StageNode& node) const {
  const std::string program =
      node.exec.empty() ? (options_.executables / ("cosegraph-" + node.use)).string() : node.exec;
  if (!options_.allow_exec && !is_below(program, options_.executables) &&
      !is_below(program, options_.graph_folder))
    throw Error("stage " + node.name + ": " + program +
                " stands neither in the graph's folder nor among the installed programs; it is "
                "run only with --allow-exec");
  if (::access(program.c_str(), X_OK) != 0)
    throw Error("stage " + node.name + ": cannot run " + program + ": " + std::strerror(errno));
  return program;
}

void Supervisor::launch(const GraphDescription& graph, const std::string& stage,
                        std::uint32_t replica, std::uint32_t generation, bool candidate) {
  const StageNode* node = graph.stage(stage);
  if (node == nullptr) throw Error("there is no stage '" + stage + "'");
  program_of(*node);  // throws
  if (!candidate)
    std::erase_if(processes_, [&](const Process& other) {
      return other.info.stage == stage && other.info.replica == replica && other.pidfd < 0;
    });
  Process process{.info = {.stage = stage,
                           .replica = replica,
                           .generation = generation,
                           .candidate = candidate},
                  .graph = graph};
  const fs::path journal = file_of(process, "journal");
  if (generation == 0 && fs::exists(journal))
    if (const auto left = Journal(journal).load()) process.info.generation = left->generation + 1;
  start(process);
  processes_.push_back(std::move(process));
}

void Supervisor::start(Process& process) {
  const StageNode& node = *process.graph.stage(process.info.stage);
  const std::string program = program_of(node);
  const fs::path graph_file = file_of(process, "yaml");
  io::write_file(graph_file, to_yaml(process.graph));
  std::string leaves;
  for (const auto& leaf : options_.leaves) leaves += (leaves.empty() ? "" : ",") + leaf;
  const std::string journal = file_of(process, "journal").string();
  std::vector<std::string> words{program,
                                 "--graph",
                                 graph_file.string(),
                                 "--stage",
                                 node.name,
                                 "--instance",
                                 process.graph.instance,
                                 "--leaves",
                                 leaves,
                                 "--replica",
                                 std::to_string(process.info.replica),
                                 "--generation",
                                 std::to_string(process.info.generation),
                                 "--journal",
                                 journal};
  if (process.info.candidate) words.emplace_back("--standby");
  const std::string log_file = file_of(process, "log").string();
  const int log = ::open(log_file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  if (log < 0) throw InputError(log_file + ": " + std::strerror(errno));
  open_log(process);
  pid_t pid = -1;
  try {
    // Stopping a graph, Ctrl-C is the parent's, who then stops everybody in order.
    pid = start_child(std::move(words),
                      {.output = log, .death_signal = options_.detached ? 0 : SIGTERM});
  } catch (const Error&) {
    ::close(log);
    throw;
  }
  ::close(log);
  if (process.pidfd >= 0) ::close(process.pidfd);
  process.pidfd = pidfd_open(pid);
  process.info.pid = static_cast<std::uint32_t>(pid);
  process.started = Clock::now();
  process.stopping = false;
  set_state(process, ProcessState::running, "");
}

void Supervisor::set_state(Process& process, ProcessState state, const std::string& text) {
  process.info.state = state;
  process.info.text = text;
  if (state != ProcessState::running) process.info.pid = 0;
  process.changed = true;
}

// -- logs ----------------------------------------------------------------------------------------

// What stands in it already has been passed on.
void Supervisor::open_log(Process& process) {
  if (process.log >= 0) return;
  process.log = ::open(file_of(process, "log").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (process.log >= 0) ::lseek(process.log, 0, SEEK_END);
}

void Supervisor::read_log(Process& process) {
  if (process.log < 0) return;
  std::vector<std::string> lines;
  char buffer[4096];
  ssize_t count = 0;
  while ((count = ::read(process.log, buffer, sizeof buffer)) > 0) {
    process.partial_line.append(buffer, static_cast<std::size_t>(count));
    std::size_t end = 0;
    while ((end = process.partial_line.find('\n')) != std::string::npos) {
      lines.push_back(process.partial_line.substr(0, end));
      process.partial_line.erase(0, end + 1);
    }
  }
  // The writer appends: after this it goes on at the beginning.
  if (::lseek(process.log, 0, SEEK_CUR) > kLargestLog && ::ftruncate(process.log, 0) == 0)
    ::lseek(process.log, 0, SEEK_SET);
  if (!lines.empty()) output_(process.info.stage, process.info.replica, lines);
}

// -- exits and restarts --------------------------------------------------------------------------

void Supervisor::note_exit(Process& process, const std::string& how) {
  ::close(process.pidfd);
  process.pidfd = -1;
  read_log(process);
  std::error_code error;
  fs::remove(file_of(process, "yaml"), error);
  const Restart& restart = process.graph.stage(process.info.stage)->restart;
  const auto now = Clock::now();
  if (process.stopping || !process.may_restart)
    return set_state(process, ProcessState::stopped, how);
  if (now - process.started > kWellAfter) process.info.restarts = 0;
  if (process.info.candidate || restart.policy == RestartPolicy::never ||
      process.info.restarts >= static_cast<std::uint32_t>(restart.max))
    return set_state(process, ProcessState::failed, how);
  const auto backoff = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(
      restart.backoff * (1U << std::min(process.info.restarts, 16U))));
  process.due = now + std::min<Clock::duration>(backoff, kLongestBackoff);
  ++process.info.restarts;
  ++process.info.generation;
  set_state(process, ProcessState::restarting, how);
}

std::vector<idl::AgentProcess> Supervisor::attend(std::chrono::milliseconds patience, int wake) {
  const auto now = Clock::now();
  auto until = now + patience;
  std::vector<pollfd> waits;
  if (wake >= 0) waits.push_back({.fd = wake, .events = POLLIN, .revents = 0});
  for (const auto& process : processes_) {
    if (process.pidfd >= 0) waits.push_back({.fd = process.pidfd, .events = POLLIN, .revents = 0});
    const bool dying = process.stopping && process.pidfd >= 0;
    if (dying || process.info.state == ProcessState::restarting)
      until = std::min(until, process.due);
    if (process.changed) until = now;
  }
  const auto wait = std::chrono::ceil<std::chrono::milliseconds>(until - now);
  ::poll(waits.data(), waits.size(), static_cast<int>(std::max<std::int64_t>(wait.count(), 0)));

  std::vector<idl::AgentProcess> changed;
  for (auto& process : processes_) {
    if (process.pidfd >= 0) {
      if (const auto how = ended(process.pidfd))
        note_exit(process, *how);
      else if (process.stopping && Clock::now() >= process.due)
        signal_process(process.pidfd, SIGKILL);
    }
    if (process.info.state == ProcessState::restarting && Clock::now() >= process.due) {
      try {
        start(process);
      } catch (const Error& error) {
        set_state(process, ProcessState::failed, error.what());
      }
    }
    read_log(process);
    if (process.changed) changed.push_back(process.info);
    process.changed = false;
  }
  return changed;
}

bool Supervisor::stop(const std::string& stage, std::optional<std::uint32_t> generation) {
  bool any = false;
  for (auto& process : processes_) {
    if (process.info.stage != stage || (generation && process.info.generation != *generation))
      continue;
    any = true;
    process.stopping = true;
    process.due = Clock::now() + kStopPatience;
    signal_process(process.pidfd, SIGTERM);
    if (process.info.state == ProcessState::restarting)
      set_state(process, ProcessState::stopped, "");
  }
  return any;
}

void Supervisor::stop_all(const std::string& first) {
  const auto running = [&](const std::string& stage) {
    return std::ranges::any_of(processes_, [&](const Process& process) {
      return process.pidfd >= 0 && (stage.empty() || process.info.stage == stage);
    });
  };
  if (stop(first))
    for (const auto limit = Clock::now() + 1s; running(first) && Clock::now() < limit;)
      attend(10ms);
  for (auto& process : processes_) stop(process.info.stage);
  while (running("")) attend(10ms);
}

void Supervisor::promote(const std::string& stage, std::uint32_t generation) {
  for (auto& process : processes_)
    if (process.info.stage == stage && process.info.generation == generation)
      process.info.candidate = false;
}

void Supervisor::allow_restart(const std::string& stage, std::uint32_t newcomer, bool allowed) {
  for (auto& process : processes_) {
    if (process.info.stage != stage || process.info.generation >= newcomer) continue;
    const bool missed = allowed && !process.may_restart && !process.stopping &&
                        process.info.state == ProcessState::stopped;
    process.may_restart = allowed;
    if (missed) {
      process.due = Clock::now();
      ++process.info.generation;
      set_state(process, ProcessState::restarting, process.info.text);
    }
    if (!allowed && process.info.state == ProcessState::restarting)
      set_state(process, ProcessState::stopped, process.info.text);
  }
}

void Supervisor::forget(const std::string& stage, std::uint32_t generation) {
  std::erase_if(processes_, [&](const Process& process) {
    return process.info.stage == stage && process.info.generation == generation &&
           process.pidfd < 0;
  });
}

std::vector<idl::AgentProcess> Supervisor::processes() const {
  std::vector<idl::AgentProcess> result;
  for (const auto& process : processes_) result.push_back(process.info);
  return result;
}

bool Supervisor::any_retired(const std::string& stage) const {
  return std::ranges::any_of(processes_, [&](const Process& process) {
    return process.info.stage == stage && !process.may_restart && !process.stopping;
  });
}

const GraphDescription& Supervisor::graph_of(const std::string& stage,
                                             std::uint32_t generation) const {
  for (const auto& process : processes_)
    if (process.info.stage == stage && process.info.generation == generation) return process.graph;
  throw Error("there is no process of stage '" + stage + "'");
}

std::uint32_t Supervisor::newest_generation(const std::string& stage) const {
  std::uint32_t newest = 0;
  for (const auto& process : processes_)
    if (process.info.stage == stage) newest = std::max(newest, process.info.generation);
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(options_.folder, error)) {
    const std::string name = entry.path().filename();
    if (!name.starts_with(stage + ".") || !name.ends_with(".journal")) continue;
    if (const auto left = Journal(entry.path()).load()) newest = std::max(newest, left->generation);
  }
  return newest;
}

}  // namespace cosegraph::graph
