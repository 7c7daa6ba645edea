// Rates of a running graph between two looks at the statuses of its processes: what they count
// themselves, over the time that their own clocks say has passed. Nothing is missed and nobody is
// read for it.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "graph/observer.hpp"

namespace cosegraph::graph {

using Look = std::map<std::string, Observed>;  // see Observer::stages()

struct TopicTraffic {
  std::uint64_t messages = 0;  // written since the writers' processes began
  std::uint64_t bytes = 0;
  double rate = 0.0;       // messages per second
  double byte_rate = 0.0;  // bytes per second
  double span = 0.0;       // s; 0: no two statuses yet, and no rates
};

// What was written, by topic; of several writers the sum.
std::map<std::string, TopicTraffic> traffic_of(const Look& before, const Look& now);

struct Load {
  double cpu = 0.0;   // cores, of the process; stages of one process share it
  double rate = 0.0;  // frames finished or failed per second
  double span = 0.0;  // s; as above
};

// By process, those of `now`.
std::map<std::string, Load> loads_of(const Look& before, const Look& now);

}  // namespace cosegraph::graph
