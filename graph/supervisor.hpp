// The processes of a graph on this machine: starts, watches, restarts and stops them, and passes
// on what they print. Knows no DDS.
//
// What a process needs stands in a folder: its graph file, its journal (see journal.hpp), its log.
// A detached supervisor's processes go on when it dies, and another one that is given the same
// folder takes them over: they are recognised by their command lines.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "graph/description.hpp"
#include "idl/codec.hpp"

namespace cosegraph::graph {

struct SupervisorOptions {
  std::filesystem::path folder;        // exists, belongs to this supervisor alone
  std::filesystem::path executables;   // where the cosegraph-<kind> programs are
  std::filesystem::path graph_folder;  // of the graph file: programs in it may be run
  bool allow_exec = false;             // programs of graphs may stand anywhere
  bool detached = false;               // processes outlive this one; else they die with it
  std::vector<std::string> leaves;     // of the graph
};

class Supervisor {
 public:
  using Output = std::function<void(const std::string& stage, std::uint32_t replica,
                                    const std::vector<std::string>& lines)>;

  Supervisor(SupervisorOptions options, Output output);
  // Stops everything, unless it is detached.
  ~Supervisor();
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  // Takes over what a predecessor with the same folder has left running. How many there were.
  std::size_t adopt();

  // Starts one process of `stage` as `graph` describes it; a candidate waits until it is told to
  // take its place, and is not restarted. Generation 0 is chosen: behind all there were. Throws
  // Error if there is no program or it must not be run, InputError if the folder is full.
  void launch(const GraphDescription& graph, const std::string& stage, std::uint32_t replica,
              std::uint32_t generation = 0, bool candidate = false);

  // Candidates of this generation become processes like the others.
  void promote(const std::string& stage, std::uint32_t generation);
  // Whether processes of generations before `newcomer` are started again when they die; those that
  // died while it was not allowed are, when it is allowed again.
  void allow_restart(const std::string& stage, std::uint32_t newcomer, bool allowed);

  // Asks the processes of a stage to end (of one generation, or all), kills them if they do not;
  // attend() sees it through. False if there are none.
  bool stop(const std::string& stage, std::optional<std::uint32_t> generation = {});
  // The same for all, `first` before the others, and waits.
  void stop_all(const std::string& first);
  // Forgets a stage that runs elsewhere from now on.
  void forget(const std::string& stage, std::uint32_t generation);

  // Waits for something to happen, at most `patience`: an exit, a restart that is due, output, or
  // `wake` (a file descriptor) becoming readable. Returns the processes whose state has changed.
  std::vector<idl::AgentProcess> attend(std::chrono::milliseconds patience, int wake = -1);

  std::vector<idl::AgentProcess> processes() const;
  // Whether one is not to be started again for the time being.
  bool any_retired(const std::string& stage) const;
  // As what it was started. Throws Error if there is none such.
  const GraphDescription& graph_of(const std::string& stage, std::uint32_t generation) const;
  // The newest of this stage that was ever started here.
  std::uint32_t newest_generation(const std::string& stage) const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Process {
    idl::AgentProcess info;
    GraphDescription graph;
    bool may_restart = true;
    bool stopping = false;
    bool changed = true;
    int pidfd = -1;
    int log = -1;
    std::string partial_line;
    Clock::time_point started{};
    Clock::time_point due{};  // of the restart, or of the kill
  };

  std::filesystem::path file_of(const Process& process, std::string_view extension) const;
  std::string program_of(const StageNode& node) const;
  void start(Process& process);
  void open_log(Process& process);
  void read_log(Process& process);
  void note_exit(Process& process, const std::string& how);
  void set_state(Process& process, idl::ProcessState state, const std::string& text);

  SupervisorOptions options_;
  Output output_;
  std::vector<Process> processes_;
};

}  // namespace cosegraph::graph
