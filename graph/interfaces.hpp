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

}  // namespace cosegraph::graph
