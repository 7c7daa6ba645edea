#include "graph/interfaces.hpp"

#include <arpa/inet.h>
#include <dlfcn.h>
#include <ifaddrs.h>
#include <net/if.h>

#include <memory>
#include <mutex>
#include <set>

namespace cosegraph::graph {
namespace {

struct Always {
  std::mutex mutex;
  std::set<std::string> addresses;
};

Always& always_connected() {
  static Always instance;
  return instance;
}

bool has_address(const ifaddrs& interface) {
  return interface.ifa_addr != nullptr && interface.ifa_addr->sa_family == AF_INET;
}

std::string address_of(const ifaddrs& interface) {
  char text[INET_ADDRSTRLEN] = {};
  const auto* address = reinterpret_cast<const sockaddr_in*>(interface.ifa_addr);
  ::inet_ntop(AF_INET, &address->sin_addr, text, sizeof text);
  return text;
}

}  // namespace

void count_as_connected(const std::string& address) {
  Always& always = always_connected();
  const std::scoped_lock lock(always.mutex);
  always.addresses.insert(address);
}

std::vector<Interface> interfaces() {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return {};
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> all(first, ::freeifaddrs);
  std::vector<Interface> result;
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    const auto is = [one](unsigned flag) { return (one->ifa_flags & flag) != 0U; };
    if (!has_address(*one) || !is(IFF_UP)) continue;
    result.push_back({.name = one->ifa_name,
                      .address = address_of(*one),
                      .loopback = is(IFF_LOOPBACK),
                      .multicast = is(IFF_MULTICAST),
                      .connected = is(IFF_RUNNING)});
  }
  return result;
}

}  // namespace cosegraph::graph

// Stands before the C library's for all of the process, Fast DDS included.
extern "C" int getifaddrs(ifaddrs** result) noexcept {
  using cosegraph::graph::address_of;
  static const auto from_system =
      reinterpret_cast<int (*)(ifaddrs**)>(::dlsym(RTLD_NEXT, "getifaddrs"));
  const int status = from_system(result);
  if (status != 0) return status;
  cosegraph::graph::Always& always = cosegraph::graph::always_connected();
  const std::scoped_lock lock(always.mutex);
  for (ifaddrs* one = *result; one != nullptr; one = one->ifa_next)
    if (cosegraph::graph::has_address(*one) && (one->ifa_flags & IFF_UP) != 0U &&
        always.addresses.contains(address_of(*one)))
      one->ifa_flags |= IFF_RUNNING;
  return status;
}
