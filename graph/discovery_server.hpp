// The discovery server of a graph whose file says `discovery: {server: HOST:PORT}`. Where HOST is
// the address of one of the graph's hosts, its agent runs the server; else somebody else does. Its
// death hurts no stream, but nobody new is found until it is back.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

#include "graph/description.hpp"

namespace cosegraph::graph {

// Whether the agent of `host` (empty: of a graph without hosts) runs the graph's server.
bool serves_discovery(const GraphDescription& graph, std::string_view host);

// The program and its arguments. Throws Error if it is not installed.
std::vector<std::string> discovery_server_command(const Dds& dds);

// A running server. It dies with the thread that started it.
class DiscoveryServer {
 public:
  // Throws Error if it cannot be started.
  explicit DiscoveryServer(const Dds& dds);
  ~DiscoveryServer();
  DiscoveryServer(const DiscoveryServer&) = delete;
  DiscoveryServer& operator=(const DiscoveryServer&) = delete;

  // Starts it again if it has died, after a pause that grows while it keeps dying. What there is
  // to say about that, or "".
  std::string attend();
  pid_t pid() const { return pid_; }  // -1: not running

 private:
  using Clock = std::chrono::steady_clock;

  void start();

  std::vector<std::string> command_;
  pid_t pid_ = -1;
  Clock::time_point started_{};
  Clock::time_point due_{};
  std::chrono::milliseconds pause_;
};

}  // namespace cosegraph::graph
