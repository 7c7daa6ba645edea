#include "tools/monitor/state.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

template <>
cosegraph::Names<cosegraph::monitor::RunState> cosegraph::names<cosegraph::monitor::RunState>() {
  using enum monitor::RunState;
  static constexpr std::pair<monitor::RunState, std::string_view> kTable[] = {
      {waiting, "waiting"},
      {running, "running"},
      {finished, "finished"},
      {silent, "silent"},
      {ended, "ended"}};
  return kTable;
}

namespace cosegraph::monitor {
namespace {

using nlohmann::ordered_json;

constexpr std::uint64_t kSilence = 3'000'000'000;  // ns; stages report several times a second

ordered_json to_json(const idl::FrameHeader& header, const idl::StageStatus& status) {
  ordered_json ports = ordered_json::array();
  for (const auto& port : status.ports)
    ports.push_back({{"name", port.name},
                     {"topic", port.topic},
                     {"output", port.output},
                     {"messages", port.messages},
                     {"bytes", port.bytes}});
  return {{"state", to_name(status.state)},
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
          {"account",
           {{"admitted", status.account.admitted},
            {"labelled", status.account.labelled},
            {"consumed", status.account.consumed},
            {"failed", status.account.failed},
            {"dropped", status.account.dropped}}},
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
      outputs.push_back({{"port", topic.port},
                         {"topic", topic.name},
                         {"type", topic.type},
                         {"latched", topic.latched}});
  return outputs;
}

ordered_json params_json(const graph::StageNode& node) {
  ordered_json params = ordered_json::object();
  for (const auto& param : node.params) {
    std::string text;
    for (const auto& word : param.value) text += (text.empty() ? "" : ", ") + word;
    params[param.name] = text;
  }
  return params;
}

}  // namespace

GraphState::GraphState(graph::GraphDescription graph, std::vector<Topic> topics)
    : graph_(std::move(graph)), topics_(std::move(topics)) {}

void GraphState::add_status(const idl::FrameHeader& header, const idl::StageStatus& status,
                            std::uint64_t now) {
  heard_ = std::max(heard_, now);
  Seen& seen = stages_[header.stage];
  if (header.generation >= seen.header.generation) seen = {header, status, now};
}

void GraphState::add_failure(const idl::FrameHeader& header, const idl::FrameFailure& failure,
                             std::uint64_t now) {
  ++failure_count_;
  failures_.push_back({.stage = header.stage,
                       .frame = header.name,
                       .sequence = header.sequence,
                       .reason = failure.reason,
                       .time = now});
  if (failures_.size() > kMaxFailures) failures_.pop_front();
}

RunState GraphState::state(std::uint64_t now) const {
  if (ended_) return RunState::ended;
  if (heard_ == 0) return RunState::waiting;
  // Only sources account for frames, so the others do not matter here.
  const bool finished = std::ranges::any_of(stages_, [](const auto& entry) {
    const idl::StageStatus& status = entry.second.status;
    return status.account.admitted > 0 && status.state == idl::State::finished;
  });
  if (finished) return RunState::finished;
  return now > heard_ + kSilence ? RunState::silent : RunState::running;
}

std::string GraphState::to_json(std::uint64_t now) const {
  ordered_json stages = ordered_json::array();
  for (const auto& node : graph_.stages) {
    const auto seen = stages_.find(node.name);
    stages.push_back({{"name", node.name},
                      {"kind", node.use.empty() ? node.exec : node.use},
                      {"host", node.host},
                      {"inputs", inputs_json(graph_, node)},
                      {"outputs", outputs_json(topics_, node)},
                      {"params", params_json(node)},
                      {"status", seen == stages_.end() ? ordered_json(nullptr)
                                                       : monitor::to_json(seen->second.header,
                                                                          seen->second.status)}});
  }
  ordered_json failures = ordered_json::array();
  for (const auto& failure : failures_)
    failures.push_back({{"stage", failure.stage},
                        {"frame", failure.frame},
                        {"sequence", failure.sequence},
                        {"reason", failure.reason},
                        {"time", failure.time / 1'000'000}});
  const ordered_json all = {{"graph", graph_.graph},           {"instance", graph_.instance},
                            {"state", to_name(state(now))},    {"time", now / 1'000'000},
                            {"window", graph_.window},         {"stages", std::move(stages)},
                            {"failures", std::move(failures)}, {"failure_count", failure_count_}};
  return all.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace cosegraph::monitor
