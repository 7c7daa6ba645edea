// A graph on many hosts: its agents, and orders to them.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "graph/agent.hpp"
#include "graph/control.hpp"
#include "graph/remote.hpp"
#include "graph/runs.hpp"
#include "graph/swap.hpp"
#include "tools/account_json.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/hosts.hpp"
#include "tools/cosegraph/run_graph.hpp"
#include "tools/cosegraph/stop_signals.hpp"
#include "tools/cosegraph/watching.hpp"

namespace cosegraph::tools {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

constexpr auto kSilentAfter = 1s;

// For agents to be heard; those with keys take longer to meet.
std::chrono::milliseconds patience_with(const graph::GraphDescription& graph) {
  return graph.dds.security.empty() ? 2s : 10s;
}

// What every command about a running graph is told.
struct Target {
  std::string graph;
  std::string instance;
  bool json = false;

  graph::GraphDescription find() const { return graph::find_run({graph, instance}); }
};

void add_target(CLI::App& command, Target& target) {
  command.add_option("-g,--graph", target.graph,
                     "graph file, or name of a running graph; the only one that runs here if it "
                     "is left out");
  command.add_option("--instance", target.instance, "which of several runs of it");
}

// -- agent ---------------------------------------------------------------------------------------

struct AgentArguments {
  std::string file;
  std::string host;
  bool allow_exec = false;
};

int run_agent(const AgentArguments& arguments) {
  const graph::Catalog catalog = graph::catalog_of(stage_table());
  const graph::GraphDescription graph = graph::load(arguments.file, catalog);
  const StopSignals signals;
  graph::Agent agent(graph, catalog,
                     {.host = host_here(graph, arguments.host),
                      .executables = executable_folder(),
                      .allow_exec = arguments.allow_exec,
                      .detached = true,
                      .on_output = [](const std::string& stage, const std::string& line) {
                        std::cerr << "[" << stage << "] " << line << std::endl;
                      }});
  if (agent.adopted() > 0)
    std::cerr << "took over " << agent.adopted()
              << " processes that run already; the graph is as they were started with\n";
  while (!agent.is_down() && !signals.asked()) agent.step(50ms);
  return 0;
}

// -- ps ------------------------------------------------------------------------------------------

struct Row {
  std::string process;
  graph::Observed now;
  double cpu = 0.0;  // cores
};

double seconds_since(Clock::time_point time) {
  return std::chrono::duration<double>(Clock::now() - time).count();
}

// Two looks at every process, so that its use of the CPU can be told.
std::vector<Row> look(graph::Remote& remote, const graph::GraphDescription& graph) {
  remote.agents(patience_with(graph));
  const auto patience = graph.dds.security.empty() ? 1500ms : 4s;
  const Looks looks = look_twice(remote.observer(), graph, patience);
  const auto loads = graph::loads_of(looks.before, looks.now);
  std::vector<Row> rows;
  for (const auto& [name, seen] : looks.now)
    rows.push_back({.process = name, .now = seen, .cpu = loads.at(name).cpu});
  return rows;
}

// How a message gets from one process to the other.
std::string via(const graph::Observed& from, const graph::Observed& to) {
  if (from.status.host != to.status.host) return "UDP between hosts";
  return from.status.pid == to.status.pid ? "within a process" : "UDP within a host";
}

struct Edge {
  std::string from;
  std::string to;
  std::string via;
};

std::vector<Edge> edges_of(const graph::GraphDescription& graph, const std::vector<Row>& rows) {
  std::vector<Edge> result;
  for (const auto& to : rows) {
    const graph::StageNode* node = graph.stage(to.now.header.stage);
    if (node == nullptr) continue;
    for (const auto& input : node->inputs)
      for (const auto& from : rows)
        if (from.now.header.stage == input.from_stage)
          result.push_back({from.process + "/" + input.from_port, to.process + "/" + input.port,
                            via(from.now, to.now)});
  }
  return result;
}

Json ps_json(const graph::GraphDescription& graph,
             const std::map<std::string, graph::ObservedAgent>& agents,
             const std::vector<Row>& rows) {
  Json hosts = Json::array();
  for (const auto& [host, agent] : agents)
    hosts.push_back({{"host", host},
                     {"address", agent.status.address},
                     {"pid", agent.status.pid},
                     {"heard_seconds_ago", seconds_since(agent.heard)}});
  Json processes = Json::array();
  Json accounts;
  for (const auto& row : rows) {
    const idl::StageStatus& status = row.now.status;
    if (const auto& account = status.account; account.admitted + account.dropped > 0)
      accounts = account_json(account);
    processes.push_back({{"process", row.process},
                         {"kind", status.kind},
                         {"host", status.host},
                         {"pid", status.pid},
                         {"generation", row.now.header.generation},
                         {"state", to_name(status.state)},
                         {"activity", status.activity},
                         {"heard_seconds_ago", seconds_since(row.now.heard)},
                         {"frames", status.frames_out},
                         {"failed", status.frames_failed},
                         {"repeated", status.repeated},
                         {"queue", status.queue},
                         {"ms_median", status.latency_median},
                         {"ms_p99", status.latency_p99},
                         {"cpu", row.cpu},
                         {"memory", status.memory}});
  }
  Json edges = Json::array();
  for (const auto& edge : edges_of(graph, rows))
    edges.push_back({{"from", edge.from}, {"to", edge.to}, {"via", edge.via}});
  return {{"graph", graph.graph}, {"instance", graph.instance}, {"agents", hosts},
          {"account", accounts},  {"processes", processes},     {"edges", edges}};
}

void print_account(const std::vector<Row>& rows) {
  for (const auto& row : rows) {
    const idl::Account& account = row.now.status.account;
    const std::uint64_t over = account.labelled + account.consumed + account.failed;
    if (account.admitted + account.dropped == 0) continue;
    std::cout << "admitted " << account.admitted << " = labelled " << account.labelled
              << " + consumed " << account.consumed << " + failed " << account.failed
              << " + in flight " << account.admitted - over << "; dropped " << account.dropped
              << '\n';
  }
}

void print_rows(const std::vector<Row>& rows) {
  std::printf("%-16s %-12s %-10s %7s %4s %-22s %8s %6s %6s %9s %9s %5s %7s\n", "STAGE", "KIND",
              "HOST", "PID", "GEN", "STATE", "FRAMES", "FAILED", "QUEUE", "MS p50", "MS p99", "CPU",
              "MEMORY");
  for (const auto& row : rows) {
    const idl::StageStatus& status = row.now.status;
    std::printf("%-16s %-12s %-10s %7u %4u %-22s %8llu %6llu %6llu %9.1f %9.1f %4.0f%% %4llu MB\n",
                row.process.c_str(), status.kind.c_str(), status.host.c_str(), status.pid,
                row.now.header.generation, state_text(row.now).c_str(),
                static_cast<unsigned long long>(status.frames_out),
                static_cast<unsigned long long>(status.frames_failed),
                static_cast<unsigned long long>(status.queue), status.latency_median,
                status.latency_p99, 100.0 * row.cpu,
                static_cast<unsigned long long>(status.memory >> 20U));
    if (!status.activity.empty()) std::printf("%-16s   %s\n", "", status.activity.c_str());
  }
}

int list_processes(const Target& target, bool edges) {
  if (target.graph.empty() && target.instance.empty() && graph::live_runs().empty()) {
    if (target.json)
      std::cout << "[]\n";
    else
      std::cout << "no graph runs on this machine; for one that runs elsewhere: --graph FILE\n";
    return 0;
  }
  const graph::GraphDescription graph = target.find();
  graph::Remote remote(graph);
  const std::vector<Row> rows = look(remote, graph);
  const auto agents = remote.agents(0ms);
  if (target.json) {
    std::cout << ps_json(graph, agents, rows).dump(2) << '\n';
    return 0;
  }
  std::cout << "graph " << graph.graph
            << (graph.instance.empty() ? "" : ", instance " + graph.instance) << '\n';
  for (const auto& host : graph.hosts) {
    const auto agent = agents.find(host.name);
    if (agent == agents.end())
      std::cout << "no agent answers for host " << host.name << " (" << host.address << ")\n";
    else if (Clock::now() - agent->second.heard > kSilentAfter)
      std::cout << "the agent of host " << host.name << " is silent\n";
  }
  print_rows(rows);
  print_account(rows);
  if (edges)
    for (const auto& edge : edges_of(graph, rows))
      std::printf("%-28s -> %-28s %s\n", edge.from.c_str(), edge.to.c_str(), edge.via.c_str());
  return 0;
}

// -- orders --------------------------------------------------------------------------------------

std::map<std::string, graph::ObservedAgent> require_agents(graph::Remote& remote,
                                                           const graph::GraphDescription& graph) {
  auto agents = remote.agents(patience_with(graph));
  if (agents.empty())
    throw Error("no agent of graph '" + graph.graph +
                "' answers; 'cosegraph agent' and 'cosegraph up' are agents, 'cosegraph run' is "
                "not");
  return agents;
}

int order_stage(const Target& target, std::string_view verb, const std::string& stage) {
  const graph::GraphDescription graph = target.find();
  require_stage(graph, stage);
  graph::Remote remote(graph);
  const auto agents = require_agents(remote, graph);
  const auto hosts = graph::hosts_of(*graph.stage(stage));
  bool any = false;
  for (const auto& [host, agent] : agents) {
    if (!graph.hosts.empty() && std::ranges::find(hosts, host) == hosts.end()) continue;
    any = true;
    const std::string text =
        remote.order({.host = host, .stage = stage, .verb = std::string(verb)}, 15s);
    if (!text.empty()) std::cerr << stage << ": " << text << '\n';
  }
  if (!any) throw Error("no agent answers for the host of stage '" + stage + "'");
  return 0;
}

int take_down(const Target& target) {
  const graph::GraphDescription graph = target.find();
  graph::Remote remote(graph);
  const auto agents = require_agents(remote, graph);
  // The host of the source first, so that nothing new is admitted.
  std::vector<std::string> hosts;
  const std::string source = graph::source_of(graph, graph::catalog_of(stage_table())).name;
  for (const auto& [host, agent] : agents) hosts.push_back(host);
  const auto first = graph::hosts_running(agents, source);
  std::ranges::stable_partition(hosts, [&](const std::string& host) {
    return std::ranges::find(first, host) != first.end();
  });
  for (const auto& host : hosts)
    remote.order({.host = host, .verb = std::string(graph::verb::kDown)}, 30s);
  return 0;
}

int follow_logs(const Target& target, const std::string& stage, bool follow) {
  const graph::GraphDescription graph = target.find();
  if (!stage.empty()) require_stage(graph, stage);
  const StopSignals signals;
  graph::Remote remote(graph);
  require_agents(remote, graph);
  const auto take = [&](const idl::LogLines& log) {
    if (!stage.empty() && log.stage != stage) return true;
    for (const auto& line : log.lines)
      std::cout << (log.host.empty() ? "" : log.host + " ") << "[" << log.stage
                << (log.replica > 0 ? "." + std::to_string(log.replica) : "") << "] " << line
                << std::endl;
    return true;
  };
  do remote.logs(take, follow ? 200ms : 1000ms);
  while (follow && !signals.asked());
  return 0;
}

struct SwapArguments {
  Target target;
  std::string stage;
  graph::Replacement replacement;
};

int swap_stage(SwapArguments arguments) {
  const graph::GraphDescription graph = arguments.target.find();
  require_stage(graph, arguments.stage);
  std::string& program = arguments.replacement.exec;
  if (!program.empty()) program = std::filesystem::absolute(program).string();
  graph::Remote remote(graph);
  require_agents(remote, graph);
  const std::string report = graph::order_swap(
      remote, graph, graph::source_of(graph, graph::catalog_of(stage_table())).name,
      arguments.stage, arguments.replacement,
      [](const std::string& progress) { std::cerr << progress << '\n'; });
  if (arguments.target.json) {
    std::cout << report << '\n';
    return 0;
  }
  const Json json = Json::parse(report);
  const auto number = [&](const char* key) { return json.value(key, 0.0); };
  if (arguments.replacement.dry_run) {
    std::printf("%s: the newcomer would be ready, after %.0f ms; nothing was changed\n",
                arguments.stage.c_str(), number("took_ms"));
    return 0;
  }
  std::printf("%s: generation %.0f -> %.0f in %.0f ms\n", arguments.stage.c_str(),
              number("from_generation"), number("to_generation"), number("took_ms"));
  std::printf("frames admitted meanwhile %.0f, done %.0f, failed %.0f, lost %.0f, doubled %.0f\n",
              number("admitted"), number("done"), number("failed"), number("lost"),
              number("doubled"));
  std::printf("longest interval at the outputs %.1f ms, usually %.1f ms\n", number("pause_ms"),
              number("usual_ms"));
  return number("lost") + number("doubled") > 0 ? 1 : 0;
}

}  // namespace

void add_agent_commands(CLI::App& app, const Choose& choose) {
  auto* agent = app.add_subcommand(
      "agent", "Runs one host's part of a graph until it is taken down, and obeys orders");
  auto agent_arguments = std::make_shared<AgentArguments>();
  agent->add_option("graph", agent_arguments->file, "graph file")->required();
  agent->add_option("--host", agent_arguments->host,
                    "host of the graph file; the one with this machine's address if left out");
  agent->add_flag("--allow-exec", agent_arguments->allow_exec,
                  "run programs of the graph that stand outside its folder");
  agent->footer(
      "Ctrl-C and SIGTERM stop the host's stages. If the agent is killed its stages go on, and\n"
      "the next agent takes them over.\n"
      "Example, on each host:\n  cosegraph agent --host rack segment.yaml");
  agent->callback([=] { choose([=] { return run_agent(*agent_arguments); }); });

  auto* ps = app.add_subcommand("ps", "Shows the processes of a running graph on all hosts");
  auto target = std::make_shared<Target>();
  auto edges = std::make_shared<bool>(false);
  ps->add_option("graph,-g,--graph", target->graph, "graph file, or name of a running graph");
  ps->add_option("--instance", target->instance, "which of several runs of it");
  ps->add_flag("--edges", *edges, "how messages get from stage to stage");
  ps->add_flag("--json", target->json, "as JSON");
  ps->footer("Example:\n  cosegraph ps segment.yaml --edges");
  ps->callback([=] { choose([=] { return list_processes(*target, *edges); }); });

  const auto add_order = [&](std::string_view verb, const char* what) {
    auto* command = app.add_subcommand(std::string(verb), what);
    auto stage = std::make_shared<std::string>();
    auto of = std::make_shared<Target>();
    command->add_option("stage", *stage, "stage of the graph")->required();
    add_target(*command, *of);
    command->footer("Example:\n  cosegraph " + std::string(verb) + " cpc --graph segment.yaml");
    command->callback([=] { choose([=] { return order_stage(*of, verb, *stage); }); });
  };
  add_order(graph::verb::kStart, "Starts a stage of a running graph that was stopped");
  add_order(graph::verb::kStop, "Stops a stage of a running graph; its frames wait");
  add_order(graph::verb::kRestart, "Starts a stage of a running graph anew");

  auto* logs = app.add_subcommand("logs", "Shows what stages of a running graph print");
  auto of_logs = std::make_shared<Target>();
  auto logged = std::make_shared<std::string>();
  auto follow = std::make_shared<bool>(false);
  logs->add_option("stage", *logged, "only of this stage");
  logs->add_flag("-f,--follow", *follow, "go on until Ctrl-C");
  add_target(*logs, *of_logs);
  logs->footer("Example:\n  cosegraph logs -f descriptors --graph segment.yaml");
  logs->callback([=] { choose([=] { return follow_logs(*of_logs, *logged, *follow); }); });

  auto* swap = app.add_subcommand("swap", "Replaces a stage while frames flow");
  auto arguments = std::make_shared<SwapArguments>();
  swap->add_option("stage", arguments->stage, "stage of the graph")->required();
  add_target(*swap, arguments->target);
  swap->add_option("--use", arguments->replacement.use, "another kind with the same ports");
  swap->add_option("--exec", arguments->replacement.exec, "a program of your own");
  swap->add_option("--host", arguments->replacement.host, "run it there from now on");
  swap->add_option("--param", arguments->replacement.params, "NAME=VALUE, may be repeated")
      ->take_all();
  swap->add_flag("--dry-run", arguments->replacement.dry_run,
                 "only try whether the newcomer gets ready");
  swap->add_flag("--json", arguments->target.json, "the report as JSON");
  swap->footer(
      "The newcomer is started beside the old one and takes over between two frames. If it fails\n"
      "the old one stays.\n"
      "Example:\n  cosegraph swap cpc --param min_segment_size=5\n"
      "  cosegraph swap model --param file=new.coseg");
  swap->callback([=] { choose([=] { return swap_stage(*arguments); }); });

  auto* down = app.add_subcommand("down", "Stops all of a graph on all hosts");
  auto of_down = std::make_shared<Target>();
  down->add_option("graph,-g,--graph", of_down->graph, "graph file, or name of a running graph");
  down->add_option("--instance", of_down->instance, "which of several runs of it");
  down->footer("Example:\n  cosegraph down segment.yaml");
  down->callback([=] { choose([=] { return take_down(*of_down); }); });
}

}  // namespace cosegraph::tools
