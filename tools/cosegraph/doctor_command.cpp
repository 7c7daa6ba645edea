// Whether this machine can run a graph: what is wrong, and what to do about it.
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/statvfs.h>
#include <sys/timex.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "graph/figures.hpp"
#include "graph/interfaces.hpp"
#include "graph/runs.hpp"
#include "io/file.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/run_graph.hpp"
#include "tools/cosegraph/watching.hpp"

namespace cosegraph::tools {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;

enum class Health { fine, note, wrong };

struct Finding {
  std::string area;
  Health health = Health::fine;
  std::string text;
  std::string remedy;
};

class Report {
 public:
  void fine(const std::string& area, const std::string& text) {
    findings_.push_back({area, Health::fine, text, ""});
  }
  // Worth knowing; it need not be changed.
  void note(const std::string& area, const std::string& text, const std::string& remedy) {
    findings_.push_back({area, Health::note, text, remedy});
  }
  void wrong(const std::string& area, const std::string& text, const std::string& remedy) {
    findings_.push_back({area, Health::wrong, text, remedy});
  }
  const std::vector<Finding>& findings() const { return findings_; }

 private:
  std::vector<Finding> findings_;
};

// -- the machine ---------------------------------------------------------------------------------

// A line of a file like /etc/os-release, without quotes.
std::string value_in(const fs::path& file, const std::string& key) {
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with(key)) continue;
    std::string value = line.substr(key.size());
    std::erase(value, '"');
    return value.substr(std::min(value.find_first_not_of(" \t:="), value.size()));
  }
  return "";
}

void check_machine(Report& report) {
  const std::string system = value_in("/etc/os-release", "PRETTY_NAME");
  const std::string memory = value_in("/proc/meminfo", "MemAvailable");
  const double available = memory.empty() ? 0.0 : 1024.0 * std::stod(memory);
  report.fine("host", graph::machine_name() + ", " + (system.empty() ? "unknown system" : system) +
                          ", " + std::to_string(std::thread::hardware_concurrency()) +
                          " processors, " + bytes_text(available) + " of memory available");
  // A participant takes about 16 MB, and a graph has ten of them with their data.
  constexpr double kNeeded = 5e8;
  if (available > 0.0 && available < kNeeded)
    report.wrong("host", "little memory is left",
                 "stop other programs: a graph takes " + bytes_text(kNeeded) + " and its data");
}

// Runs a program to its end, without output; its status, or -1.
int run_silently(const std::string& program, const char* argument) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (const int descriptor : {STDOUT_FILENO, STDERR_FILENO})
    posix_spawn_file_actions_addopen(&actions, descriptor, "/dev/null", O_WRONLY, 0);
  std::string name = program;
  std::string word = argument;
  char* const arguments[] = {name.data(), word.data(), nullptr};
  pid_t pid = 0;
  const int error = ::posix_spawnp(&pid, name.c_str(), &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return -1;
  int status = 0;
  ::waitpid(pid, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// Every program of a stage is there and finds its libraries.
void check_programs(Report& report, const graph::GraphDescription* graph) {
  std::set<std::string> programs;
  for (const auto& [kind, make] : stage_table()) {
    const bool used = graph == nullptr || std::ranges::any_of(graph->stages, [&](const auto& s) {
                        return s.use == kind;
                      });
    if (used) programs.insert((executable_folder() / ("cosegraph-" + kind)).string());
  }
  std::size_t fine = 0;
  for (const auto& program : programs) {
    if (::access(program.c_str(), X_OK) != 0)
      report.wrong("programs", program + ": " + std::strerror(errno),
                   "build or install all of it; 'cosegraph up' and agents start this program");
    else if (run_silently(program, "--help") != 0)
      report.wrong("programs", program + " does not start",
                   "a library is missing: ldd " + program +
                       " | grep 'not found'; tools/setup "
                       "installs what is needed");
    else
      ++fine;
  }
  if (fine == programs.size())
    report.fine("programs", std::to_string(fine) + " programs of stages start");
  if (run_silently("dot", "-V") != 0)
    report.note("programs", "'dot' is not installed, which 'cosegraph draw' needs",
                "apt install graphviz");
}

void check_shared_memory(Report& report) {
  struct statvfs info {};
  if (::statvfs("/dev/shm", &info) != 0)
    return report.note("/dev/shm", std::strerror(errno), "nothing here needs it");
  std::size_t left = 0;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/dev/shm", error))
    left += entry.path().filename().string().find("fastrtps") != std::string::npos ? 1 : 0;
  const double room = static_cast<double>(info.f_bavail) * static_cast<double>(info.f_frsize);
  if (left > 0)
    report.note("/dev/shm", std::to_string(left) + " files of Fast DDS programs, none of them ours",
                "if none of those programs runs any more: fastdds shm clean");
  else
    report.fine("/dev/shm", bytes_text(room) + " free, nothing left behind");
}

// -- network -------------------------------------------------------------------------------------

// What a socket really gets of what the runtime asks for; bytes.
int granted_buffer(int option) {
  constexpr int kWanted = 4 << 20;
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  int granted = 0;
  socklen_t size = sizeof granted;
  ::setsockopt(socket, SOL_SOCKET, option, &kWanted, sizeof kWanted);
  ::getsockopt(socket, SOL_SOCKET, option, &granted, &size);
  ::close(socket);
  return granted / 2;  // Linux tells twice what it grants
}

void check_buffers(Report& report) {
  constexpr int kEnough = 4 << 20;
  for (const auto& [option, name] :
       {std::pair{SO_RCVBUF, "net.core.rmem_max"}, std::pair{SO_SNDBUF, "net.core.wmem_max"}}) {
    const int granted = granted_buffer(option);
    const std::string text = std::string(name) + " grants " + bytes_text(granted) + " per socket";
    if (granted >= kEnough)
      report.fine("socket buffers", text);
    else
      report.wrong("socket buffers",
                   text + ", " + bytes_text(kEnough) +
                       " are asked for: large messages lose packets, which are sent again",
                   std::string("sysctl -w ") + name + "=" + std::to_string(kEnough) +
                       ", and the same line in /etc/sysctl.d/cosegraph.conf");
  }
}

// What is left of messages that lost a packet; with keys, those between hosts are of several.
void check_fragments(Report& report, const graph::GraphDescription& graph) {
  if (graph.dds.security.empty() || graph.hosts.size() < 2) return;
  constexpr int kLong = 5;  // s
  int seconds = 0;
  if (!(std::ifstream("/proc/sys/net/ipv4/ipfrag_time") >> seconds)) return;
  const std::string text = "what a lost packet leaves of its message is kept for " +
                           std::to_string(seconds) + " s (net.ipv4.ipfrag_time)";
  if (seconds <= kLong)
    report.fine("lost packets", text);
  else
    report.note("lost packets",
                text + "; where packets are lost, the graph stands still once 4 MB are full",
                "sysctl -w net.ipv4.ipfrag_time=2 net.ipv4.ipfrag_high_thresh=67108864, and the "
                "same lines in /etc/sysctl.d/cosegraph.conf");
}

// Sends itself a packet by DDS's multicast address over the interface with this address. Empty if
// it arrived.
std::string multicast_fault(const std::string& address) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const std::unique_ptr<const int, void (*)(const int*)> closer(&socket,
                                                                [](const int* s) { ::close(*s); });
  sockaddr_in here{};
  here.sin_family = AF_INET;
  socklen_t size = sizeof here;
  const timeval patience{1, 0};
  ip_mreq group{};
  ::inet_pton(AF_INET, "239.255.0.1", &group.imr_multiaddr);
  ::inet_pton(AF_INET, address.c_str(), &group.imr_interface);
  if (::bind(socket, reinterpret_cast<sockaddr*>(&here), sizeof here) != 0 ||
      ::getsockname(socket, reinterpret_cast<sockaddr*>(&here), &size) != 0 ||
      ::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) != 0)
    return std::string("no socket: ") + std::strerror(errno);
  if (::setsockopt(socket, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) != 0 ||
      ::setsockopt(socket, IPPROTO_IP, IP_MULTICAST_IF, &group.imr_interface,
                   sizeof group.imr_interface) != 0)
    return std::string("239.255.0.1 cannot be joined: ") + std::strerror(errno);
  sockaddr_in there = here;
  there.sin_addr = group.imr_multiaddr;
  const char word = 'x';
  if (::sendto(socket, &word, 1, 0, reinterpret_cast<sockaddr*>(&there), sizeof there) != 1)
    return std::string("cannot send to 239.255.0.1: ") + std::strerror(errno);
  char heard = 0;
  return ::recv(socket, &heard, 1, 0) == 1 ? "" : "a packet to 239.255.0.1 did not come back";
}

void check_network(Report& report, const graph::GraphDescription* graph) {
  const bool needs_multicast =
      graph == nullptr || graph->dds.discovery == graph::Discovery::multicast;
  const std::string remedy =
      "let UDP multicast and ports 7400 to 7700 through, or name the hosts in the graph file: "
      "dds: {discovery: {peers: [...]}}";
  std::size_t usable = 0;
  for (const auto& interface : graph::interfaces()) {
    const std::string name = interface.name + " " + interface.address;
    if (interface.loopback) continue;
    const std::string fault = !interface.connected   ? "it is not connected"
                              : !interface.multicast ? "it has no multicast"
                                                     : multicast_fault(interface.address);
    if (fault.empty()) {
      ++usable;
      report.fine("discovery", name + ": multicast works here");
    } else {
      report.note("discovery", name + ": " + fault, needs_multicast ? remedy : "not needed");
    }
  }
  if (usable == 0 && needs_multicast)
    report.wrong("discovery", "no interface with multicast: stages do not find each other", remedy);
}

void check_hosts(Report& report, const graph::GraphDescription& graph) {
  const auto mine = graph::interfaces();
  for (const auto& host : graph.hosts) {
    in_addr address{};
    if (::inet_pton(AF_INET, host.address.c_str(), &address) != 1) {
      report.note("hosts", host.name + ": " + host.address + " is a name, not an address",
                  "names must mean the same on every host");
      continue;
    }
    const bool here =
        std::ranges::find(mine, host.address, &graph::Interface::address) != mine.end();
    report.fine("hosts", host.name + ": " + host.address + (here ? " is this machine" : ""));
  }
}

// -- clocks --------------------------------------------------------------------------------------

void check_clock(Report& report, const graph::GraphDescription* graph) {
  timex state{};
  const int answer = ::adjtimex(&state);
  const bool many_hosts = graph != nullptr && graph->hosts.size() > 1;
  if (answer < 0) return report.note("clock", std::strerror(errno), "");
  if (answer != TIME_ERROR)
    return report.fine("clock",
                       "is kept in time, within " + std::to_string(state.maxerror / 1000) + " ms");
  const std::string text = "nobody keeps this machine's clock in time";
  const std::string remedy = "apt install chrony";
  if (many_hosts)
    report.wrong("clock", text + ": delays between hosts mean nothing", remedy);
  else
    report.note("clock", text + "; that matters between hosts only", remedy);
}

// -- files ---------------------------------------------------------------------------------------

void check_runtime_folder(Report& report) {
  try {
    const fs::path folder = graph::runtime_folder();
    const fs::path probe = folder / (".doctor-" + std::to_string(::getpid()));
    io::write_file(probe, "");
    fs::remove(probe);
    report.fine("runtime folder", folder.string() + " is this user's alone");
  } catch (const std::exception& error) {
    report.wrong("runtime folder", error.what(),
                 "remove it, or name another: export COSEGRAPH_RUNTIME_DIR=FOLDER");
  }
}

void check_graph_file(Report& report, const graph::GraphDescription& graph) {
  const auto faults = graph::check(graph, graph::catalog_of(stage_table()));
  for (const auto& fault : faults)
    report.wrong("graph", graph::to_text(fault), "see 'cosegraph check'");
  if (faults.empty())
    report.fine("graph", graph.graph + " is fine, " + std::to_string(graph.stages.size()) +
                             " stages in DDS domain " + std::to_string(graph.dds.domain));
}

// -- the running graph ---------------------------------------------------------------------------

constexpr double kClocksApart = 0.01;  // s

void check_agent(Report& report, graph::Remote& remote, const std::string& host) {
  const ClockOffset offset = ask_clock(remote, host);
  const std::string name = host.empty() ? "this run" : "host " + host;
  if (!offset.known)
    return report.wrong("agents", "the agent of " + name + " does not answer",
                        "on that host: cosegraph agent, cosegraph doctor");
  char text[96];
  std::snprintf(text, sizeof text, "its clock is %+.3f ms off, +- %.3f ms", 1e3 * offset.seconds,
                1e3 * offset.uncertainty);
  if (std::abs(offset.seconds) - offset.uncertainty > kClocksApart)
    report.wrong("clock", name + ": " + text, "keep both in time: apt install chrony");
  else
    report.fine("agents", "the agent of " + name + " answers; " + text);
}

// Who is heard of a graph that runs, or is meant to.
void check_run(Report& report, const graph::GraphDescription& graph,
               std::chrono::milliseconds patience) {
  graph::DomainWatch watch(graph);
  graph::Observer observer(graph);
  graph::Remote remote(graph);
  const auto stages = look_twice(observer, graph, patience).now;
  const auto agents = remote.agents(patience);
  const graph::Domain domain = watch.domain();
  if (stages.empty() && agents.empty())
    return report.note("run",
                       "nothing is heard of it in DDS domain " + std::to_string(graph.dds.domain) +
                           ", " + std::to_string(domain.peers.size()) + " others are",
                       "if it runs elsewhere: cosegraph doctor there, and compare domain, "
                       "discovery and --instance");
  std::size_t silent = 0;
  for (const auto& stage : graph.stages)
    for (std::uint32_t i = 0; i < graph::hosts_of(stage).size(); ++i)
      if (const std::string name = graph::process_name(stage, i); !stages.contains(name)) {
        ++silent;
        report.wrong("run", name + " is not heard", "cosegraph ps; cosegraph logs " + stage.name);
      }
  for (const auto& [name, seen] : stages) {
    const std::string logs = "cosegraph logs " + seen.header.stage;
    if (seen.status.state == idl::State::failed)
      report.wrong("run", name + " has failed: " + seen.status.activity, logs);
    else if (seen.status.state == idl::State::stopped)
      report.note("run", name + " was stopped", "cosegraph start " + seen.header.stage);
    else if (is_silent(seen))
      report.wrong("run", name + " is " + state_text(seen), "cosegraph ps; " + logs);
  }
  if (silent == 0) report.fine("run", "all " + std::to_string(stages.size()) + " stages are heard");
  for (const auto& [host, agent] : agents) check_agent(report, remote, host);
  if (!agents.empty())
    for (const auto& host : graph.hosts)
      if (!agents.contains(host.name))
        report.wrong("agents", "no agent answers for host " + host.name + " (" + host.address + ")",
                     "on that host: cosegraph agent --host " + host.name);
}

// -- the command ---------------------------------------------------------------------------------

const char* mark_of(Health health) {
  switch (health) {
    case Health::note:
      return "note";
    case Health::wrong:
      return "wrong";
    case Health::fine:
      break;
  }
  return "ok";
}

// A graph file that does not run is looked at as it is written.
std::optional<graph::GraphDescription> meant_graph(const Watched& watched, Report& report) {
  if (watched.graph.empty() && watched.instance.empty() && graph::live_runs().empty()) return {};
  try {
    return watched.find();
  } catch (const graph::GraphError& error) {
    for (const auto& fault : error.faults())
      report.wrong("graph", graph::to_text(fault), "see 'cosegraph check'");
    return {};
  }
}

int examine(const Watched& watched) {
  Report report;
  check_machine(report);
  check_runtime_folder(report);
  std::optional<graph::GraphDescription> graph;
  // Without a folder for runs none can be found; that has been said.
  if (report.findings().back().health == Health::fine) graph = meant_graph(watched, report);
  const graph::GraphDescription* known = graph ? &*graph : nullptr;
  check_programs(report, known);
  check_shared_memory(report);
  check_buffers(report);
  check_network(report, known);
  check_clock(report, known);
  if (known != nullptr) {
    check_graph_file(report, *known);
    check_fragments(report, *known);
    try {
      check_hosts(report, *known);
      check_run(report, *known, watched.patience());
    } catch (const Error& error) {
      const std::string why = error.what();
      report.wrong("agents", "cannot be asked: " + why.substr(0, why.find('\n')),
                   "put right what 'cosegraph check' says about the graph file");
    }
  }
  const auto wrong = std::ranges::count(report.findings(), Health::wrong, &Finding::health);
  if (watched.json) {
    Json json = Json::array();
    for (const auto& finding : report.findings())
      json.push_back({{"area", finding.area},
                      {"health", mark_of(finding.health)},
                      {"text", finding.text},
                      {"remedy", finding.remedy}});
    std::cout << json.dump(2) << '\n';
  } else {
    for (const auto& finding : report.findings()) {
      std::printf("%-6s %-15s %s\n", mark_of(finding.health), finding.area.c_str(),
                  finding.text.c_str());
      if (finding.health != Health::fine && !finding.remedy.empty())
        std::printf("%-6s %-15s   remedy: %s\n", "", "", finding.remedy.c_str());
    }
    std::printf("%s\n", wrong == 0   ? "nothing is wrong"
                        : wrong == 1 ? "1 thing is wrong"
                                     : (std::to_string(wrong) + " things are wrong").c_str());
  }
  return wrong == 0 ? 0 : 1;
}

}  // namespace

void add_doctor_command(CLI::App& app, const Choose& choose) {
  auto* doctor = app.add_subcommand(
      "doctor", "Looks for what keeps graphs from running on this machine, with remedies");
  auto watched = std::make_shared<Watched>();
  add_watched(*doctor, *watched, "");
  add_timeout(*doctor, *watched, 2.0, "how long to wait for agents to answer");
  doctor->footer(
      "The exit status is 1 if something is wrong.\n"
      "Example:\n  cosegraph doctor\n  cosegraph doctor segment.yaml");
  doctor->callback([=] { choose([=] { return examine(*watched); }); });
}

}  // namespace cosegraph::tools
