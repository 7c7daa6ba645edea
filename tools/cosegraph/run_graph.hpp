// Runs graphs for the commands: signals, progress on stderr, the report at the end.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "graph/description.hpp"
#include "graph/run.hpp"

namespace cosegraph::tools {

// Where a graph runs: in this process, or in one per stage of `host` (empty: of all).
struct Where {
  bool one_process = true;
  std::string host;
  bool allow_exec = false;  // programs of graphs may stand anywhere
};

// Runs `graph` to the end of its stream; Ctrl-C stops it in order. Progress goes to stderr.
graph::RunReport run_graph(const graph::GraphDescription& graph, const Where& where);

// Where this program is, with those of the stages beside it.
std::filesystem::path executable_folder();

// Stages with frames and times, failures and the account, as text or JSON on stdout.
void print_report(const graph::RunReport& report, const graph::GraphDescription& graph, bool json);

// A graph file that is installed with the program, by name ("segment"). Throws InputError.
std::filesystem::path shipped_graph(std::string_view name);

// Sets the parameters of a stage that differ from the kind's defaults.
void configure(graph::GraphDescription& graph, std::string_view stage, const Fields& wanted);

// Applies "STAGE.NAME=VALUE" settings of the command line, a list's elements separated by commas.
// Throws ParameterError for an unknown stage or a malformed setting.
void apply_overrides(graph::GraphDescription& graph, const std::vector<std::string>& settings);

// Throws GraphError if the graph, after changes by the program, is not consistent.
void require_sound(const graph::GraphDescription& graph);

// What every command that runs a graph does with it: settings of the command line, check, run,
// report.
graph::RunReport run_and_report(graph::GraphDescription graph,
                                const std::vector<std::string>& settings, const Where& where,
                                bool json);

}  // namespace cosegraph::tools
