// A participant made with Fast DDS alone, as somebody would who leaves out the checks of `graph`.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "graph/security.hpp"

namespace cosegraph::graph::test {

class RawParticipant {
 public:
  RawParticipant(const GraphDescription& graph, const KeyFiles& files);
  ~RawParticipant();

  // Whether DDS let it in.
  bool joined() const;
  // False if DDS refuses.
  bool open_writer(const std::string& topic, std::string_view type);
  // How many readers the writer of this topic has found.
  int readers(const std::string& topic) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// From now on messages within this process go through the network too.
void deliver_by_network();

}  // namespace cosegraph::graph::test
