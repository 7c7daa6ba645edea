// Whether a recording holds everything, and if not, what is missing.
//
// Frames are counted without gaps by their source, and a frame that a stage could not finish is
// announced as failed, and a frame names the model it was worked on with. So what a topic should
// hold is known: every sequence number of an epoch, but for the frames that failed before they got
// there. A recording that began in the middle of a stream, or ended there, is judged between the
// frames that all of its topics have.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "idl/codec.hpp"
#include "tools/recording/mcap.hpp"
#include "tools/recording/topics.hpp"

namespace cosegraph::recording {

// Sequence numbers `first` to `last` of an epoch.
struct Range {
  std::uint64_t epoch = 0;
  std::uint64_t first = 0;
  std::uint64_t last = 0;

  std::uint64_t count() const { return last - first + 1; }
  bool operator==(const Range&) const = default;
};

struct TopicCount {
  std::uint64_t messages = 0;
  std::uint64_t bytes = 0;
  std::uint64_t lost = 0;                     // came to the recorder, which had no room for them
  std::vector<Range> missing;                 // frames that never came
  std::vector<std::uint64_t> missing_models;  // their ids: frames name them, but they never came

  bool has_all() const { return lost == 0 && missing.empty() && missing_models.empty(); }

  bool operator==(const TopicCount&) const = default;
};

struct Stretch {
  Range frames;              // whole frames, gaps aside
  bool from_start = true;    // begins with the first frame of the epoch
  bool to_end = false;       // ends with the last frame of its stream
  std::uint64_t failed = 0;  // frames in it that failed somewhere

  bool operator==(const Stretch&) const = default;
};

struct Completeness {
  std::string ended;  // why the recording ended; empty: nobody was there to tell
  std::map<std::string, TopicCount> topics;
  std::vector<Stretch> stretches;  // one per epoch that has a whole frame

  // Nothing is missing in what was recorded.
  bool has_all() const;
  bool operator==(const Completeness&) const = default;
};

constexpr std::string_view kCompletenessName = "cosegraph.completeness";

Metadata to_metadata(const Completeness& completeness);
// Throws InputError if it was not made by to_metadata.
Completeness completeness_of(const Metadata& metadata);

// A set of numbers that come nearly in order: takes memory per gap.
class Runs {
 public:
  void add(std::uint64_t number);
  bool contains(std::uint64_t number) const;
  bool empty() const { return runs_.empty(); }
  std::uint64_t first() const { return runs_.begin()->first; }
  std::uint64_t last() const { return runs_.rbegin()->second; }
  const std::map<std::uint64_t, std::uint64_t>& runs() const { return runs_; }  // first: last

 private:
  std::map<std::uint64_t, std::uint64_t> runs_;
};

// Keeps count of the messages of a recording.
class Tally {
 public:
  // `history`: so many frames are on their way when a recorder comes in mid-stream. It may find
  // holes among them, since what it has not got yet makes room for others; the recording begins
  // after the last such hole.
  Tally(std::vector<Topic> topics, int history);

  // A message of the topic with this index. Throws InputError if it has no header.
  void add(std::size_t topic, std::span<const std::uint8_t> bytes);

  // Without `ended` and `lost`.
  Completeness completeness() const;
  // The newest epoch's stream is over, and every topic has all of its frames and models.
  bool has_whole_stream() const;

 private:
  struct Epoch {
    std::map<std::size_t, Runs> seen;     // by topic
    std::map<std::string, Runs> failed;   // by stage
    std::optional<std::uint64_t> length;  // of the stream
  };

  std::vector<std::uint64_t> missing_models(std::size_t topic) const;
  Runs present(const Epoch& epoch, std::size_t topic) const;
  std::optional<Stretch> stretch(std::uint64_t id, const Epoch& epoch,
                                 const std::map<std::size_t, Runs>& present) const;

  std::vector<Topic> topics_;
  std::uint64_t history_;
  std::vector<TopicCount> counts_;
  std::map<std::uint64_t, Epoch> epochs_;
  std::set<std::uint64_t> named_models_;                   // by frames
  std::map<std::size_t, std::set<std::uint64_t>> models_;  // by topic: those that came
};

}  // namespace cosegraph::recording
