// Who is there in the graph's DDS domain: participants, their writers and readers. Watching takes
// nothing from anybody: no topic is read.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "graph/dds.hpp"
#include "graph/matching.hpp"

namespace cosegraph::graph {

// A participant as it announces itself.
struct Peer {
  std::string guid;
  std::string name;  // of a stage: "GRAPH/STAGE"
  std::string host;  // machine's name, user and process, as far as told
  std::string user;
  std::string process;
  std::vector<std::string> addresses;
  bool on_this_machine = false;
  double lease = kForever;  // s of silence after which it is given up
};

// All that is there at one time, in the order of guids.
struct Domain {
  std::map<std::string, Peer> peers;  // by guid
  std::vector<Endpoint> endpoints;

  std::vector<const Endpoint*> writers(std::string_view topic) const;
  std::vector<const Endpoint*> readers(std::string_view topic) const;
};

class DomainWatch {
 public:
  explicit DomainWatch(const GraphDescription& graph);
  ~DomainWatch();

  Domain domain() const;
  // Until `enough`, at most `patience`; what is there then.
  Domain wait(std::chrono::milliseconds patience, const std::function<bool(const Domain&)>& enough);

  // What discovers, to read with.
  Participant& participant() { return *participant_; }

 private:
  class Listener;

  void tell();  // that something has changed; with the mutex held

  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::uint64_t changes_ = 0;
  std::map<std::string, Peer> peers_;
  std::map<std::string, Endpoint> endpoints_;
  std::unique_ptr<Listener> listener_;
  std::unique_ptr<Participant> participant_;  // last: gone before what its listener needs
};

// The DDS partition of a run.
std::string partition_of(const GraphDescription& graph);

// Whether every stage's outputs have a writer and its inputs a reader in the run's partition.
bool is_complete(const Domain& domain, const GraphDescription& graph);

}  // namespace cosegraph::graph
