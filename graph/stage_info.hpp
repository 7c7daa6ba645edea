// What a kind of stage is: its ports and parameters. The graph checker, `cosegraph stages`, the
// JSON schema and the drawings read this.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/fields.hpp"

namespace cosegraph::graph {

struct PortInfo {
  std::string name;
  std::string type;  // message type: "Cloud", "Supervoxels", ...
  std::string doc;
  bool latched = false;   // the newest value counts, for all frames (models); else one per frame
  bool optional = false;  // inputs only: may be left unconnected
};

struct StageInfo {
  std::string kind;
  std::string summary;  // one sentence
  std::vector<PortInfo> inputs;
  std::vector<PortInfo> outputs;
  Fields parameters;  // bound to the members of `owner`, holding the defaults
  std::shared_ptr<void> owner;

  const PortInfo* input(const std::string& name) const {
    for (const auto& port : inputs)
      if (port.name == name) return &port;
    return nullptr;
  }
  const PortInfo* output(const std::string& name) const {
    for (const auto& port : outputs)
      if (port.name == name) return &port;
    return nullptr;
  }
  bool has_frame_inputs() const { return any_frame_port(inputs); }
  bool has_frame_outputs() const { return any_frame_port(outputs); }
  // Admits frames into the graph.
  bool is_source() const { return !has_frame_inputs() && has_frame_outputs(); }

 private:
  static bool any_frame_port(const std::vector<PortInfo>& ports) {
    for (const auto& port : ports)
      if (!port.latched) return true;
    return false;
  }
};

// Every kind of stage that is known, by name. Each call makes a fresh StageInfo, so that parameters
// can be set on it freely.
using Catalog = std::map<std::string, std::function<StageInfo()>>;

}  // namespace cosegraph::graph
