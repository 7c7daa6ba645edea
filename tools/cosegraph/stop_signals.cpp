#include "tools/cosegraph/stop_signals.hpp"

#include <chrono>

namespace cosegraph::tools {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kSame(500);

std::atomic<bool> stop_asked = false;
std::atomic<Clock::rep> asked_at = 0;  // 0: not yet

void ask(int signal) {
  const auto now = Clock::now().time_since_epoch();
  Clock::rep first = 0;
  if (asked_at.compare_exchange_strong(first, now.count())) {
    stop_asked = true;
  } else if (now - Clock::duration(first) > kSame) {
    ::signal(signal, SIG_DFL);
    ::raise(signal);
  }
}

}  // namespace

StopSignals::StopSignals() {
  stop_asked = false;
  asked_at = 0;
  struct sigaction action {};
  action.sa_handler = ask;
  ::sigaction(SIGINT, &action, &interrupt_);
  ::sigaction(SIGTERM, &action, &terminate_);
}

StopSignals::~StopSignals() {
  ::sigaction(SIGINT, &interrupt_, nullptr);
  ::sigaction(SIGTERM, &terminate_, nullptr);
}

const std::atomic<bool>& StopSignals::asked() const {
  return stop_asked;
}

}  // namespace cosegraph::tools
