// monitor: looking at a running graph, or at files, in a browser.
#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>
#include <random>
#include <thread>

#include "graph/process.hpp"
#include "graph/runs.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/stop_signals.hpp"
#include "tools/monitor/file_feed.hpp"
#include "tools/monitor/graph_feed.hpp"
#include "tools/monitor/recording_feed.hpp"
#include "tools/monitor/server.hpp"

namespace cosegraph::tools {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

struct MonitorArguments {
  std::vector<std::string> what;
  std::string instance;
  bool read_only = false;
  std::uint64_t from = 0;
  bool spectrum = false;
  monitor::ServerOptions server;
};

fs::path page_folder() {
  return fs::read_symlink("/proc/self/exe").parent_path().parent_path() / "share" / "cosegraph" /
         "web";
}

std::string random_token() {
  std::random_device entropy;
  char text[33];
  std::snprintf(text, sizeof text, "%08x%08x%08x%08x", entropy(), entropy(), entropy(), entropy());
  return text;
}

bool is_run(const std::string& name) {
  return std::ranges::any_of(graph::live_runs(),
                             [&](const graph::Run& run) { return run.graph == name; });
}

// The run of `graph` that somebody started after the one that was shown; none: no value.
std::optional<graph::GraphDescription> newer_run(const graph::GraphDescription& shown) {
  for (const auto& run : graph::live_runs())
    if (run.graph == shown.graph && run.instance != shown.instance)
      return graph::find_run({.graph = run.graph, .instance = run.instance});
  return std::nullopt;
}

// Shows the graph until it is asked to stop; when the run ends, the next one of the same graph.
void show_graph(monitor::Server& server, graph::GraphDescription graph, bool any_instance,
                bool read_only, const StopSignals& signals) {
  const graph::Catalog catalog = graph::catalog_of(stage_table());
  monitor::GraphFeed* feed = nullptr;  // of the server
  const auto show = [&] {
    auto next = std::make_unique<monitor::GraphFeed>(graph, catalog, !read_only);
    feed = next.get();
    server.show(std::move(next));
  };
  show();
  while (!signals.asked()) {
    std::this_thread::sleep_for(200ms);
    const auto runs = graph::live_runs();
    const bool lives = std::ranges::any_of(runs, [&](const graph::Run& run) {
      return run.graph == graph.graph && run.instance == graph.instance;
    });
    if (lives) continue;
    // Without an instance it is run by agents, perhaps on other hosts.
    if (!graph.instance.empty()) feed->end();
    if (!any_instance) continue;
    if (auto newer = newer_run(graph)) {
      graph = std::move(*newer);
      show();
    }
  }
}

std::unique_ptr<monitor::Feed> open_files(const MonitorArguments& arguments) {
  const auto is_recording = [](const std::string& path) {
    return fs::path(path).extension() == ".mcap";
  };
  if (std::ranges::none_of(arguments.what, is_recording))
    return std::make_unique<monitor::FileFeed>(arguments.what, arguments.spectrum);
  if (arguments.what.size() > 1)
    throw ParameterError("one recording, or any number of other files, can be looked at");
  return std::make_unique<monitor::RecordingFeed>(arguments.what[0], arguments.from);
}

void print_address(const monitor::Server& server, const monitor::ServerOptions& options) {
  const std::string authority =
      (options.host.find(':') == std::string::npos ? options.host : "[" + options.host + "]") +
      ":" + std::to_string(server.port());
  const std::string query = options.access.token.empty() ? "" : "/?token=" + options.access.token;
  if (server.has_page())
    std::cout << "http://" << authority << query << '\n';
  else
    std::cout << "the page was not built (it needs npm when cosegraph is built)\n";
  std::cout << "ws://" << authority << query << "  for Foxglove\n" << std::flush;
}

int run_monitor(MonitorArguments arguments) {
  const std::string& first = arguments.what.front();
  monitor::ServerOptions& options = arguments.server;
  if (!monitor::is_loopback(options.host) && options.access.token.empty())
    options.access.token = random_token();
  options.page = page_folder();
  const StopSignals signals;
  const bool is_graph = is_run(first) || !monitor::is_viewable(first);
  if (is_graph && arguments.what.size() > 1)
    throw ParameterError("one graph, or any number of files, can be looked at");
  if (!is_graph) {
    auto feed = open_files(arguments);
    monitor::Server server(options);
    server.show(std::move(feed));
    print_address(server, options);
    while (!signals.asked()) std::this_thread::sleep_for(100ms);
    return 0;
  }
  graph::give_way();
  graph::GraphDescription graph = graph::find_run({.graph = first, .instance = arguments.instance});
  monitor::Server server(options);
  print_address(server, options);
  show_graph(server, std::move(graph), arguments.instance.empty(), arguments.read_only, signals);
  return 0;
}

}  // namespace

void add_monitor_command(CLI::App& app, const Choose& choose) {
  auto* command = app.add_subcommand(
      "monitor", "Shows a running graph, or files, as a web page and to Foxglove");
  auto arguments = std::make_shared<MonitorArguments>();
  arguments->server.port = 8765;
  command
      ->add_option("what", arguments->what,
                   "a running graph (its file or name), a recording, or clouds, meshes, models")
      ->required();
  command->add_option("--instance", arguments->instance, "which run, if there are several");
  command->add_option("--port", arguments->server.port, "0: any that is free")
      ->capture_default_str();
  command
      ->add_option("--host", arguments->server.host,
                   "address to listen at; another than this machine's own needs a token, which "
                   "is made if --token gives none")
      ->capture_default_str();
  command->add_option("--token", arguments->server.access.token,
                      "word that clients must know, as .../?token=WORD");
  command->add_option("--from", arguments->from,
                      "frame of a recording to show first, counted from 0");
  command->add_flag("--spectrum", arguments->spectrum,
                    "compute the spectra of clouds, as the model beside them was trained with");
  command->add_flag("--read-only", arguments->read_only, "offer no swaps of stages");
  command
      ->add_option("--origin", arguments->server.access.origins,
                   "pages of other servers that may connect without a token, as "
                   "https://app.foxglove.dev; may be repeated")
      ->take_all();
  command->footer(
      "Example:\n"
      "  cosegraph monitor segment.yaml\n"
      "  cosegraph monitor run.mcap\n"
      "  cosegraph monitor out/*.ply mug.coseg --spectrum");
  command->callback([=] { choose([=] { return run_monitor(*arguments); }); });
}

}  // namespace cosegraph::tools
