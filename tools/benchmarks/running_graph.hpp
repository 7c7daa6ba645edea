// `cosegraph up` on a stream of query views, as its user sees it: files that come out, processes,
// an account at the end.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "graph/description.hpp"
#include "io/file.hpp"
#include "tools/benchmarks/bench.hpp"

namespace cosegraph::bench {

class RunningGraph {
 public:
  using Clock = std::chrono::system_clock;

  struct Options {
    int frames = 100;  // the subject's queries in turn
    std::string config = "fpfh+fv+iso";
    std::function<void(graph::GraphDescription&)> change = [](auto&) {};
  };

  // config/graphs/segment.yaml as `change` leaves it, one thread per stage. Stages that die are
  // started again. Throws Error if it cannot be started.
  RunningGraph(const Subject& subject, const Options& options);
  RunningGraph(const RunningGraph&) = delete;
  RunningGraph& operator=(const RunningGraph&) = delete;
  ~RunningGraph();

  std::filesystem::path file() const { return folder_.path() / "graph.yaml"; }
  // Where whoever looks on may put what it writes.
  const std::filesystem::path& folder() const { return folder_.path(); }

  // Whether `up` has not ended.
  bool running();
  void await_end();
  // As by Ctrl-C.
  void stop();
  // Until so many frames have come out, or the graph is over.
  void await_written(int frames);

  // How many frames have come out. To be asked while times are taken: looks at names alone.
  int written() const;
  // When each frame has come out, in order.
  std::vector<Clock::time_point> outputs() const;
  // Frames per second without the first and the last tenth of the outputs.
  double rate() const;
  // Resident memory of all stages, bytes.
  std::uint64_t memory() const;

  // False if there is no process of that stage.
  bool kill_stage(const std::string& stage) const;
  // The report of the swap; null if it failed.
  nlohmann::json swap(const std::string& stage) const;

  // Of a graph that is over or was stopped. Throws Error with what `up` has said if it did not come
  // to its end.
  nlohmann::json account() const;

 private:
  void for_each_process(const std::function<void(pid_t, const std::string&)>& visit) const;

  const io::TemporaryFolder folder_;
  pid_t pid_ = -1;
};

// Starts a program with its output and errors in files; its pid. Throws Error if it cannot.
pid_t start_program(std::vector<std::string> words, const std::filesystem::path& output,
                    const std::filesystem::path& errors);

}  // namespace cosegraph::bench
