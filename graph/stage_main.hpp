// The main program of a single stage.
#pragma once

#include <string>

#include "graph/stage.hpp"

namespace cosegraph::graph {

// Runs `--stage NAME` of `--graph FILE` until SIGTERM or SIGINT. Returns the exit status: 0
// stopped, 1 the stage gave up, 2 misuse or a faulty graph file.
int stage_main(int argc, char** argv, const std::string& kind, const StageFactory& make);

}  // namespace cosegraph::graph
