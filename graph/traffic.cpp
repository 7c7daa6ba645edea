#include "graph/traffic.hpp"

#include <algorithm>

namespace cosegraph::graph {
namespace {

// The earlier status of the same process, or null.
const Observed* earlier(const Look& before, const std::string& process, const Observed& now) {
  const auto found = before.find(process);
  if (found == before.end()) return nullptr;
  const Observed& then = found->second;
  const bool same = then.status.pid == now.status.pid && then.status.host == now.status.host &&
                    then.header.generation == now.header.generation;
  return same && then.header.stamp < now.header.stamp ? &then : nullptr;
}

double span_of(const Observed& before, const Observed& now) {
  return 1e-9 * static_cast<double>(now.header.stamp - before.header.stamp);
}

double growth(std::uint64_t before, std::uint64_t now) {
  return now > before ? static_cast<double>(now - before) : 0.0;
}

const idl::PortTraffic* same_port(const Observed& seen, const idl::PortTraffic& port) {
  for (const auto& other : seen.status.ports)
    if (other.output == port.output && other.name == port.name) return &other;
  return nullptr;
}

}  // namespace

std::map<std::string, TopicTraffic> traffic_of(const Look& before, const Look& now) {
  std::map<std::string, TopicTraffic> result;
  for (const auto& [process, seen] : now) {
    const Observed* then = earlier(before, process, seen);
    for (const auto& port : seen.status.ports) {
      if (!port.output) continue;
      TopicTraffic& traffic = result[port.topic];
      traffic.messages += port.messages;
      traffic.bytes += port.bytes;
      const idl::PortTraffic* old = then == nullptr ? nullptr : same_port(*then, port);
      if (old == nullptr) continue;
      const double span = span_of(*then, seen);
      traffic.span = std::max(traffic.span, span);
      traffic.rate += growth(old->messages, port.messages) / span;
      traffic.byte_rate += growth(old->bytes, port.bytes) / span;
    }
  }
  return result;
}

std::map<std::string, Load> loads_of(const Look& before, const Look& now) {
  std::map<std::string, Load> result;
  for (const auto& [process, seen] : now) {
    Load& load = result[process];
    const Observed* then = earlier(before, process, seen);
    if (then == nullptr) continue;
    const idl::StageStatus& a = then->status;
    const idl::StageStatus& b = seen.status;
    load.span = span_of(*then, seen);
    load.cpu = std::max(0.0, b.cpu_seconds - a.cpu_seconds) / load.span;
    load.rate = growth(a.frames_out + a.frames_failed, b.frames_out + b.frames_failed) / load.span;
  }
  return result;
}

}  // namespace cosegraph::graph
