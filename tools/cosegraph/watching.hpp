// What the commands that look into a running graph share: which graph, which topic, for how long.
#pragma once

#include <CLI/CLI.hpp>
#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "graph/control.hpp"
#include "graph/discovery.hpp"
#include "graph/observer.hpp"
#include "graph/remote.hpp"
#include "graph/traffic.hpp"
#include "tools/cosegraph/stop_signals.hpp"

namespace cosegraph::tools {

// How a command is told what to look at, and how it answers.
struct Watched {
  std::vector<std::string> words;  // [GRAPH] NAME, or [GRAPH] alone
  std::string graph;               // --graph
  std::string instance;
  bool json = false;
  bool once = false;
  double timeout = 5.0;  // s

  graph::GraphDescription find() const;
  std::string name() const { return words.empty() ? "" : words.back(); }
  std::chrono::milliseconds patience() const {
    return std::chrono::milliseconds(static_cast<long>(1000.0 * timeout));
  }
};

// "[GRAPH] NAME" with `what` for NAME, or "[GRAPH]" if that is empty; the graph may also be given
// as
// --graph, as to the commands that give orders. And --instance, --json.
void add_watched(CLI::App& command, Watched& watched, const std::string& what);
void add_once(CLI::App& command, Watched& watched, const std::string& doc);
void add_timeout(CLI::App& command, Watched& watched, double value, const std::string& doc);

// A topic of a graph and what is known of it before anybody is heard.
struct Topic {
  std::string name;  // "GRAPH/STAGE/PORT" or "GRAPH/stage_status"
  std::string type;  // "Cloud"; empty for a stranger's topic
  bool is_control = false;
  bool latched = false;
};

// The outputs of all stages in their order, then the control topics.
std::vector<Topic> topics_of(const graph::GraphDescription& graph);

// `name` is "STAGE/PORT", the name of a control topic, or a full name. None for others.
std::optional<Topic> find_topic(const graph::GraphDescription& graph, const std::string& name);
// Throws ParameterError with a "did you mean"; `domain` may know topics of strangers.
Topic require_topic(const graph::GraphDescription& graph, const std::string& name,
                    const graph::Domain& domain);
// Throws ParameterError with a "did you mean".
const graph::StageNode& require_stage(const graph::GraphDescription& graph,
                                      const std::string& stage);

// Waits until processes of all stages have been heard, twice if `twice`, at most `patience`.
struct Looks {
  graph::Look before;
  graph::Look now;
};
Looks look_twice(graph::Observer& observer, const graph::GraphDescription& graph,
                 std::chrono::milliseconds patience);

// Nothing has been heard of a process for a while that is not known to have ended.
bool is_silent(const graph::Observed& seen);

// "working", "waiting, silent 3.2 s".
std::string state_text(const graph::Observed& seen);

// States, rates and counts for a drawing.
graph::Overlay overlay_of(const graph::GraphDescription& graph, const Looks& looks);

// Waits a while, less if it is asked to stop; false then.
bool pause(const StopSignals& signals, std::chrono::milliseconds time);

// How far the clock of a machine is ahead of this one's.
struct ClockOffset {
  std::string host;  // of the graph file; empty: all of the graph runs on one
  bool known = false;
  double seconds = 0.0;
  double uncertainty = 0.0;  // s
  std::string how;           // in words
};

// Asks the agent of `host` for its time, several times, and believes the quickest answer: the
// agent's clock was read between question and answer, whatever the way takes.
ClockOffset ask_clock(graph::Remote& remote, const std::string& host);

// "12.3 kB"
std::string bytes_text(double bytes);

}  // namespace cosegraph::tools
