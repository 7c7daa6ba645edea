// Follows a running graph until its stream is over; shared by the two ways of running one.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "graph/observer.hpp"
#include "graph/run.hpp"

namespace cosegraph::graph {

class Watch {
 public:
  Watch(const GraphDescription& graph, const Catalog& catalog, const RunOptions& options);

  // Waits for news and reports it; false once the run is over or was asked to stop.
  bool step(std::chrono::milliseconds patience);
  // The final figures.
  RunReport report();

 private:
  bool over() const;
  bool settled() const;

  Observer observer_;
  RunOptions options_;
  std::string source_;
  std::vector<std::string> streaming_;
  bool interrupted_ = false;
  std::chrono::steady_clock::time_point updated_{};
};

}  // namespace cosegraph::graph
