#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "graph/description.hpp"
#include "io/file.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/durations.hpp"
#include "tools/cosegraph/hosts.hpp"
#include "tools/cosegraph/run_graph.hpp"
#include "tools/cosegraph/watching.hpp"

namespace cosegraph::tools {
namespace {

namespace fs = std::filesystem;

graph::Catalog catalog() {
  return graph::catalog_of(stage_table());
}

// -- check, draw
// -----------------------------------------------------------------------------------

int check_graph(const std::string& file) {
  const graph::GraphDescription graph = graph::load(file, catalog());
  std::size_t edges = 0;
  for (const auto& stage : graph.stages) edges += stage.inputs.size();
  std::cout << file << ": fine, " << graph.stages.size() << " stages, " << edges << " edges\n";
  return 0;
}

// Renders Graphviz source as `format` with the `dot` program.
std::string render_dot(const std::string& dot, const std::string& format) {
  const io::TemporaryFolder folder;
  io::write_file(folder / "graph.dot", dot);
  std::string type = "-T" + format;
  std::string output = "-o" + (folder / "picture").string();
  std::string input = (folder / "graph.dot").string();
  std::string program = "dot";
  char* const arguments[] = {program.data(), type.data(), output.data(), input.data(), nullptr};
  pid_t pid = 0;
  if (::posix_spawnp(&pid, "dot", nullptr, nullptr, arguments, environ) != 0)
    throw Error("cannot run 'dot': install graphviz, or draw to a .dot file");
  int status = 0;
  ::waitpid(pid, &status, 0);
  if (status != 0) throw Error("'dot' failed");
  return io::read_file(folder / "picture");
}

void write_drawing(const std::string& dot, const std::string& output) {
  const std::string format = fs::path(output).extension().string();
  if (format == ".dot")
    io::write_file(output, dot);
  else if (format == ".svg" || format == ".png" || format == ".pdf")
    io::write_file(output, render_dot(dot, format.substr(1)));
  else
    throw ParameterError("-o " + output + ": the extension must be .svg, .png, .pdf or .dot");
}

int draw_graph(const std::string& file, const std::string& output) {
  const graph::Catalog known = catalog();
  write_drawing(graph::to_dot(graph::load(file, known), known), output);
  return 0;
}

struct LiveDrawing {
  Watched watched;
  std::string output;
  bool live = false;
  double every = 0.0;  // s; 0: once
};

// Draws a running graph, again and again if so wanted.
int draw_running(const LiveDrawing& drawing) {
  const graph::GraphDescription graph = drawing.watched.find();
  const graph::Catalog known = catalog();
  const StopSignals signals;
  graph::Observer observer(graph);
  do {
    const graph::Overlay overlay =
        overlay_of(graph, look_twice(observer, graph, drawing.watched.patience()));
    if (overlay.stages.empty())
      throw Error("graph '" + graph.graph + "': no stage is heard; see 'cosegraph doctor'");
    write_drawing(graph::to_dot(graph, known, &overlay), drawing.output);
  } while (drawing.every > 0.0 &&
           pause(signals, std::chrono::milliseconds(static_cast<long>(1000 * drawing.every))));
  return 0;
}

// -- run, up
// ---------------------------------------------------------------------------------------

struct RunArguments {
  std::string file;
  std::vector<std::string> params;
  bool json = false;
  Where where;
};

// Of a graph that names hosts `up` runs one host's part: the one that is asked for, or the one
// whose address this machine has.
int run(RunArguments arguments) {
  const graph::GraphDescription graph = graph::load(arguments.file, catalog());
  if (!arguments.where.one_process) arguments.where.host = host_here(graph, arguments.where.host);
  return run_and_report(graph, arguments.params, arguments.where, arguments.json).fine() ? 0 : 1;
}

// -- stages ---------------------------------------------------------------------------------------

const char* type_text(FieldType type) {
  switch (type) {
    case FieldType::boolean:
      return "boolean";
    case FieldType::integer:
      return "integer";
    case FieldType::number:
      return "number";
    case FieldType::text:
      return "text";
    case FieldType::choice:
      return "choice";
    case FieldType::list:
      return "list";
  }
  return "";
}

std::string bounds_text(const Field& field) {
  char text[64];
  if (field.type == FieldType::integer || field.type == FieldType::number) {
    std::snprintf(text, sizeof text, "%g .. %g", field.min, field.max);
    return text;
  }
  std::string all;
  for (const auto& choice : field.choices) all += (all.empty() ? "" : " | ") + choice;
  return all;
}

nlohmann::ordered_json ports_json(const std::vector<graph::PortInfo>& ports) {
  nlohmann::ordered_json result = nlohmann::ordered_json::array();
  for (const auto& port : ports)
    result.push_back({{"name", port.name},
                      {"type", port.type},
                      {"latched", port.latched},
                      {"optional", port.optional},
                      {"doc", port.doc}});
  return result;
}

nlohmann::ordered_json stages_json() {
  nlohmann::ordered_json result = nlohmann::ordered_json::array();
  for (const auto& [kind, describe] : catalog()) {
    const graph::StageInfo info = describe();
    nlohmann::ordered_json params = nlohmann::ordered_json::array();
    for (const auto& field : info.parameters) {
      nlohmann::ordered_json param{{"name", field.name},
                                   {"type", type_text(field.type)},
                                   {"unit", field.unit},
                                   {"doc", field.doc}};
      if (field.type == FieldType::list)
        param["default"] = field.get();
      else
        param["default"] = field.text();
      if (field.type == FieldType::integer || field.type == FieldType::number) {
        param["min"] = field.min;
        param["max"] = field.max;
      }
      if (!field.choices.empty()) param["choices"] = field.choices;
      params.push_back(std::move(param));
    }
    result.push_back({{"kind", kind},
                      {"summary", info.summary},
                      {"inputs", ports_json(info.inputs)},
                      {"outputs", ports_json(info.outputs)},
                      {"parameters", std::move(params)}});
  }
  return result;
}

void print_ports(const char* direction, const std::vector<graph::PortInfo>& ports) {
  for (const auto& port : ports) {
    const std::string notes =
        std::string(port.latched ? ", latched" : "") + (port.optional ? ", optional" : "");
    std::printf("  %-6s %-14s %s%s: %s\n", direction, port.name.c_str(), port.type.c_str(),
                notes.c_str(), port.doc.c_str());
  }
}

void print_stage(const graph::StageInfo& info) {
  std::printf("%s: %s\n", info.kind.c_str(), info.summary.c_str());
  print_ports("in", info.inputs);
  print_ports("out", info.outputs);
  for (const auto& field : info.parameters) {
    const std::string bounds = bounds_text(field);
    std::printf(
        "  param  %s = %s%s%s%s\n           %s\n", field.name.c_str(),
        field.type == FieldType::list ? ("[" + field.text() + "]").c_str() : field.text().c_str(),
        field.unit.empty() ? "" : (" " + field.unit).c_str(), bounds.empty() ? "" : "  in ",
        bounds.c_str(), field.doc.c_str());
  }
}

int list_stages(const std::string& kind, bool json, bool schema) {
  if (schema) {
    std::cout << graph::json_schema(catalog()) << '\n';
    return 0;
  }
  if (json) {
    std::cout << stages_json().dump(2) << '\n';
    return 0;
  }
  const graph::Catalog known = catalog();
  if (!kind.empty() && !known.contains(kind)) {
    std::vector<std::string> kinds;
    for (const auto& [name, describe] : known) kinds.push_back(name);
    throw ParameterError("there is no stage '" + kind + "'" + did_you_mean(kind, kinds));
  }
  for (const auto& [name, describe] : known)
    if (kind.empty() || kind == name) print_stage(describe());
  return 0;
}

}  // namespace

void add_graph_commands(CLI::App& app, const Choose& choose) {
  auto* check = app.add_subcommand("check", "Checks a graph file and reports every fault in it");
  auto file = std::make_shared<std::string>();
  check->add_option("graph", *file, "graph file")->required();
  check->footer("Example:\n  cosegraph check config/graphs/segment.yaml");
  check->callback([=] { choose([=] { return check_graph(*file); }); });

  auto* draw = app.add_subcommand("draw", "Draws a graph file with Graphviz");
  auto drawing = std::make_shared<LiveDrawing>();
  draw->add_option("graph", *file, "graph file, or with --live name of a running graph")
      ->required();
  draw->add_option("-o,--output", drawing->output, "picture: .svg, .png, .pdf or .dot")->required();
  auto* live = draw->add_flag("--live", drawing->live,
                              "as it runs: states, rates and counts of stages and edges");
  takes_seconds(
      draw->add_option("--every", drawing->every, "draw again after so long, until Ctrl-C"), 0.1,
      3600.0)
      ->needs(live);
  draw->add_option("--instance", drawing->watched.instance, "which of several runs of it")
      ->needs(live);
  add_timeout(*draw, drawing->watched, 3.0, "how long to wait for stages that are not heard");
  draw->footer(
      "Example:\n  cosegraph draw config/graphs/segment.yaml -o segment.svg\n"
      "  cosegraph draw segment --live --every 1 -o live.svg");
  draw->callback([=] {
    choose([=] {
      drawing->watched.graph = *file;
      return drawing->live ? draw_running(*drawing) : draw_graph(*file, drawing->output);
    });
  });

  const auto add_run = [&](const char* name, const char* what, bool one_process) {
    auto* command = app.add_subcommand(name, what);
    auto arguments = std::make_shared<RunArguments>();
    arguments->where.one_process = one_process;
    if (!one_process) {
      command->add_option("--host", arguments->where.host,
                          "of a graph with hosts: the one whose stages run here");
      command->add_flag("--allow-exec", arguments->where.allow_exec,
                        "run programs of the graph that stand outside its folder");
    }
    command->add_option("graph", arguments->file, "graph file")->required();
    command->add_option("--param", arguments->params, "STAGE.NAME=VALUE, may be repeated")
        ->take_all();
    command->add_flag("--json", arguments->json, "the report as JSON");
    command->footer(std::string("Example:\n  cosegraph ") + name +
                    " segment.yaml --param source.path=queries --param sink.folder=out");
    command->callback([=] { choose([=] { return run(*arguments); }); });
  };
  add_run("run", "Runs a graph in this process, one DDS participant per stage", true);
  add_run("up", "Runs a graph, or one host's part of it, as a process per stage", false);

  auto* stages = app.add_subcommand("stages", "Lists stages with ports, parameters and defaults");
  auto kind = std::make_shared<std::string>();
  auto json = std::make_shared<bool>(false);
  auto schema = std::make_shared<bool>(false);
  stages->add_option("kind", *kind, "only this one");
  stages->add_flag("--json", *json, "as JSON");
  stages->add_flag("--schema", *schema, "the JSON schema of graph files, for editors");
  stages->footer("Example:\n  cosegraph stages descriptors");
  stages->callback([=] { choose([=] { return list_stages(*kind, *json, *schema); }); });
}

}  // namespace cosegraph::tools
