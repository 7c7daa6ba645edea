// Watches a running graph from outside: the newest status of every stage and every failure.
#pragma once

#include <chrono>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "graph/dds.hpp"
#include "graph/description.hpp"
#include "idl/codec.hpp"

namespace cosegraph::graph {

struct Observed {
  idl::FrameHeader header;  // of the newest status
  idl::StageStatus status;
  std::chrono::steady_clock::time_point heard;
};

struct ObservedAgent {
  idl::AgentStatus status;
  std::chrono::steady_clock::time_point heard;
};

struct ObservedFailure {
  std::string stage;
  std::string frame;  // its name
  std::uint64_t sequence = 0;
  std::string reason;
  std::int64_t heard = 0;  // ns since 1970
};

class Observer {
 public:
  // `name` of its participant, for whoever lists the readers of a topic.
  explicit Observer(const GraphDescription& graph, const std::string& name = "observer");

  // The processes in their places, by process_name(); candidates for a swap are left out.
  std::map<std::string, Observed> stages() const;
  std::map<std::string, ObservedAgent> agents() const;  // by host
  // All but the first `known`, in the order in which they were heard.
  std::vector<ObservedFailure> failures(std::size_t known = 0) const;
  // Waits for news, at most `patience`.
  void wait(std::chrono::milliseconds patience);

  // For more to read and write: each participant costs all others of a graph.
  Participant& participant() { return participant_; }

 private:
  mutable std::mutex mutex_;
  std::condition_variable news_;
  bool fresh_ = false;
  GraphDescription graph_;
  std::map<std::string, Observed> stages_;
  std::map<std::string, ObservedAgent> agents_;
  std::vector<ObservedFailure> failures_;
  Participant participant_;
  std::vector<std::unique_ptr<Reader>> readers_;
};

}  // namespace cosegraph::graph
