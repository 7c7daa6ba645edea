// Joins what stages say about points with the clouds they say it of, and gives each as a
// foxglove.PointCloud: clouds themselves, segments, labellings. A plain data structure.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "tools/monitor/channel.hpp"
#include "tools/monitor/topics.hpp"

namespace cosegraph::monitor {

struct CloudView {
  std::string topic;  // Cloud, Segments or Labelling
  std::string type;
  std::vector<std::string> clouds;  // topics one of which has the points; empty if it is a cloud
};

// Every topic of `topics` that can be drawn as points.
std::vector<CloudView> cloud_views_of(const graph::GraphDescription& graph,
                                      const std::vector<Topic>& topics);

class CloudViews {
 public:
  // Frames of which something is missing are forgotten when so many newer ones have come.
  CloudViews(std::vector<CloudView> views, std::size_t max_frames);

  // Takes a message of `topic`; returns what is complete now, as (place of the view, message).
  // Only views in `wanted` are made. Throws InputError if the message cannot be read.
  std::vector<std::pair<std::size_t, idl::Bytes>> add(const std::string& topic,
                                                      const idl::Bytes& bytes,
                                                      const std::vector<bool>& wanted);

 private:
  using FrameId = std::pair<std::uint64_t, std::uint64_t>;  // epoch, sequence
  struct Frame {
    std::map<std::string, Cloud> clouds;                   // by topic
    std::map<std::size_t, std::vector<std::int32_t>> ids;  // by view, not yet given
  };

  Frame& frame(const FrameId& id);

  const std::vector<CloudView> views_;
  const std::size_t max_frames_;
  std::map<FrameId, Frame> frames_;
};

}  // namespace cosegraph::monitor
