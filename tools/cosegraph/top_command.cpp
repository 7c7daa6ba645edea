// What every stage of a running graph is doing, redrawn while it runs.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "graph/process.hpp"
#include "tools/account_json.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/durations.hpp"
#include "tools/cosegraph/watching.hpp"

namespace cosegraph::tools {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

constexpr auto kOver = 5s;  // silence of all stages after which the run is over

struct Row {
  std::string process;
  graph::Observed seen;
  graph::Load load;
};

// In the order of the graph file.
std::vector<Row> rows_of(const graph::GraphDescription& graph, const Looks& looks) {
  const auto loads = graph::loads_of(looks.before, looks.now);
  std::vector<Row> rows;
  for (const auto& stage : graph.stages)
    for (std::uint32_t i = 0; i < graph::hosts_of(stage).size(); ++i) {
      const std::string process = graph::process_name(stage, i);
      if (const auto seen = looks.now.find(process); seen != looks.now.end())
        rows.push_back({process, seen->second, loads.at(process)});
    }
  return rows;
}

Json rows_json(const std::vector<Row>& rows) {
  Json stages = Json::array();
  Json account;
  for (const auto& row : rows) {
    const idl::StageStatus& status = row.seen.status;
    stages.push_back({{"stage", row.process},
                      {"kind", status.kind},
                      {"host", status.host},
                      {"pid", status.pid},
                      {"state", to_name(status.state)},
                      {"activity", status.activity},
                      {"heard_seconds_ago",
                       std::chrono::duration<double>(Clock::now() - row.seen.heard).count()},
                      {"frames", status.frames_out},
                      {"failed", status.frames_failed},
                      {"queue", status.queue},
                      {"ms_median", status.latency_median},
                      {"ms_p99", status.latency_p99},
                      {"hz", nullptr},
                      {"cpu", nullptr},
                      {"memory", status.memory}});
    if (row.load.span > 0.0) {
      stages.back()["hz"] = row.load.rate;
      stages.back()["cpu"] = row.load.cpu;
    }
    if (status.account.admitted > 0) account = account_json(status.account);
  }
  return {{"stages", stages}, {"account", account}};
}

std::string account_text(const std::vector<Row>& rows) {
  for (const auto& row : rows) {
    const idl::Account& account = row.seen.status.account;
    if (account.admitted == 0) continue;
    const std::uint64_t over = account.labelled + account.consumed + account.failed;
    std::ostringstream text;
    text << ": admitted " << account.admitted << " = labelled " << account.labelled
         << " + consumed " << account.consumed << " + failed " << account.failed << " + in flight "
         << account.admitted - std::min(over, account.admitted) << "; dropped " << account.dropped;
    return text.str();
  }
  return "";
}

std::string table_of(const graph::GraphDescription& graph, const std::vector<Row>& rows) {
  std::string text = "graph " + graph.graph +
                     (graph.instance.empty() ? "" : ", instance " + graph.instance) +
                     account_text(rows) + "\n";
  const auto add = [&](const char* format, auto... values) {
    char line[256];
    std::snprintf(line, sizeof line, format, values...);
    text += line;
  };
  add("%-16s %-10s %-22s %8s %6s %5s %7s %9s %9s %5s %8s\n", "STAGE", "HOST", "STATE", "FRAMES",
      "FAILED", "QUEUE", "HZ", "MS p50", "MS p99", "CPU", "MEMORY");
  for (const auto& row : rows) {
    const idl::StageStatus& status = row.seen.status;
    add("%-16s %-10s %-22s %8llu %6llu %5llu %7.2f %9.1f %9.1f %4.0f%% %8s\n", row.process.c_str(),
        status.host.c_str(), state_text(row.seen).c_str(),
        static_cast<unsigned long long>(status.frames_out),
        static_cast<unsigned long long>(status.frames_failed),
        static_cast<unsigned long long>(status.queue), row.load.rate, status.latency_median,
        status.latency_p99, 100.0 * row.load.cpu,
        bytes_text(static_cast<double>(status.memory)).c_str());
    if (!status.activity.empty()) text += "  " + status.activity + "\n";
  }
  return text;
}

bool is_over(const std::vector<Row>& rows) {
  return std::ranges::all_of(rows,
                             [](const Row& row) { return Clock::now() - row.seen.heard > kOver; });
}

int watch_stages(const Watched& watched, double every) {
  graph::give_way();
  const graph::GraphDescription graph = watched.find();
  const StopSignals signals;
  graph::Observer observer(graph);
  Looks looks = look_twice(observer, graph, watched.patience());
  if (looks.now.empty())
    throw Error("graph '" + graph.graph + "': no stage is heard; see 'cosegraph doctor'");
  const bool redraw = !watched.once && !watched.json && ::isatty(STDOUT_FILENO) == 1;
  for (;;) {
    const auto rows = rows_of(graph, looks);
    if (watched.json)
      std::cout << rows_json(rows).dump() << std::endl;
    else
      std::cout << (redraw ? "\x1b[H\x1b[J" : "") << table_of(graph, rows) << std::flush;
    if (watched.once) return 0;
    if (is_over(rows)) {
      std::cerr << "no stage is heard any more\n";
      return 0;
    }
    if (!pause(signals, std::chrono::milliseconds(static_cast<long>(1000 * every)))) return 0;
    looks.before = std::move(looks.now);
    looks.now = observer.stages();
  }
}

}  // namespace

void add_top_command(CLI::App& app, const Choose& choose) {
  auto* top = app.add_subcommand("top", "Shows what the stages of a running graph are doing");
  auto watched = std::make_shared<Watched>();
  auto every = std::make_shared<double>(1.0);
  add_watched(*top, *watched, "");
  add_once(*top, *watched, "one table, not redrawn");
  add_timeout(*top, *watched, 3.0, "how long to wait for all stages to be heard");
  takes_seconds(top->add_option("--every", *every, "between two tables"), 0.5, 3600.0)
      ->option_text("SECONDS [1]");
  top->footer(
      "CPU is that of the process, which stages of 'cosegraph run' share.\n"
      "Example:\n  cosegraph top segment.yaml\n  cosegraph top --once --json");
  top->callback([=] { choose([=] { return watch_stages(*watched, *every); }); });
}

}  // namespace cosegraph::tools
