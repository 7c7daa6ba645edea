// Records a running graph. Messages are taken as they come and wait in memory for a thread that
// writes them: a graph is never held up, and what the disk cannot take in time is counted as lost.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "graph/dds.hpp"
#include "tools/recording/recording.hpp"

namespace cosegraph::recording {

struct RecorderOptions {
  RecordingOptions file;
  std::vector<std::string> topics;                // parts of names; empty: all
  std::optional<std::chrono::milliseconds> last;  // only so much before the end, kept in memory
  std::uint64_t memory = 256ULL << 20U;           // bytes that wait to be written
  std::uint64_t ring_memory = 1ULL << 30U;        // bytes that `last` may take
};

class Recorder {
 public:
  // `graph` with the instance of the run. Throws InputError if the file exists or cannot be made.
  Recorder(const graph::GraphDescription& graph, const graph::Catalog& catalog,
           const std::filesystem::path& file, const RecorderOptions& options);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // Waits at most `patience`; false once there is nothing more to record: the stream is over, the
  // file is full or cannot be written.
  bool step(std::chrono::milliseconds patience);

  struct Progress {
    std::uint64_t messages = 0;
    std::uint64_t bytes = 0;
    std::uint64_t lost = 0;
    std::vector<std::string> silent;  // topics of stages from which nothing has come
  };
  Progress progress() const;

  // Waits a moment for what is still on its way (models that frames name, frames that others have
  // overtaken), then takes no more messages, writes what has come, closes the file. `otherwise`:
  // why it is over, if not for a reason that the recorder knows. Throws what writing threw.
  struct Result {
    std::vector<std::filesystem::path> files;
    Completeness completeness;
  };
  Result finish(const std::string& otherwise);

 private:
  void receive(std::size_t topic, graph::Sample sample);
  void work();
  void write(const Entry& entry);
  std::string reason(const std::string& otherwise) const;

  std::vector<Topic> topics_;
  std::optional<Ring> ring_;
  Recording recording_;
  std::uint64_t memory_;
  std::chrono::steady_clock::time_point started_;
  std::uint64_t started_at_;  // ns since 1970

  mutable std::mutex mutex_;  // guards what follows, up to participant_
  std::condition_variable changed_;
  std::deque<Entry> queue_;
  std::uint64_t queued_bytes_ = 0;  // the entries at work included
  std::vector<std::uint64_t> lost_;
  std::vector<bool> heard_;
  Progress progress_;
  bool source_finished_ = false;
  bool whole_ = false;   // has every frame of the stream
  bool ending_ = false;  // asks whether something is missing
  bool missing_ = true;  // of the frames that have come
  bool full_ = false;
  bool stop_ = false;
  std::exception_ptr error_;
  std::optional<std::chrono::steady_clock::time_point> finished_at_;
  int history_;  // frames, of the writers
  std::string source_;

  graph::Participant participant_;
  std::vector<std::unique_ptr<graph::Reader>> readers_;
  std::thread writer_;
};

}  // namespace cosegraph::recording
