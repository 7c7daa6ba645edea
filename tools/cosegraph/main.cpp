#include <iostream>

#include "core/error.hpp"
#include "graph/description.hpp"
#include "graph/process.hpp"
#include "tools/cosegraph/commands.hpp"

int main(int argc, char** argv) {
  using namespace cosegraph;
  graph::set_up_process();
  CLI::App app(
      "Labels the parts of objects in single-view point clouds after one labelled example.");
  app.name("cosegraph");
  app.require_subcommand(1);
  app.set_version_flag("--version", "cosegraph " COSEGRAPH_VERSION);
  app.footer(
      "Example:\n"
      "  cosegraph sample -o shapes\n"
      "  cosegraph train --reference shapes/mug1.off -o mug.coseg\n"
      "  cosegraph segment --model mug.coseg shapes/mug2.off -o out --picture");
  tools::Action action;
  const tools::Choose choose = [&](tools::Action chosen) { action = std::move(chosen); };
  tools::add_sample_command(app, choose);
  tools::add_job_commands(app, choose);
  tools::add_picture_command(app, choose);
  tools::add_eval_command(app, choose);
  tools::add_graph_commands(app, choose);
  tools::add_keys_command(app, choose);
  tools::add_agent_commands(app, choose);
  tools::add_recording_commands(app, choose);
  tools::add_replay_commands(app, choose);
  tools::add_topic_commands(app, choose);
  tools::add_top_command(app, choose);
  tools::add_why_command(app, choose);
  tools::add_doctor_command(app, choose);
  tools::add_monitor_command(app, choose);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    return action();
  } catch (const ParameterError& error) {
    std::cerr << "cosegraph: " << error.what() << '\n';
    return 2;
  } catch (const graph::GraphError& error) {
    std::cerr << error.what() << '\n';
    return 1;
  } catch (const std::exception& error) {
    std::cerr << "cosegraph: " << error.what() << '\n';
    return 1;
  }
}
