// Runs the project's programs as a user would, and folders to do it in.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "io/file.hpp"

namespace cosegraph::test {

inline std::string slurp(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

using io::TemporaryFolder;

struct Outcome {
  int status = -1;  // exit status; 128 + signal if killed
  std::string output;
  std::string errors;
};

class Program {
 public:
  explicit Program(std::vector<std::string> words) {
    if (words[0].find('/') == std::string::npos)
      words[0] = std::string(COSEGRAPH_BINARY_DIR) + "/bin/" + words[0];
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    const auto redirect = [&](int descriptor, const std::filesystem::path& file) {
      posix_spawn_file_actions_addopen(&actions, descriptor, file.c_str(),
                                       O_WRONLY | O_CREAT | O_TRUNC, 0600);
    };
    redirect(STDOUT_FILENO, folder_ / "output");
    redirect(STDERR_FILENO, folder_ / "errors");
    std::vector<char*> arguments;
    for (auto& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    if (::posix_spawn(&pid_, arguments[0], &actions, nullptr, arguments.data(), environ) != 0)
      ADD_FAILURE() << "cannot run " << words[0];
    posix_spawn_file_actions_destroy(&actions);
  }

  pid_t pid() const { return pid_; }
  // What it has printed until now.
  std::string output_so_far() const { return slurp(folder_ / "output"); }

  Outcome wait() {
    int status = 0;
    ::waitpid(pid_, &status, 0);
    return {.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status),
            .output = slurp(folder_ / "output"),
            .errors = slurp(folder_ / "errors")};
  }

 private:
  TemporaryFolder folder_;
  pid_t pid_ = -1;
};

// Runs `cosegraph` (or another of the project's programs) to its end.
inline Outcome run(std::vector<std::string> words) {
  return Program(std::move(words)).wait();
}

}  // namespace cosegraph::test
