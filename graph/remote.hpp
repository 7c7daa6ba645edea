// Speaks to the agents of a running graph: who is there, and orders with their replies.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "graph/description.hpp"
#include "graph/observer.hpp"
#include "idl/codec.hpp"

namespace cosegraph::graph {

class Remote {
 public:
  // `graph` with its instance, see find_run(); `name` of its participant.
  explicit Remote(const GraphDescription& graph, const std::string& name = "command");
  ~Remote();

  // Waits until the agents that are there have been heard: `patience` at most, less once all hosts
  // of the graph file answer.
  std::map<std::string, ObservedAgent> agents(std::chrono::milliseconds patience);
  // The newest of every process and every failure seen so far.
  Observer& observer();

  // Sends an order to the agent of `command.host` and waits for its end; the id is filled in.
  // Progress is passed on. Throws Error if the order is refused (its text tells why) or nobody
  // answers in time.
  std::string order(idl::Command command, std::chrono::milliseconds patience,
                    const std::function<void(const std::string&)>& on_progress = {});

  // For another thread: an order() that waits throws now, and so do those that come.
  void give_up();

  // Calls `take` with what stages print from now on (and with what agents still have of it), until
  // it returns false.
  void logs(const std::function<bool(const idl::LogLines&)>& take,
            std::chrono::milliseconds patience);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The hosts whose agents run processes of a stage.
std::vector<std::string> hosts_running(const std::map<std::string, ObservedAgent>& agents,
                                       const std::string& stage);

// What takes a stage's place; what is empty stays as it is.
struct Replacement {
  std::string use;   // kind
  std::string exec;  // program
  std::string host;
  std::vector<std::string> params;  // "NAME=VALUE"
  bool dry_run = false;             // only try whether the newcomer gets ready
};

// Orders the swap of `stage` and waits for its report, a JSON text (see agent.cpp). `source`: the
// stage that admits frames, whose agent leads swaps. Throws Error like Remote::order, also if no
// agent is there.
std::string order_swap(Remote& remote, const GraphDescription& graph, const std::string& source,
                       const std::string& stage, const Replacement& replacement,
                       const std::function<void(const std::string&)>& on_progress = {});

}  // namespace cosegraph::graph
