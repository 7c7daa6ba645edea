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
};

struct ObservedFailure {
  std::string stage;
  std::string frame;  // its name
  std::uint64_t sequence = 0;
  std::string reason;
};

class Observer {
 public:
  explicit Observer(const GraphDescription& graph);

  std::map<std::string, Observed> stages() const;
  std::vector<ObservedFailure> failures() const;
  // Waits for news, at most `patience`.
  void wait(std::chrono::milliseconds patience);

 private:
  mutable std::mutex mutex_;
  std::condition_variable news_;
  bool fresh_ = false;
  std::map<std::string, Observed> stages_;
  std::vector<ObservedFailure> failures_;
  Participant participant_;
  std::vector<std::unique_ptr<Reader>> readers_;
};

}  // namespace cosegraph::graph
