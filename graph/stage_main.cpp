#include "graph/stage_main.hpp"

#include <CLI/CLI.hpp>
#include <csignal>
#include <iostream>
#include <thread>

#include "graph/description.hpp"
#include "graph/process.hpp"
#include "graph/runtime.hpp"
#include "io/file.hpp"

namespace cosegraph::graph {

int stage_main(int argc, char** argv, const std::string& kind, const StageFactory& make) {
  set_up_process();
  CLI::App app("One stage of a cosegraph graph: " + make()->summary());
  app.footer("Usually started by 'cosegraph up'. By hand, in a terminal per stage:\n  cosegraph-" +
             kind + " --graph segment.yaml --stage " + kind + " --leaves sink");
  std::string file;
  std::string name;
  std::string instance;
  RunnerOptions options;
  app.add_option("--graph", file, "graph file")->required()->check(CLI::ExistingFile);
  app.add_option("--stage", name, "name of the stage in the graph file")->required();
  app.add_option("--leaves", options.leaves,
                 "stages that report frames as done, separated by commas")
      ->delimiter(',')
      ->required();
  app.add_option("--instance", instance,
                 "name of this run; stages of different runs of a graph do not meet");
  app.add_option("--generation", options.generation, "how often this stage was started before");
  app.add_option("--replica", options.replica, "which of the stage's replicas this is, from 0");
  app.add_option("--journal", options.journal,
                 "file that tells the next process of this stage where this one was");
  app.add_flag("--standby", options.standby,
               "wait beside the process that is to be replaced until told to take its place");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  // Signals are waited for below; threads started from here on inherit the mask.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  try {
    GraphDescription graph = parse(io::read_file(file), file);
    graph.instance = instance;
    const StageNode* node = graph.stage(name);
    if (node == nullptr) throw ParameterError(file + ": there is no stage '" + name + "'");
    if (!node->use.empty() && node->use != kind)
      throw ParameterError(file + ": stage '" + name + "' is a " + node->use + ", not a " + kind);
    if (options.replica >= hosts_of(*node).size())
      throw ParameterError("--replica: stage '" + name + "' has " +
                           std::to_string(hosts_of(*node).size()) + " of them");
    auto stage = make();
    apply_params(graph, *node, *stage);
    StageRunner runner(graph, name, std::move(stage), options);
    for (;;) {
      const timespec period{.tv_sec = 0, .tv_nsec = 100'000'000};
      if (sigtimedwait(&signals, nullptr, &period) > 0) return 0;
      if (runner.failed()) {
        std::cerr << runner.status().activity << '\n';
        // Time for the last status to be seen before the participant goes.
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
        return 1;
      }
    }
  } catch (const ParameterError& error) {
    std::cerr << error.what() << '\n';
    return 2;
  } catch (const GraphError& error) {
    std::cerr << error.what() << '\n';
    return 2;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}

}  // namespace cosegraph::graph
