#include "tools/cosegraph/run_graph.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>

#include "graph/control.hpp"
#include "graph/runtime.hpp"
#include "tools/account_json.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/stop_signals.hpp"

namespace cosegraph::tools {
namespace {

namespace fs = std::filesystem;

// Of all stages, in the graph's order.
std::vector<std::string> process_names(const graph::GraphDescription& graph) {
  std::vector<std::string> names;
  for (const auto& node : graph.stages)
    for (std::uint32_t replica = 0; replica < graph::hosts_of(node).size(); ++replica)
      names.push_back(graph::process_name(node, replica));
  return names;
}

// One line that is rewritten on a terminal; on a file a line per change of the counts.
class ProgressLine {
 public:
  void update(const std::map<std::string, graph::Observed>& stages) {
    std::string text;
    for (const auto& [name, seen] : stages) {
      const auto& account = seen.status.account;
      if (account.admitted > 0)
        text += std::to_string(account.labelled + account.consumed + account.failed) + " of " +
                std::to_string(account.admitted) + " admitted frames done";
    }
    for (const auto& [name, seen] : stages)
      if (!seen.status.activity.empty() && seen.status.state != idl::State::failed)
        text += (text.empty() ? "" : "; ") + name + ": " + seen.status.activity +
                (seen.status.progress >= 0
                     ? " " + std::to_string(static_cast<int>(100 * seen.status.progress)) + " %"
                     : "");
    if (text == shown_ || text.empty()) return;
    shown_ = text;
    if (terminal_) std::fprintf(stderr, "\r\033[K%s", text.c_str());
  }
  ~ProgressLine() {
    if (terminal_ && !shown_.empty()) std::fprintf(stderr, "\r\033[K");
  }

 private:
  bool terminal_ = ::isatty(STDERR_FILENO) != 0;
  std::string shown_;
};

void print_failures(const graph::RunReport& report) {
  for (const auto& failure : report.failures)
    std::cerr << failure.frame << " failed at " << failure.stage << ": " << failure.reason << '\n';
  if (report.interrupted && !report.endless) std::cerr << "stopped before the end\n";
  if (!report.error.empty()) std::cerr << report.error << '\n';
}

nlohmann::ordered_json to_json(const graph::RunReport& report,
                               const graph::GraphDescription& graph) {
  nlohmann::ordered_json stages = nlohmann::ordered_json::object();
  for (const auto& name : process_names(graph)) {
    const auto found = report.stages.find(name);
    if (found == report.stages.end()) continue;
    const idl::StageStatus& status = found->second.status;
    stages[name] = {{"kind", status.kind},
                    {"state", to_name(status.state)},
                    {"frames", status.frames_out},
                    {"failed", status.frames_failed},
                    {"ms_median", status.latency_median},
                    {"ms_p99", status.latency_p99},
                    {"ms_total", status.latency_sum},
                    {"cpu_seconds", status.cpu_seconds},
                    {"memory", status.memory}};
  }
  nlohmann::ordered_json failures = nlohmann::ordered_json::array();
  for (const auto& failure : report.failures)
    failures.push_back({{"frame", failure.frame},
                        {"sequence", failure.sequence},
                        {"stage", failure.stage},
                        {"reason", failure.reason}});
  return {{"graph", graph.graph},
          {"fine", report.fine()},
          {"error", report.error},
          {"interrupted", report.interrupted},
          {"account", account_json(report.account)},
          {"stages", std::move(stages)},
          {"failures", std::move(failures)}};
}

// Whether the graph's source goes on until it is stopped; of a program of its own that is not
// known.
bool is_endless(const graph::GraphDescription& graph, const graph::Catalog& catalog) {
  const graph::StageNode& node = graph::source_of(graph, catalog);
  if (!stage_table().contains(node.use)) return false;
  const auto stage = stage_table().at(node.use)();
  graph::apply_params(graph, node, *stage);
  return dynamic_cast<const graph::SourceStage&>(*stage).endless();
}

}  // namespace

fs::path executable_folder() {
  return fs::read_symlink("/proc/self/exe").parent_path();
}

graph::RunReport run_graph(const graph::GraphDescription& graph, const Where& where) {
  const StopSignals signals;
  ProgressLine progress;
  graph::RunOptions options{.on_update = [&](const auto& stages) { progress.update(stages); },
                            .stop = &signals.asked()};
  const auto print = [](const std::string& stage, const std::string& line) {
    std::cerr << "[" << stage << "] " << line << '\n';
  };
  const graph::Catalog catalog = graph::catalog_of(stage_table());
  graph::RunReport report = where.one_process
                                ? graph::run_in_process(graph, stage_table(), options)
                                : graph::run_processes(graph, catalog, options,
                                                       {.host = where.host,
                                                        .executables = executable_folder(),
                                                        .allow_exec = where.allow_exec,
                                                        .on_output = print});
  report.endless = is_endless(graph, catalog);
  return report;
}

void print_report(const graph::RunReport& report, const graph::GraphDescription& graph, bool json) {
  print_failures(report);
  if (json) {
    std::cout << to_json(report, graph).dump(2) << '\n';
    return;
  }
  std::printf("%-14s %8s %8s %10s %10s %10s\n", "stage", "frames", "failed", "ms median", "ms p99",
              "ms total");
  for (const auto& name : process_names(graph)) {
    const auto found = report.stages.find(name);
    if (found == report.stages.end() || found->second.status.frames_in == 0) continue;
    const idl::StageStatus& status = found->second.status;
    std::printf("%-14s %8llu %8llu %10.1f %10.1f %10.1f\n", name.c_str(),
                static_cast<unsigned long long>(status.frames_out),
                static_cast<unsigned long long>(status.frames_failed), status.latency_median,
                status.latency_p99, status.latency_sum);
  }
  const idl::Account& account = report.account;
  const std::uint64_t over = account.labelled + account.consumed + account.failed;
  std::printf("admitted %llu = labelled %llu + consumed %llu + failed %llu",
              static_cast<unsigned long long>(account.admitted),
              static_cast<unsigned long long>(account.labelled),
              static_cast<unsigned long long>(account.consumed),
              static_cast<unsigned long long>(account.failed));
  if (over != account.admitted)
    std::printf(" + in flight %llu", static_cast<unsigned long long>(account.admitted - over));
  std::printf("; dropped %llu\n", static_cast<unsigned long long>(account.dropped));
}

fs::path shipped_graph(std::string_view name) {
  const std::string file = std::string(name) + ".yaml";
  // Beside an installed program, then beside the one in a build folder.
  const fs::path folder = executable_folder().parent_path() / "share" / "cosegraph" / "graphs";
  if (fs::exists(folder / file)) return folder / file;
  throw InputError((folder / file).string() + ": the installed graph file is missing");
}

void configure(graph::GraphDescription& graph, std::string_view stage, const Fields& wanted) {
  const graph::StageNode* node = graph.stage(stage);
  if (node == nullptr) return;
  const graph::StageInfo info = graph::info_of(node->use, stage_table().at(node->use));
  for (const auto& field : wanted) {
    const Field* standard = find(info.parameters, field.name);
    if (standard != nullptr && standard->get() != field.get())
      graph::set_param(graph, stage, field.name, field.get());
  }
}

void apply_overrides(graph::GraphDescription& graph, const std::vector<std::string>& settings) {
  for (const auto& setting : settings) {
    const std::size_t dot = setting.find('.');
    const std::size_t equals = setting.find('=');
    if (dot == std::string::npos || equals == std::string::npos || dot > equals)
      throw ParameterError("--param '" + setting + "' is not of the form STAGE.NAME=VALUE");
    const std::string stage = setting.substr(0, dot);
    const std::string name = setting.substr(dot + 1, equals - dot - 1);
    const graph::StageNode* node = graph.stage(stage);
    if (node == nullptr) {
      std::vector<std::string> names;
      for (const auto& other : graph.stages) names.push_back(other.name);
      throw ParameterError("--param: there is no stage '" + stage + "'" +
                           did_you_mean(stage, names));
    }
    const graph::StageInfo info = graph::info_of(node->use, stage_table().at(node->use));
    std::vector<std::string> value{setting.substr(equals + 1)};
    if (const Field* field = find(info.parameters, name);
        field != nullptr && field->type == FieldType::list)
      value = CLI::detail::split(value[0], ',');
    try {
      set_field(info.parameters, name, value);
    } catch (const ParameterError& error) {
      throw ParameterError("--param " + stage + "." + error.what());
    }
    graph::set_param(graph, stage, name, value);
  }
}

void require_sound(const graph::GraphDescription& graph) {
  std::vector<graph::Fault> faults = graph::check(graph, graph::catalog_of(stage_table()));
  if (!faults.empty()) throw graph::GraphError(std::move(faults));
}

graph::RunReport run_and_report(graph::GraphDescription graph,
                                const std::vector<std::string>& settings, const Where& where,
                                bool json) {
  apply_overrides(graph, settings);
  require_sound(graph);
  const graph::RunReport report = run_graph(graph, where);
  print_report(report, graph, json);
  return report;
}

}  // namespace cosegraph::tools
