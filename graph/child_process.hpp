// Starts programs that keep nothing open of whoever starts them: a socket of DDS that a child has
// too would hold its port, and what arrives there, for as long as the child lives.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace cosegraph::graph {

struct ChildOptions {
  int output = -1;       // file descriptor of what it prints; -1: nowhere
  int death_signal = 0;  // that it gets when the starter dies; 0: it lives on, in its own session
};

// `words`: the program's path and its arguments. It begins without blocked signals, and Ctrl-C does
// not reach it. Throws Error.
pid_t start_child(std::vector<std::string> words, const ChildOptions& options);

}  // namespace cosegraph::graph
