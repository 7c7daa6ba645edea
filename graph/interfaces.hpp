// The network interfaces of this machine that have an IPv4 address.
#pragma once

#include <string>
#include <vector>

namespace cosegraph::graph {

struct Interface {
  std::string name;     // eth0
  std::string address;  // 192.168.0.7
  bool loopback = false;
  bool multicast = false;
  bool connected = false;  // false while its cable is out, or its wireless network is away
};

// Those that are switched on.
std::vector<Interface> interfaces();

// From now on the interface with this address counts as connected in this process, if it is
// switched on. Fast DDS leaves out, for as long as a participant lives, what has no connection when
// it is made: a stage that is started while the cable is out would never be heard again.
void count_as_connected(const std::string& address);

}  // namespace cosegraph::graph
