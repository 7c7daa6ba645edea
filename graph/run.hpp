// Runs a whole graph until its stream is over: in this process (one participant and one worker
// thread per stage), or as one process per stage on this host.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "graph/agent.hpp"
#include "graph/description.hpp"
#include "graph/observer.hpp"
#include "graph/stage.hpp"

namespace cosegraph::graph {

struct RunOptions {
  // Called about every 100 ms, and once at the end, with the newest status of every stage.
  std::function<void(const std::map<std::string, Observed>&)> on_update;
  // Set by a signal handler to stop the run early.
  const std::atomic<bool>* stop = nullptr;
};

struct RunReport {
  idl::Account account;  // of the source
  std::map<std::string, Observed> stages;
  std::vector<ObservedFailure> failures;
  bool interrupted = false;
  bool endless = false;  // its stream has no end of its own: to be interrupted is how it ends
  std::string error;     // why the graph could not go on; empty if its stream was worked off

  bool fine() const { return error.empty() && (!interrupted || endless) && account.failed == 0; }
};

// Throws Error if a stage refuses to start.
RunReport run_in_process(const GraphDescription& graph, const StageTable& table,
                         const RunOptions& options);

// Runs `cosegraph-<kind>` (or the stage's `exec`) for every stage of the agent's host, restarts
// those whose policy says so, and stops all in the end. No process outlives the caller's main
// thread, which must be the one that calls, and nothing is left in /dev/shm. The whole graph is
// followed, wherever its stages run. Throws Error if a program cannot be started.
RunReport run_processes(const GraphDescription& graph, const Catalog& catalog,
                        const RunOptions& options, const AgentOptions& agent);

}  // namespace cosegraph::graph
