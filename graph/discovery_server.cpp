#include "graph/discovery_server.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <sstream>

#include "graph/child_process.hpp"

namespace cosegraph::graph {
namespace {

using namespace std::chrono_literals;

constexpr const char* kProgram = "fast-discovery-server";
constexpr auto kFirstPause = 500ms;
constexpr auto kLongestPause = 60s;
constexpr auto kProven = 10s;  // a server that has lived so long can run here

std::string address_of(const Dds& dds) {
  return dds.server.substr(0, dds.server.rfind(':'));
}

std::string program_in_path(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "/usr/bin:/bin" : path);
  for (std::string folder; std::getline(folders, folder, ':');)
    if (const auto file = std::filesystem::path(folder) / name; ::access(file.c_str(), X_OK) == 0)
      return file;
  return "";
}

}  // namespace

bool serves_discovery(const GraphDescription& graph, std::string_view host) {
  if (graph.dds.discovery != Discovery::server) return false;
  const std::string address = address_of(graph.dds);
  if (host.empty()) return address == "localhost" || address.starts_with("127.");
  const auto here = std::ranges::find(graph.hosts, host, &Host::name);
  return here != graph.hosts.end() && here->address == address;
}

std::vector<std::string> discovery_server_command(const Dds& dds) {
  const std::string program = program_in_path(kProgram);
  if (program.empty())
    throw Error("dds.discovery.server: there is no program " + std::string(kProgram) +
                "; install fastdds-tools");
  return {program,
          "-i",
          "0",
          "-l",
          address_of(dds),
          "-p",
          dds.server.substr(dds.server.rfind(':') + 1)};
}

DiscoveryServer::DiscoveryServer(const Dds& dds)
    : command_(discovery_server_command(dds)), pause_(kFirstPause) {
  start();
}

DiscoveryServer::~DiscoveryServer() {
  if (pid_ < 0) return;
  ::kill(pid_, SIGKILL);  // it has nothing to lose
  ::waitpid(pid_, nullptr, 0);
}

void DiscoveryServer::start() {
  pid_ = start_child(command_, {.death_signal = SIGKILL});
  started_ = Clock::now();
}

std::string DiscoveryServer::attend() {
  int status = 0;
  if (pid_ < 0) {
    if (Clock::now() >= due_) start();
    return "";
  }
  if (::waitpid(pid_, &status, WNOHANG) != pid_) return "";
  pid_ = -1;
  const auto now = Clock::now();
  if (now - started_ >= kProven) pause_ = kFirstPause;
  due_ = now + pause_;
  pause_ = std::min<std::chrono::milliseconds>(2 * pause_, kLongestPause);
  // One that cannot have its port ends with status 1: most likely another graph's has it.
  return std::string("the discovery server ") +
         (WIFSIGNALED(status) ? "was killed" : "ended, its port may be taken") +
         "; it is started again";
}

}  // namespace cosegraph::graph
