#include "tools/cosegraph/hosts.hpp"

#include <arpa/inet.h>
#include <netdb.h>

#include <algorithm>

#include "graph/interfaces.hpp"

namespace cosegraph::tools {
namespace {

std::string numeric(const std::string& address) {
  addrinfo hints{};
  hints.ai_family = AF_INET;
  addrinfo* found = nullptr;
  if (::getaddrinfo(address.c_str(), nullptr, &hints, &found) != 0) return address;
  char text[INET_ADDRSTRLEN] = {};
  const auto* first = reinterpret_cast<const sockaddr_in*>(found->ai_addr);
  ::inet_ntop(AF_INET, &first->sin_addr, text, sizeof text);
  ::freeaddrinfo(found);
  return text;
}

std::string names_of(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace

std::string host_here(const graph::GraphDescription& graph, const std::string& wanted) {
  std::vector<std::string> names;
  for (const auto& host : graph.hosts) names.push_back(host.name);
  if (names.empty()) {
    if (!wanted.empty()) throw ParameterError("--host " + wanted + ": the graph names no hosts");
    return "";
  }
  for (const auto& stage : graph.stages)
    for (const auto& host : graph::hosts_of(stage))
      if (host.empty())
        throw ParameterError(
            "stage '" + stage.name +
            "' names no host: in a graph with hosts each stage says where it runs");
  if (!wanted.empty()) {
    if (std::ranges::find(names, wanted) == names.end())
      throw ParameterError("--host: unknown host '" + wanted + "'" + did_you_mean(wanted, names) +
                           "; there are: " + names_of(names));
    return wanted;
  }
  const auto own = graph::interfaces();
  std::vector<std::string> here;
  for (const auto& host : graph.hosts)
    if (std::ranges::find(own, numeric(host.address), &graph::Interface::address) != own.end())
      here.push_back(host.name);
  if (here.size() == 1) return here[0];
  throw ParameterError(
      (here.empty()
           ? "no host of the graph has an address of this machine"
           : "several hosts of the graph have addresses of this machine: " + names_of(here)) +
      "; say which it is with --host (" + names_of(names) + ")");
}

}  // namespace cosegraph::tools
