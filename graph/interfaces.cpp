#include "graph/interfaces.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>

#include <memory>

namespace cosegraph::graph {

std::vector<Interface> interfaces() {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return {};
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> all(first, ::freeifaddrs);
  std::vector<Interface> result;
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    const auto is = [one](unsigned flag) { return (one->ifa_flags & flag) != 0U; };
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET || !is(IFF_UP)) continue;
    char text[INET_ADDRSTRLEN] = {};
    const auto* address = reinterpret_cast<const sockaddr_in*>(one->ifa_addr);
    ::inet_ntop(AF_INET, &address->sin_addr, text, sizeof text);
    result.push_back({.name = one->ifa_name,
                      .address = text,
                      .loopback = is(IFF_LOOPBACK),
                      .multicast = is(IFF_MULTICAST),
                      .connected = is(IFF_RUNNING)});
  }
  return result;
}

}  // namespace cosegraph::graph
