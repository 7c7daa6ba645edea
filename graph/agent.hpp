// Runs one host's part of a graph and obeys orders that come over the graph's control topics:
// start, stop, restart, swap, down. All agents of a graph know what runs where; the one that runs
// the source leads swaps, one at a time.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "graph/description.hpp"
#include "idl/codec.hpp"

namespace cosegraph::graph {

struct AgentOptions {
  std::string host;                   // of the graph file; empty: all stages run here
  std::filesystem::path executables;  // folder of the cosegraph-<kind> programs
  bool allow_exec = false;            // programs of graphs may stand anywhere
  bool detached = false;              // stages outlive the agent, and the next one takes them over
  std::function<void(const std::string& stage, const std::string& line)> on_output;
};

class Agent {
 public:
  // Starts the host's stages, or takes over those that a killed agent has left, and the discovery
  // server if its address is the host's. Throws Error if there is an agent for this host already,
  // or if a program cannot be started.
  Agent(const GraphDescription& graph, const Catalog& catalog, AgentOptions options);
  // Stops the stages in order, unless leave() was called.
  ~Agent();

  // Does what there is to do, and waits for more, at most `patience`.
  void step(std::chrono::milliseconds patience);
  // The order to go down has come and was carried out.
  bool is_down() const;
  // Why a stage has been given up; empty if none.
  std::string failure() const;
  std::size_t adopted() const;
  // The processes are left to the next agent.
  void leave();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cosegraph::graph
