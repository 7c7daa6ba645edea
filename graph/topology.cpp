// Who feeds whom in a graph without faults.
#include <algorithm>
#include <set>

#include "graph/description.hpp"

namespace cosegraph::graph {
namespace {

// Message types that no kind of stage gives but as a latched output.
std::set<std::string> latched_types(const Catalog& catalog) {
  std::set<std::string> latched;
  std::set<std::string> framed;
  for (const auto& [kind, make] : catalog)
    for (const auto& port : make().outputs) (port.latched ? latched : framed).insert(port.type);
  std::erase_if(latched, [&](const auto& type) { return framed.contains(type); });
  return latched;
}

StageInfo info_of_executable(const StageNode& stage, const Catalog& catalog) {
  StageInfo info{.kind = std::filesystem::path(stage.exec).filename().string(),
                 .summary = "A program of your own.",
                 .outputs = stage.outputs};
  for (const auto& input : stage.inputs) info.inputs.push_back({.name = input.port});
  const auto latched = latched_types(catalog);
  for (auto& output : info.outputs) output.latched = latched.contains(output.type);
  return info;
}

std::size_t index_of(const GraphDescription& graph, std::string_view name) {
  const auto found = std::ranges::find(graph.stages, name, &StageNode::name);
  if (found == graph.stages.end()) throw Error("no stage '" + std::string(name) + "'");
  return static_cast<std::size_t>(found - graph.stages.begin());
}

// Whether `stage` takes something once per frame from `from`.
bool takes_frames_from(const StageNode& stage, const StageInfo& info, const StageNode& from) {
  return std::ranges::any_of(stage.inputs, [&](const Connection& input) {
    const PortInfo* port = info.input(input.port);
    return input.from_stage == from.name && port != nullptr && !port->latched;
  });
}

}  // namespace

StageInfo info_of(const StageNode& stage, const Catalog& catalog) {
  if (stage.use.empty()) return info_of_executable(stage, catalog);
  const auto found = catalog.find(stage.use);
  if (found == catalog.end()) throw Error("unknown kind of stage '" + stage.use + "'");
  return found->second();
}

std::vector<StageInfo> infos_of(const GraphDescription& graph, const Catalog& catalog) {
  std::vector<StageInfo> result;
  for (const auto& stage : graph.stages) result.push_back(info_of(stage, catalog));
  for (std::size_t i = 0; i < result.size(); ++i) {
    if (graph.stages[i].exec.empty()) continue;
    for (const auto& input : graph.stages[i].inputs) {
      const PortInfo* from = result[index_of(graph, input.from_stage)].output(input.from_port);
      const auto port = std::ranges::find(result[i].inputs, input.port, &PortInfo::name);
      if (from == nullptr || port == result[i].inputs.end()) continue;
      port->type = from->type;
      port->latched = from->latched;
    }
  }
  return result;
}

const StageNode& source_of(const GraphDescription& graph, const Catalog& catalog) {
  const auto infos = infos_of(graph, catalog);
  for (std::size_t i = 0; i < infos.size(); ++i)
    if (infos[i].is_source()) return graph.stages[i];
  throw Error("graph '" + graph.graph + "' has no source of frames");
}

std::vector<std::string> leaves_of(const GraphDescription& graph, const Catalog& catalog) {
  const auto infos = infos_of(graph, catalog);
  std::vector<std::string> result;
  for (std::size_t i = 0; i < infos.size(); ++i) {
    bool is_leaf = infos[i].has_frame_inputs();
    for (std::size_t j = 0; j < infos.size(); ++j)
      if (takes_frames_from(graph.stages[j], infos[j], graph.stages[i])) is_leaf = false;
    if (is_leaf) result.push_back(graph.stages[i].name);
  }
  return result;
}

std::set<std::string> upstream_of(const GraphDescription& graph, const std::string& stage) {
  std::set<std::string> result;
  std::vector<std::string> todo{stage};
  while (!todo.empty()) {
    const std::string name = todo.back();
    todo.pop_back();
    if (!result.insert(name).second) continue;
    if (const StageNode* node = graph.stage(name))
      for (const auto& input : node->inputs) todo.push_back(input.from_stage);
  }
  return result;
}

std::vector<std::string> downstream_of(const GraphDescription& graph, std::string_view stage,
                                       const Catalog& catalog) {
  const auto infos = infos_of(graph, catalog);
  std::vector<bool> reached(infos.size(), false);
  std::vector<std::size_t> open = {index_of(graph, stage)};
  while (!open.empty()) {
    const StageNode& from = graph.stages[open.back()];
    open.pop_back();
    for (std::size_t i = 0; i < infos.size(); ++i) {
      if (reached[i] || !takes_frames_from(graph.stages[i], infos[i], from)) continue;
      reached[i] = true;
      open.push_back(i);
    }
  }
  std::vector<std::string> result;
  for (std::size_t i = 0; i < reached.size(); ++i)
    if (reached[i]) result.push_back(graph.stages[i].name);
  return result;
}

}  // namespace cosegraph::graph
