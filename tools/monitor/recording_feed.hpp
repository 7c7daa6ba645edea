// A recording as a feed that never changes: its frames, any part of them, and the graph as it was
// at its end.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tools/monitor/channel.hpp"
#include "tools/monitor/cloud_views.hpp"
#include "tools/monitor/frame_index.hpp"
#include "tools/monitor/state.hpp"
#include "tools/recording/mcap_reader.hpp"

namespace cosegraph::monitor {

// What belongs to no frame is kept in memory; of the frames, the part that was asked for last.
class RecordingFeed final : public Feed {
 public:
  // What is given to who asks for no part.
  static constexpr std::size_t kMaxFrames = 120;
  static constexpr std::size_t kMaxBytes = 512U << 20U;  // of their messages

  // Goes through the whole file. Frame number `first` is the one to be shown first, and those from
  // it on are given to who asks for no part. Damaged chunks are left out, and told of. Throws
  // InputError if the file is no recording of a graph or has no such frame.
  explicit RecordingFeed(const std::filesystem::path& file, std::uint64_t first = 0);

  std::string name() const override { return name_; }
  const std::vector<Channel>& channels() const override { return channels_; }
  void open(Deliver) override {}
  std::vector<Message> subscribe(std::size_t channel, std::optional<std::size_t> part) override;
  void unsubscribe(std::size_t) override {}
  std::size_t parts() const override { return parts_.size(); }

 private:
  struct Entry {
    std::size_t topic = 0;
    Message message;
  };

  template <class Take>  // (topic's place, time, data)
  std::size_t read(const recording::Selection& selection, const Take& take) const;
  void survey(const Topic& topic, std::uint64_t time, std::span<const std::uint8_t> data);
  void load(FrameIndex::Range range);
  std::vector<Message> draw(std::size_t view) const;

  const std::string name_;
  const recording::McapReader reader_;
  graph::GraphDescription graph_;
  std::vector<Topic> topics_;
  std::map<std::uint16_t, std::size_t> place_;  // of a channel's topic
  std::vector<CloudView> views_;
  std::vector<Channel> channels_;
  FrameIndex frames_;
  std::vector<FrameIndex::Range> parts_;
  FrameIndex::Range default_;
  std::vector<Entry> lasting_;  // of no frame
  FrameIndex::Range loaded_;
  std::vector<Entry> entries_;  // of the frames that are loaded, in the order of the file
  Message state_;

  // While it is surveyed.
  const std::map<std::uint64_t, std::uint64_t> first_whole_;  // by epoch: sequence
  graph::Look processes_;
  std::vector<graph::ObservedFailure> failures_;
};

}  // namespace cosegraph::monitor
