// Runs one stage of a graph: its DDS participant, its ports, the join of its inputs, its worker
// thread and its status. Sources also admit frames within the window and keep the account.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "graph/description.hpp"
#include "graph/stage.hpp"

namespace cosegraph::graph {

// Sets the parameters that a graph file gives to `stage`. Throws GraphError with every fault.
void apply_params(const GraphDescription& graph, const StageNode& node, Stage& stage);

struct RunnerOptions {
  std::uint32_t generation = 0;     // > 0: started again in the middle of a stream
  std::vector<std::string> leaves;  // of the graph
  std::uint32_t replica = 0;
  bool standby = false;           // takes its place when it is told to (see control.hpp)
  std::filesystem::path journal;  // what it leaves to its successor; empty: nothing
};

class StageRunner {
 public:
  // Joins the domain and starts working; parameters must have been applied. Throws Error if DDS
  // cannot be started or the stage's start() refuses.
  StageRunner(const GraphDescription& graph, const std::string& name, std::unique_ptr<Stage> stage,
              const RunnerOptions& options);
  // Stops and waits for the frame in work.
  ~StageRunner();

  void request_stop();
  // The stage has given up (not: a frame of it failed); status() tells why.
  bool failed() const;
  idl::StageStatus status() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cosegraph::graph
