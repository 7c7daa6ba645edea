// A graph of toy stages (support/toys) that runs as processes:
//
//   numbers -> left  -> keep
//           -> right ->
//
// The leaf writes a file per frame: number + left's value + number + right's value.
#pragma once

#include <algorithm>
#include <chrono>
#include <csignal>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "support/program.hpp"

namespace cosegraph::test {

class ToyGraph {
 public:
  struct Options {
    int count = 300;
    double rate = 100.0;
    std::string left;                            // further parameters of that stage
    std::string extra;                           // further keys of it
    std::string hosts;                           // a line, if there are any
    bool secure = false;                         // with keys, in the folder "keys" beside the file
    std::map<std::string, std::string> host_of;  // by stage
    int max_restarts = 1000;
    double deadline = 20.0;
  };

  ToyGraph() : ToyGraph(Options{}) {}
  explicit ToyGraph(const Options& options) {
    ::setenv("COSEGRAPH_RUNTIME_DIR", (folder_ / "runtime").c_str(), 1);
    const std::string program = std::string(COSEGRAPH_BINARY_DIR) + "/tests/toy-";
    const std::string restart =
        "restart: {policy: on-failure, max: " + std::to_string(options.max_restarts) +
        ", backoff: 0.01}";
    const auto stage = [&](const std::string& name, const std::string& kind,
                           const std::string& inputs, const std::string& params,
                           const std::string& extra = "") {
      return "  " + name + ": {exec: " + program + kind + ", " +
             (options.host_of.contains(name) ? "host: " + options.host_of.at(name) + ", " : "") +
             (kind == "keep" ? "" : "outputs: {out: Cloud}, ") +
             (inputs.empty() ? "" : "inputs: {" + inputs + "}, ") + extra + "params: {" + params +
             "}, " + restart + "}\n";
    };
    io::write_file(
        file(),
        "version: 1\ngraph: " + name() +
            "\nwindow: 4\ndeadline: " + std::to_string(options.deadline) + "\n" + options.hosts +
            (options.secure ? "dds: {security: keys}\n" : "") + "stages:\n" +
            stage("numbers", "numbers", "",
                  "count: " + std::to_string(options.count) +
                      ", rate: " + std::to_string(options.rate)) +
            stage("left", "add", "in: numbers/out",
                  "value: 1" + (options.left.empty() ? "" : ", " + options.left), options.extra) +
            stage("right", "add", "in: numbers/out", "value: 2") +
            stage("keep", "keep", "a: left/out, b: right/out", "folder: " + out().string()));
    if (options.secure) {
      const Outcome keys = run({"cosegraph", "keys", "init", file().string()});
      EXPECT_EQ(keys.status, 0) << keys.errors;
    }
  }
  ~ToyGraph() { ::unsetenv("COSEGRAPH_RUNTIME_DIR"); }

  std::string name() const { return name_; }
  std::filesystem::path file() const { return folder_ / "graph.yaml"; }
  std::filesystem::path out() const { return folder_ / "out"; }

  std::unique_ptr<Program> up() const {
    return std::make_unique<Program>(
        std::vector<std::string>{"cosegraph", "up", file(), "--allow-exec", "--json"});
  }
  std::unique_ptr<Program> agent() const {
    return std::make_unique<Program>(
        std::vector<std::string>{"cosegraph", "agent", file(), "--allow-exec"});
  }

  int written() const {
    std::error_code error;
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(out(), error))
      count += entry.path().extension().empty() ? 1 : 0;
    return count;
  }
  double value(int frame) const {
    const std::string text = slurp(out() / ("n" + std::to_string(frame)));
    return text.empty() ? -1.0 : std::stod(text);
  }

  // Waits until `count` frames have come out.
  void await_written(int count) const {
    await([&] { return written() >= count; }, "frames to come out");
  }
  static void await(const std::function<bool()>& condition, const char* what) {
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (std::chrono::steady_clock::now() < limit) {
      if (condition()) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    ADD_FAILURE() << "waited too long for " << what;
  }

  // `cosegraph VERB ... --graph NAME`
  Outcome order(std::vector<std::string> words) const {
    words.insert(words.begin(), "cosegraph");
    words.insert(words.end(), {"--graph", name_});
    return run(words);
  }
  nlohmann::json ps() const {
    const Outcome outcome = run({"cosegraph", "ps", name_, "--json"});
    EXPECT_EQ(outcome.status, 0) << outcome.errors;
    return nlohmann::json::parse(outcome.output, nullptr, false);
  }

  // Processes of this graph whose command line holds `words`.
  std::vector<pid_t> pids(const std::string& words = "") const {
    std::vector<pid_t> result;
    for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
      const std::string pid = entry.path().filename();
      if (pid.find_first_not_of("0123456789") != std::string::npos) continue;
      std::string line = slurp(entry.path() / "cmdline");
      std::ranges::replace(line, '\0', ' ');
      if (line.find(folder_.path().string()) != std::string::npos &&
          line.find("--journal") != std::string::npos && line.find(words) != std::string::npos)
        result.push_back(std::stoi(pid));
    }
    return result;
  }
  void kill(const std::string& stage) const {
    for (const pid_t pid : pids("--stage " + stage + " ")) ::kill(pid, SIGKILL);
  }

  static nlohmann::json account(const Outcome& outcome) {
    const auto report = nlohmann::json::parse(outcome.output, nullptr, false);
    EXPECT_FALSE(report.is_discarded()) << outcome.output << outcome.errors;
    return report.is_discarded() ? report : report["account"];
  }

 private:
  TemporaryFolder folder_;
  std::string name_ = "toy" + std::to_string(::getpid());
};

}  // namespace cosegraph::test
