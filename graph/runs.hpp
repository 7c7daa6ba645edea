// Which graphs run on this machine. Everyone who runs a graph, or a host's part of one, keeps a
// folder for it: the graph as it runs, logs, journals. The folder is locked while its keeper lives.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "graph/description.hpp"

namespace cosegraph::graph {

// Where the folders of runs are: $COSEGRAPH_RUNTIME_DIR, else $XDG_RUNTIME_DIR/cosegraph, else
// /tmp/cosegraph-UID. Made, for this user only, if it does not exist. Throws InputError.
std::filesystem::path runtime_folder();

struct Run {
  std::string graph;
  std::string instance;  // empty: run by agents
  std::string host;      // of the graph file; empty: the whole graph
  pid_t pid = -1;        // of the keeper
  std::filesystem::path folder;
};

// The runs whose keeper lives, by name.
std::vector<Run> live_runs();

// A graph that runs, as commands name it.
struct RunQuery {
  std::string graph;     // graph file, or the name of a graph; empty: the only one that runs here
  std::string instance;  // tells runs of one graph apart; empty: the only one
};

// The graph as it runs, with its instance. A graph file of which no run is known here is taken to
// be run by agents on other hosts. Throws InputError naming the runs there are.
GraphDescription find_run(const RunQuery& query);

// The keeper's side. The folder of `host`'s part of a graph without instance outlives its keeper,
// who may be followed by another; that of an instance is removed with this object.
class RunFolder {
 public:
  // What a predecessor has left in the folder stays. Throws InputError if the folder cannot be
  // made, Error if another keeper lives.
  RunFolder(const GraphDescription& graph, std::string_view host);
  ~RunFolder();
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  // Replaces the graph that commands see.
  void publish(const GraphDescription& graph) const;
  // Nothing of this run is left that somebody could take over.
  void discard() { discard_ = true; }

 private:
  std::filesystem::path path_;
  int lock_ = -1;
  bool discard_ = false;
};

// The graph with an instance name of its own, so that concurrent runs do not meet.
GraphDescription fresh_instance(GraphDescription graph);

}  // namespace cosegraph::graph
