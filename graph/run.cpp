#include "graph/run.hpp"

#include <algorithm>
#include <chrono>

#include "graph/control.hpp"
#include "graph/runs.hpp"
#include "graph/runtime.hpp"
#include "graph/watch.hpp"

namespace cosegraph::graph {

using namespace std::chrono_literals;
using idl::State;

bool Watch::over() const {
  const auto stages = observer_.stages();
  for (const auto& [name, seen] : stages)
    if (seen.status.state == State::failed) return true;
  const auto source = stages.find(source_);
  return source != stages.end() && source->second.status.state == State::finished;
}

// All stages that take frames have worked the stream off, so that their figures are final, and what
// is known to have failed has been told: participants are discovered in any order.
bool Watch::settled() const {
  const auto stages = observer_.stages();
  const auto source = stages.find(source_);
  if (source == stages.end() || (source->second.status.state != State::finished &&
                                 source->second.status.state != State::failed))
    return false;
  if (source->second.status.account.failed > 0 && observer_.failures().empty()) return false;
  return std::ranges::all_of(streaming_, [&](const std::string& name) {
    const auto seen = stages.find(name);
    return seen != stages.end() && (seen->second.status.state == State::finished ||
                                    seen->second.status.state == State::failed);
  });
}

Watch::Watch(const GraphDescription& graph, const Catalog& catalog, const RunOptions& options)
    : observer_(graph), options_(options), source_(source_of(graph, catalog).name) {
  const auto infos = infos_of(graph, catalog);
  for (std::size_t i = 0; i < infos.size(); ++i)
    if (infos[i].has_frame_inputs())
      for (std::uint32_t r = 0; r < hosts_of(graph.stages[i]).size(); ++r)
        streaming_.push_back(process_name(graph.stages[i], r));
}

bool Watch::step(std::chrono::milliseconds patience) {
  observer_.wait(patience);
  const auto now = std::chrono::steady_clock::now();
  if (options_.on_update && now - updated_ > 100ms) {
    options_.on_update(observer_.stages());
    updated_ = now;
  }
  interrupted_ = options_.stop != nullptr && options_.stop->load();
  return !interrupted_ && !over();
}

RunReport Watch::report() {
  if (!interrupted_)
    for (int i = 0; i < 20 && !settled(); ++i) observer_.wait(100ms);
  RunReport report{
      .stages = observer_.stages(), .failures = observer_.failures(), .interrupted = interrupted_};
  if (const auto source = report.stages.find(source_); source != report.stages.end())
    report.account = source->second.status.account;
  for (const auto& [name, seen] : report.stages)
    if (seen.status.state == State::failed && name != source_)
      report.error = name + ": " + seen.status.activity;
  if (const auto source = report.stages.find(source_); report.error.empty() &&
                                                       source != report.stages.end() &&
                                                       source->second.status.state == State::failed)
    report.error = source_ + ": " + source->second.status.activity;
  if (options_.on_update) options_.on_update(report.stages);
  return report;
}

RunReport run_in_process(const GraphDescription& description, const StageTable& table,
                         const RunOptions& options) {
  GraphDescription graph = fresh_instance(description);
  graph.one_process = true;
  const RunFolder folder(graph, "");
  const Catalog catalog = catalog_of(table);
  Watch watch(graph, catalog, options);
  const std::vector<std::string> leaves = leaves_of(graph, catalog);
  std::vector<std::unique_ptr<StageRunner>> runners;
  for (const auto& node : graph.stages) {
    if (!node.exec.empty())
      throw Error("stage " + node.name + " is a program of its own: use 'cosegraph up'");
    for (std::uint32_t replica = 0; replica < hosts_of(node).size(); ++replica) {
      auto stage = table.at(node.use)();
      apply_params(graph, node, *stage);
      try {
        runners.push_back(
            std::make_unique<StageRunner>(graph, node.name, std::move(stage),
                                          RunnerOptions{.leaves = leaves, .replica = replica}));
      } catch (const Error& error) {
        throw Error(process_name(node, replica) + ": " + error.what());
      }
    }
  }
  while (watch.step(50ms)) {
  }
  RunReport report = watch.report();
  for (const auto& runner : runners) runner->request_stop();
  return report;
}

RunReport run_processes(const GraphDescription& description, const Catalog& catalog,
                        const RunOptions& options, const AgentOptions& agent_options) {
  // Hosts find each other by the graph's name.
  const GraphDescription graph =
      agent_options.host.empty() ? fresh_instance(description) : description;
  Agent agent(graph, catalog, agent_options);
  Watch watch(graph, catalog, options);
  std::string error;
  while (error.empty() && !agent.is_down() && watch.step(0ms)) {
    agent.step(20ms);
    error = agent.failure();
  }
  if (agent.is_down()) error = "it was taken down";
  RunReport report = watch.report();
  if (!error.empty()) report.error = error;
  return report;
}

}  // namespace cosegraph::graph
