// Recordings of a graph as MCAP files: a channel per topic, the graph file attached, and a record
// of what is missing, if anything.
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "graph/stage.hpp"
#include "tools/recording/completeness.hpp"
#include "tools/recording/mcap_reader.hpp"
#include "tools/recording/mcap_writer.hpp"
#include "tools/recording/topics.hpp"

namespace cosegraph::recording {

constexpr std::string_view kGraphName = "graph.yaml";

struct RecordingOptions {
  std::uint64_t max_size = 0;  // bytes of a file, about; 0: no bound
  bool split = false;          // begin another file then, instead of being full
  bool compressed = true;      // with zstd
};

// A message on its way into a recording.
struct Entry {
  std::size_t topic = 0;  // its index
  std::uint64_t time = 0;
  graph::Sample sample;
};

// With `split`, X.mcap becomes X_0.mcap, X_1.mcap, ... Each can be used alone: it begins with the
// models that were there before. Its completeness record is about the recording up to its end.
class Recording {
 public:
  // Throws InputError if the file exists or cannot be made.
  Recording(std::filesystem::path file, const graph::GraphDescription& graph,
            std::vector<Topic> topics, RecordingOptions options = {});

  // Throws InputError naming the file if the disk takes no more.
  void write(const Entry& entry);
  // What was written so far survives a kill.
  void flush() { writer_->flush(); }
  // The file has its size, and there is no other to come.
  bool full();
  // Adds the completeness record. `ended`: why; `lost`: per topic, what had no room.
  void close(const std::string& ended, const std::vector<std::uint64_t>& lost);

  const std::vector<std::filesystem::path>& files() const { return files_; }
  const Completeness& completeness() const { return completeness_; }  // after close()

 private:
  void open(std::uint64_t time);
  bool has_room(std::uint64_t bytes);
  void put(const Entry& entry, std::uint64_t time);

  std::filesystem::path file_;
  std::string graph_;
  std::vector<Topic> topics_;
  RecordingOptions options_;
  Tally tally_;
  Completeness completeness_;
  std::unique_ptr<McapWriter> writer_;
  std::vector<std::uint16_t> channels_;    // by topic
  std::vector<std::deque<Entry>> models_;  // by topic: the newest of latched ones
  std::vector<std::filesystem::path> files_;
};

// The newest messages, as far back as a time and as many as some memory holds.
class Ring {
 public:
  // `latched` tells of each topic whether its newest values are kept however old they are.
  Ring(std::vector<bool> latched, std::uint64_t nanoseconds, std::uint64_t bytes);

  void push(Entry entry);
  // Begins with the models that are older; their time becomes that of the first message.
  std::vector<Entry> entries() const;
  // Something went for lack of memory rather than for its age.
  bool was_full() const { return was_full_; }

 private:
  void drop_oldest();

  std::vector<bool> latched_;
  std::uint64_t nanoseconds_;
  std::uint64_t room_;
  std::deque<Entry> entries_;
  std::uint64_t bytes_ = 0;
  std::vector<std::deque<Entry>> models_;
  bool was_full_ = false;
};

// The topics of a recording by channel. Throws InputError if it is not one of ours.
std::map<std::uint16_t, Topic> topics_in(const McapReader& reader);

// The graph that was recorded, unchecked: stages may have changed since. Throws InputError if none
// is attached, GraphError if it cannot be parsed.
graph::GraphDescription graph_in(const McapReader& reader);

// The completeness record, or for a file that was cut off what its messages tell.
Completeness completeness_in(const McapReader& reader);

}  // namespace cosegraph::recording
