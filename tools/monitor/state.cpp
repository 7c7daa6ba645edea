#include "tools/monitor/state.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "graph/control.hpp"
#include "tools/account_json.hpp"

template <>
cosegraph::Names<cosegraph::monitor::RunState> cosegraph::names<cosegraph::monitor::RunState>() {
  using enum monitor::RunState;
  static constexpr std::pair<monitor::RunState, std::string_view> kTable[] = {
      {waiting, "waiting"}, {running, "running"}, {finished, "finished"},
      {silent, "silent"},   {ended, "ended"},     {file, "file"}};
  return kTable;
}

namespace cosegraph::monitor {
namespace {

using nlohmann::ordered_json;
using namespace std::chrono_literals;

constexpr auto kSilence = 3s;  // stages report several times a second

ordered_json to_json(const graph::Observed& seen, const std::string& process,
                     GraphState::Time now) {
  const auto& [header, status, heard] = seen;
  ordered_json ports = ordered_json::array();
  for (const auto& port : status.ports)
    ports.push_back({{"name", port.name},
                     {"topic", port.topic},
                     {"output", port.output},
                     {"messages", port.messages},
                     {"bytes", port.bytes}});
  return {
      {"process", process},
      {"state", to_name(status.state)},
      {"heard_ms_ago", std::chrono::duration_cast<std::chrono::milliseconds>(now - heard).count()},
      {"activity", status.activity},
      {"progress", status.progress},
      {"generation", header.generation},
      {"host", status.host},
      {"pid", status.pid},
      {"frame", header.name},
      {"sequence", header.sequence},
      {"epoch", std::to_string(header.epoch)},
      {"frames_in", status.frames_in},
      {"frames_out", status.frames_out},
      {"frames_failed", status.frames_failed},
      {"queue", status.queue},
      {"latency_median", status.latency_median},
      {"latency_p99", status.latency_p99},
      {"latency_sum", status.latency_sum},
      {"cpu_seconds", status.cpu_seconds},
      {"memory", status.memory},
      {"account", account_json(status.account)},
      {"ports", std::move(ports)}};
}

ordered_json inputs_json(const graph::GraphDescription& graph, const graph::StageNode& node) {
  ordered_json inputs = ordered_json::array();
  for (const auto& input : node.inputs)
    inputs.push_back({{"port", input.port},
                      {"stage", input.from_stage},
                      {"topic", graph::topic_name(graph, input.from_stage, input.from_port)}});
  return inputs;
}

ordered_json outputs_json(const std::vector<Topic>& topics, const graph::StageNode& node) {
  ordered_json outputs = ordered_json::array();
  for (const auto& topic : topics)
    if (topic.stage == node.name)
      outputs.push_back({{"port", topic.port()},
                         {"topic", topic.name},
                         {"type", topic.type},
                         {"latched", topic.latched}});
  return outputs;
}

ordered_json params_json(const graph::StageNode& node, const graph::StageInfo* info) {
  const auto text_of = [](const graph::Setting& setting) {
    std::string text;
    for (const auto& word : setting.value) text += (text.empty() ? "" : ",") + word;
    return text;
  };
  ordered_json params = ordered_json::array();
  if (info != nullptr)
    for (const auto& field : info->parameters) {
      const auto set = std::ranges::find(node.params, field.name, &graph::Setting::name);
      params.push_back({{"name", field.name},
                        {"value", set == node.params.end() ? field.text() : text_of(*set)},
                        {"default", field.text()},
                        {"unit", field.unit},
                        {"doc", field.doc},
                        {"choices", field.choices}});
    }
  for (const auto& param : node.params)
    if (info == nullptr || find(info->parameters, param.name) == nullptr)
      params.push_back({{"name", param.name}, {"value", text_of(param)}});
  return params;
}

ordered_json processes_json(const graph::StageNode& node, const graph::Look& processes,
                            GraphState::Time now) {
  ordered_json result = ordered_json::array();
  for (std::uint32_t r = 0; r < graph::hosts_of(node).size(); ++r)
    if (const auto seen = processes.find(graph::process_name(node, r)); seen != processes.end())
      result.push_back(to_json(seen->second, seen->first, now));
  return result;
}

}  // namespace

GraphState::GraphState(graph::GraphDescription graph, std::vector<Topic> topics,
                       std::vector<graph::StageInfo> infos)
    : graph_(std::move(graph)), topics_(std::move(topics)), infos_(std::move(infos)) {}

void GraphState::change(graph::GraphDescription graph, std::vector<graph::StageInfo> infos) {
  graph_ = std::move(graph);
  infos_ = std::move(infos);
}

void GraphState::hear(graph::Look processes, const std::vector<graph::ObservedFailure>& failures) {
  processes_ = std::move(processes);
  failure_count_ += failures.size();
  failures_.insert(failures_.end(), failures.begin(), failures.end());
  while (failures_.size() > kMaxFailures) failures_.pop_front();
}

RunState GraphState::state(Time now) const {
  if (end_ != RunState::waiting) return end_;
  if (processes_.empty()) return RunState::waiting;
  // Only sources account for frames, so the others do not matter here.
  const bool finished = std::ranges::any_of(processes_, [](const auto& entry) {
    const idl::StageStatus& status = entry.second.status;
    return status.account.admitted > 0 && status.state == idl::State::finished;
  });
  if (finished) return RunState::finished;
  const bool heard = std::ranges::any_of(
      processes_, [&](const auto& entry) { return now - entry.second.heard <= kSilence; });
  return heard ? RunState::running : RunState::silent;
}

std::string GraphState::to_json(Time now, std::uint64_t wall) const {
  ordered_json stages = ordered_json::array();
  for (std::size_t i = 0; i < graph_.stages.size(); ++i) {
    const graph::StageNode& node = graph_.stages[i];
    stages.push_back({{"name", node.name},
                      {"kind", node.use.empty() ? node.exec : node.use},
                      {"host", node.host},
                      {"inputs", inputs_json(graph_, node)},
                      {"outputs", outputs_json(topics_, node)},
                      {"params", params_json(node, i < infos_.size() ? &infos_[i] : nullptr)},
                      {"processes", processes_json(node, processes_, now)}});
  }
  ordered_json failures = ordered_json::array();
  for (const auto& failure : failures_)
    failures.push_back({{"stage", failure.stage},
                        {"frame", failure.frame},
                        {"sequence", failure.sequence},
                        {"reason", failure.reason},
                        {"time", failure.heard / 1'000'000}});
  ordered_json all = {{"graph", graph_.graph},
                      {"instance", graph_.instance},
                      {"state", to_name(state(now))},
                      {"time", wall / 1'000'000},
                      {"window", graph_.window},
                      {"agents", agents_},
                      {"note", note_},
                      {"stages", std::move(stages)},
                      {"failures", std::move(failures)},
                      {"failure_count", failure_count_}};
  if (frames_) describe_frames(all, *frames_, first_);
  return all.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace cosegraph::monitor
