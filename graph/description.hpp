// The graph file: which stages there are, how they are wired, with which parameters.
//
// Reading never stops at the first mistake: every fault of a file is found and reported with file,
// line, column and, where a word is nearly right, a "did you mean". What comes out of load() is
// complete and consistent; nothing is repaired silently.
#pragma once

#include <compare>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.hpp"
#include "core/fields.hpp"
#include "graph/stage_info.hpp"

namespace cosegraph::graph {

// A place in a graph file, 1-based; line 0: made by a program.
struct Mark {
  int line = 0;
  int column = 0;

  auto operator<=>(const Mark&) const = default;
};

struct Fault {
  std::string file;
  Mark mark;
  std::string message;
};

std::string to_text(
    const Fault& fault);  // "FILE:LINE:COLUMN: MESSAGE"; "FILE: MESSAGE" if line is 0

// All faults of a graph, one per line of what().
class GraphError : public Error {
 public:
  explicit GraphError(std::vector<Fault> faults);
  const std::vector<Fault>& faults() const { return faults_; }

 private:
  std::vector<Fault> faults_;
};

// `mark` is where a name stands, `value_mark` where its value does.
struct Connection {
  std::string port;        // input of this stage
  std::string from_stage;  // empty in a faulty file only: what was written is unusable
  std::string from_port;
  Mark mark;
  Mark value_mark;
};

struct Setting {
  std::string name;
  std::vector<std::string> value;  // one element, or a list's
  bool is_list = false;
  Mark mark;
  Mark value_mark;
};

enum class RestartPolicy { never, on_failure };

struct Restart {
  RestartPolicy policy = RestartPolicy::never;
  int max = 5;
  double backoff = 0.05;  // s, before the first; twice as long before each further one
};

// So many processes of a stage on one host.
struct ReplicaShare {
  std::string host;  // empty: the stage's
  int count = 1;
  Mark mark;
};

struct StageNode {
  std::string name;
  std::string use;   // kind; empty for an `exec` stage
  std::string exec;  // executable of a stage that is not built in; absolute after load()
  std::string host;  // empty: this one
  std::vector<Connection> inputs;
  std::vector<PortInfo> outputs;  // exec stages declare theirs
  std::vector<Setting> params;
  std::vector<ReplicaShare> replicas;  // empty: one process
  Restart restart;
  Mark mark;

  // Where the values of "use", "exec", "host" and "outputs.PORT" stand, of those that are given.
  std::map<std::string, Mark, std::less<>> marks;
};

enum class Discovery { multicast, peers, server };

struct Dds {
  int domain = 0;
  Discovery discovery = Discovery::multicast;
  std::vector<std::string> peers;  // addresses
  std::string server;              // "host:port"
  double rate = 0.0;     // Mbit/s that a stage sends to other hosts at most; 0: as fast as it goes
  std::string security;  // folder of keys; absolute after load(); empty: none
  Mark security_mark;    // of its value
};

// Whether the address is this machine's own.
bool is_loopback(std::string_view address);

struct Host {
  std::string name;
  std::string address;
  Mark mark;
};

struct GraphDescription {
  std::string file;
  std::string graph;  // name: first part of every topic and the DDS partition
  // Tells runs of the same graph apart that can hear each other. Set by who starts a run, not by
  // the file; empty: stages started by hand find each other by the graph's name alone.
  std::string instance;
  bool one_process = false;  // set likewise: all stages of the run live and die together
  Dds dds;
  int window = 4;          // frames in flight, at most
  double deadline = 60.0;  // s; a frame that nobody finished by then fails
  std::vector<Host> hosts;
  std::vector<StageNode> stages;  // in the file's order
  Mark mark;                      // of `stages`

  const StageNode* stage(std::string_view name) const;
  StageNode* stage(std::string_view name);
};

// The host of each replica of a stage, one after the other; of a stage without replicas, its host.
std::vector<std::string> hosts_of(const StageNode& stage);

// Keys of a graph file that hold plain values: "window" and "deadline", "domain" and "rate",
// "policy", "max" and "backoff".
Fields describe(GraphDescription& graph);
Fields describe(Dds& dds);
Fields describe(Restart& restart);

// Names of graphs, stages, hosts and ports: they become parts of topic names.
constexpr std::string_view kNamePattern = "[a-z][a-z0-9_-]*";

// Parses without a catalog: syntax, keys, types of values. Faults are appended; what they concern
// is left at its default.
GraphDescription parse(std::string_view yaml, const std::string& file, std::vector<Fault>& faults);

// The same. Throws GraphError with every fault.
GraphDescription parse(std::string_view yaml, const std::string& file);

// Everything that needs to know the kinds of stages, in the order of the file: wiring, parameters,
// hosts, executables. A stage of unknown kind is one fault; nothing is said about its ports then.
// Executables are looked for only where they would run on this machine: stages without a host, or
// with one whose address is the loopback.
std::vector<Fault> check(const GraphDescription& graph, const Catalog& catalog);

// Reads, parses and checks. Throws GraphError with every fault of both, in the order of the file.
GraphDescription load(const std::filesystem::path& file, const Catalog& catalog);

// Adds or replaces a parameter, without checking it. It is a list if `value` has not exactly one
// element. Throws ParameterError for an unknown stage.
void set_param(GraphDescription& graph, std::string_view stage, std::string_view name,
               std::vector<std::string> value);

// The graph as YAML that parse() reads back to an equal description, marks and file aside.
std::string to_yaml(const GraphDescription& graph);

// What follows expects a graph without faults.

// The ports of a stage: of its kind, or those an `exec` stage declares. An output that an exec
// stage declares is latched if every kind's output of that type is. What its inputs take depends on
// what feeds them: their type is empty here (see infos_of). Throws Error for an unknown kind.
StageInfo info_of(const StageNode& stage, const Catalog& catalog);

// info_of() all stages, in their order; an exec stage's inputs are as the outputs that feed them.
std::vector<StageInfo> infos_of(const GraphDescription& graph, const Catalog& catalog);

// The one stage that admits frames. Throws Error if there is none.
const StageNode& source_of(const GraphDescription& graph, const Catalog& catalog);

// Stages that take frames and whose frame outputs nobody reads: a frame is done when all of them
// have said so. In the file's order.
std::vector<std::string> leaves_of(const GraphDescription& graph, const Catalog& catalog);

// `stage` and all stages that it depends on, along edges of any kind, by name.
std::set<std::string> upstream_of(const GraphDescription& graph, const std::string& stage);

// Names of all stages downstream of `stage` along frame edges, in the file's order.
std::vector<std::string> downstream_of(const GraphDescription& graph, std::string_view stage,
                                       const Catalog& catalog);

// "GRAPH/STAGE/PORT".
std::string topic_name(const GraphDescription& graph, std::string_view stage,
                       std::string_view port);

// What a drawing shows of a running graph.
struct LiveStage {
  enum class Mood { idle, busy, wrong };
  Mood mood = Mood::idle;
  std::string state;  // "working"
  std::vector<std::string> figures;
};
struct Overlay {
  std::string title;                          // behind the graph's name
  std::map<std::string, LiveStage> stages;    // a stage that is missing here is drawn as absent
  std::map<std::string, std::string> topics;  // text under the message type, by topic_name()
};

// Graphviz source: stages as boxes with kind, host and the parameters that differ from their
// defaults, edges with message types, latched edges dashed, the legend below. With an overlay
// states and figures stand in the boxes in place of the parameters, and the boxes' frames tell who
// is at work and what is wrong.
std::string to_dot(const GraphDescription& graph, const Catalog& catalog,
                   const Overlay* overlay = nullptr);

// JSON schema (draft 2020-12) of graph files for editors.
std::string json_schema(const Catalog& catalog);

}  // namespace cosegraph::graph

template <>
cosegraph::Names<cosegraph::graph::RestartPolicy>
cosegraph::names<cosegraph::graph::RestartPolicy>();
