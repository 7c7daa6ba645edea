// A recording as a feed that never changes: frames of it, and the graph as it was at its end.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tools/monitor/channel.hpp"
#include "tools/monitor/cloud_views.hpp"
#include "tools/monitor/state.hpp"
#include "tools/recording/mcap_reader.hpp"

namespace cosegraph::monitor {

class RecordingFeed final : public Feed {
 public:
  static constexpr std::size_t kMaxFrames = 120;         // as many as a page keeps
  static constexpr std::size_t kMaxBytes = 512U << 20U;  // of their messages

  // Reads the frames from number `first` on, counted from 0 in the order in which they began, as
  // many as there is room for. Damaged chunks are left out, and told of. Throws InputError if the
  // file is no recording of a graph or has no such frame.
  explicit RecordingFeed(const std::filesystem::path& file, std::uint64_t first = 0);

  std::string name() const override { return name_; }
  const std::vector<Channel>& channels() const override { return channels_; }
  void open(Deliver) override {}
  std::vector<Message> subscribe(std::size_t channel) override;
  void unsubscribe(std::size_t) override {}

 private:
  using FrameId = std::pair<std::uint64_t, std::uint64_t>;  // epoch, sequence
  struct Entry {
    std::size_t topic = 0;
    Message message;
  };

  void take(const Topic& topic, Entry entry, std::uint64_t first);
  std::string note(std::uint64_t first) const;
  std::vector<Message> draw(std::size_t view) const;

  const std::string name_;
  graph::GraphDescription graph_;
  std::vector<Topic> topics_;
  std::vector<CloudView> views_;
  std::vector<Channel> channels_;
  std::vector<Entry> entries_;  // in the order of the file
  Message state_;

  // While it is read.
  std::map<FrameId, std::size_t> frames_;  // number by identity
  std::set<FrameId> kept_;
  graph::Look processes_;
  std::vector<graph::ObservedFailure> failures_;
  std::size_t bytes_ = 0;
  std::size_t damaged_ = 0;  // chunks
  bool full_ = false;
};

}  // namespace cosegraph::monitor
