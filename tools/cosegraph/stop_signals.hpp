// Ctrl-C as a question that long work can ask.
#pragma once

#include <signal.h>

#include <atomic>

namespace cosegraph::tools {

// While one lives the first SIGINT or SIGTERM asks for a clean end, and a second one ends the
// process at once; but one that comes with the first does not: programs that run others hand on
// what the terminal has already sent to all. One at a time.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  const std::atomic<bool>& asked() const;

 private:
  struct sigaction interrupt_ {};
  struct sigaction terminate_ {};
};

}  // namespace cosegraph::tools
