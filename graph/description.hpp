// The graph file: which stages there are, how they are wired, with which parameters.
//
// Reading never stops at the first mistake: every fault of a file is found and reported with file,
// line, column and, where a word is nearly right, a "did you mean". What comes out of load() is
// complete and consistent; nothing is repaired silently.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.hpp"
#include "graph/stage_info.hpp"

namespace cosegraph::graph {

// A place in a graph file, 1-based; line 0: made by a program.
struct Mark {
  int line = 0;
  int column = 0;
};

struct Fault {
  std::string file;
  Mark mark;
  std::string message;
};

std::string to_text(const Fault& fault);  // "FILE:LINE:COLUMN: MESSAGE"

// All faults of a graph, one per line of what().
class GraphError : public Error {
 public:
  explicit GraphError(std::vector<Fault> faults);
  const std::vector<Fault>& faults() const { return faults_; }

 private:
  std::vector<Fault> faults_;
};

struct Connection {
  std::string port;        // input of this stage
  std::string from_stage;
  std::string from_port;
  Mark mark;
};

struct Setting {
  std::string name;
  std::vector<std::string> value;  // one element, or a list's
  bool is_list = false;
  Mark mark;
};

enum class RestartPolicy { never, on_failure };

struct Restart {
  RestartPolicy policy = RestartPolicy::never;
  int max = 5;
};

struct StageNode {
  std::string name;
  std::string use;   // kind; empty for an `exec` stage
  std::string exec;  // executable of a stage that is not built in; absolute after load()
  std::string host;  // empty: this one
  std::vector<Connection> inputs;
  std::vector<PortInfo> outputs;  // exec stages declare theirs
  std::vector<Setting> params;
  Restart restart;
  Mark mark;
};

enum class Discovery { multicast, peers, server };

struct Dds {
  int domain = 0;
  Discovery discovery = Discovery::multicast;
  std::vector<std::string> peers;  // addresses
  std::string server;              // "host:port"
};

struct Host {
  std::string name;
  std::string address;
  Mark mark;
};

struct GraphDescription {
  std::string file;
  std::string graph;  // name: first part of every topic and the DDS partition
  Dds dds;
  int window = 4;              // frames in flight, at most
  double deadline = 60.0;      // s; a frame that nobody finished by then fails
  std::vector<Host> hosts;
  std::vector<StageNode> stages;  // in the file's order

  const StageNode* stage(std::string_view name) const;
  StageNode* stage(std::string_view name);
};

// Parses without a catalog: syntax, keys, types of values. Faults are appended.
GraphDescription parse(std::string_view yaml, const std::string& file, std::vector<Fault>& faults);

// Everything that needs to know the kinds of stages.
std::vector<Fault> check(const GraphDescription& graph, const Catalog& catalog);

// Reads, parses and checks. Throws GraphError with every fault.
GraphDescription load(const std::filesystem::path& file, const Catalog& catalog);

// Adds or replaces a parameter, without checking it.
void set_param(GraphDescription& graph, std::string_view stage, std::string_view name,
               std::vector<std::string> value);

// The graph as YAML that parse() reads back to an equal description.
std::string to_yaml(const GraphDescription& graph);

// The ports of a stage: of its kind, or those an `exec` stage declares.
StageInfo info_of(const StageNode& stage, const Catalog& catalog);

// The one stage that admits frames.
const StageNode& source_of(const GraphDescription& graph, const Catalog& catalog);

// Stages that take frames and whose frame outputs nobody reads: a frame is done when all of them
// have said so. In the file's order.
std::vector<std::string> leaves_of(const GraphDescription& graph, const Catalog& catalog);

// Names of all stages downstream of `stage` along frame edges.
std::vector<std::string> downstream_of(const GraphDescription& graph, std::string_view stage,
                                       const Catalog& catalog);

// "GRAPH/STAGE/PORT".
std::string topic_name(const GraphDescription& graph, std::string_view stage,
                       std::string_view port);

// Graphviz source: stages as boxes with kind, host and changed parameters, edges with message
// types, latched edges dashed, the legend below.
std::string to_dot(const GraphDescription& graph, const Catalog& catalog);

// JSON schema (draft 2020-12) of graph files for editors.
std::string json_schema(const Catalog& catalog);

}  // namespace cosegraph::graph
