// The subcommands of `cosegraph`. Each adds itself to the command line; what it returns when run
// is the exit status: 0 fine, 1 failed. Misuse (2) is found by the parser or a ParameterError.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "graph/stage.hpp"

namespace cosegraph::tools {

using Action = std::function<int()>;

// Called by the parser when a subcommand was chosen; main() then runs the action.
using Choose = std::function<void(Action)>;

void add_sample_command(CLI::App& app, const Choose& choose);      // sample
void add_job_commands(CLI::App& app, const Choose& choose);        // view train segment
void add_picture_command(CLI::App& app, const Choose& choose);     // picture
void add_eval_command(CLI::App& app, const Choose& choose);        // eval
void add_graph_commands(CLI::App& app, const Choose& choose);      // check draw run up stages
void add_keys_command(CLI::App& app, const Choose& choose);        // keys
void add_agent_commands(CLI::App& app, const Choose& choose);      // agent ps logs start stop ...
void add_recording_commands(CLI::App& app, const Choose& choose);  // record info
void add_replay_commands(CLI::App& app, const Choose& choose);     // replay compare
void add_topic_commands(CLI::App& app, const Choose& choose);      // topic list info echo hz ...
void add_top_command(CLI::App& app, const Choose& choose);         // top
void add_why_command(CLI::App& app, const Choose& choose);         // why
void add_doctor_command(CLI::App& app, const Choose& choose);      // doctor
void add_monitor_command(CLI::App& app, const Choose& choose);     // monitor

// Every kind of stage that this program was built with.
const graph::StageTable& stage_table();

}  // namespace cosegraph::tools
