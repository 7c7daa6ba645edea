#include "graph/child_process.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "core/error.hpp"
#include "io/file.hpp"

namespace cosegraph::graph {
namespace {

using testing::HasSubstr;
using testing::Not;

// What a script prints as a child.
std::string printed(const std::string& script, int death_signal) {
  const io::TemporaryFolder folder;
  const auto file = folder / "out";
  const int output = ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  const pid_t pid =
      start_child({"/bin/sh", "-c", script}, {.output = output, .death_signal = death_signal});
  ::close(output);
  int status = 0;
  EXPECT_EQ(::waitpid(pid, &status, 0), pid);
  EXPECT_EQ(status, 0);
  return io::read_file(file);
}

TEST(ChildProcess, KeepsNothingOpenOfItsParent) {
  const io::TemporaryFolder folder;
  const int inherited = ::open((folder / "kept").c_str(), O_WRONLY | O_CREAT, 0600);
  ASSERT_GE(inherited, 0);
  EXPECT_THAT(printed("ls -l /proc/$$/fd", SIGTERM),
              testing::AllOf(HasSubstr("/dev/null"), Not(HasSubstr("kept"))));
  ::close(inherited);
}

TEST(ChildProcess, LivesInASessionOfItsOwnIfItIsToLiveOn) {
  const auto session = [](int death_signal) {
    return std::stol(printed("cut -d' ' -f6 /proc/$$/stat", death_signal));
  };
  EXPECT_EQ(session(SIGTERM), ::getsid(0));
  EXPECT_NE(session(0), ::getsid(0));
}

TEST(ChildProcess, BeginsWithoutBlockedSignals) {
  sigset_t blocked;
  sigset_t before;
  sigemptyset(&blocked);
  sigaddset(&blocked, SIGTERM);
  ::sigprocmask(SIG_BLOCK, &blocked, &before);
  EXPECT_THAT(printed("exec grep SigBlk /proc/self/status", SIGTERM),
              HasSubstr("0000000000000000"));
  ::sigprocmask(SIG_SETMASK, &before, nullptr);
}

}  // namespace
}  // namespace cosegraph::graph
