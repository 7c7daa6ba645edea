#include <iostream>
#include <memory>

#include "graph/description.hpp"
#include "io/file.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/keys/key_folder.hpp"

namespace cosegraph::tools {
namespace {

struct KeysArguments {
  std::string file;
  std::string folder;
  std::vector<std::string> names;
  int days = 365;
};

graph::Catalog catalog() {
  return graph::catalog_of(stage_table());
}

// How the graph file is to name the folder.
std::string as_seen_from(const std::string& file, const std::string& folder) {
  namespace fs = std::filesystem;
  const fs::path from = fs::absolute(file).lexically_normal().parent_path();
  const fs::path to = fs::absolute(fs::path(folder) / "").lexically_normal().parent_path();
  const std::string relative = to.lexically_relative(from).string();
  return relative.starts_with("..") ? to.string() : relative;
}

// The graph without regard to the keys that it names: they are yet to be made.
graph::GraphDescription load_graph(const std::string& file, std::string& folder) {
  std::vector<graph::Fault> faults;
  graph::GraphDescription graph = graph::parse(io::read_file(file), file, faults);
  if (faults.empty()) {
    if (folder.empty() && !graph.dds.security.empty())
      folder = (std::filesystem::path(file).parent_path() / graph.dds.security).string();
    graph.dds.security.clear();
    faults = graph::check(graph, catalog());
  }
  if (!faults.empty()) throw graph::GraphError(std::move(faults));
  return graph;
}

int init(KeysArguments arguments) {
  const graph::GraphDescription graph = load_graph(arguments.file, arguments.folder);
  if (arguments.folder.empty())
    throw ParameterError("-o is needed, as " + arguments.file + " names no folder of keys");
  keys::init(graph, catalog(), arguments.folder, keys::from_now(arguments.days));
  std::cout << arguments.folder << ": keys of " << graph.stages.size()
            << " stages, observer and agent, for " << arguments.days << " days\n"
            << "the graph file uses them with   dds: {security: "
            << as_seen_from(arguments.file, arguments.folder) << "}\n";
  return 0;
}

int issue(KeysArguments arguments) {
  const graph::GraphDescription graph = load_graph(arguments.file, arguments.folder);
  for (const auto& name : keys::issue(graph, catalog(), arguments.folder, arguments.names,
                                      keys::from_now(arguments.days)))
    std::cout << name << '\n';
  return 0;
}

void add_days(CLI::App& command, const std::shared_ptr<KeysArguments>& arguments) {
  command.add_option("--days", arguments->days, "how long the certificates are valid")
      ->check(CLI::Range(1, 3650))
      ->capture_default_str();
}

}  // namespace

void add_keys_command(CLI::App& app, const Choose& choose) {
  auto* keys = app.add_subcommand("keys", "Makes the keys of a graph with dds: {security: DIR}");
  keys->require_subcommand(1);
  keys->footer(
      "Example:\n  cosegraph keys init segment.yaml -o keys\n"
      "  cosegraph keys issue segment.yaml keys svm astar");

  auto* make = keys->add_subcommand("init", "Makes authorities and the keys of all stages");
  auto arguments = std::make_shared<KeysArguments>();
  make->add_option("graph", arguments->file, "graph file")->required();
  make->add_option("-o,--output", arguments->folder,
                   "folder to make; by default the one that the graph file names");
  add_days(*make, arguments);
  make->footer("Example:\n  cosegraph keys init segment.yaml -o keys");
  make->callback([=] { choose([=] { return init(*arguments); }); });

  auto* renew = keys->add_subcommand("issue", "Makes new keys for stages: all, or those named");
  auto renewed = std::make_shared<KeysArguments>();
  renew->add_option("graph", renewed->file, "graph file")->required();
  renew->add_option("folder", renewed->folder, "folder that 'keys init' has made")->required();
  renew->add_option("stages", renewed->names, "stages, 'observer', 'agent'; by default all");
  add_days(*renew, renewed);
  renew->footer(
      "After the graph was changed, before certificates expire, or when a key may be known to "
      "others.\nExample:\n  cosegraph keys issue segment.yaml keys\n"
      "  cosegraph keys issue segment.yaml keys svm observer --days 30");
  renew->callback([=] { choose([=] { return issue(*renewed); }); });
}

}  // namespace cosegraph::tools
