#include "tools/monitor/cloud_views.hpp"

#include <algorithm>

#include "tools/monitor/point_cloud.hpp"

namespace cosegraph::monitor {

std::vector<CloudView> cloud_views_of(const graph::GraphDescription& graph,
                                      const std::vector<Topic>& topics) {
  std::vector<CloudView> views;
  for (const auto& topic : topics) {
    if (topic.type == "Cloud")
      views.push_back({.topic = topic.name, .type = topic.type});
    else if (topic.type == "Segments" || topic.type == "Labelling")
      views.push_back({.topic = topic.name,
                       .type = topic.type,
                       .clouds = clouds_of(graph, topics, topic.stage)});
  }
  return views;
}

CloudViews::CloudViews(std::vector<CloudView> views, std::size_t max_frames)
    : views_(std::move(views)), max_frames_(max_frames) {}

CloudViews::Frame& CloudViews::frame(const FrameId& id) {
  Frame& result = frames_[id];
  // An epoch's number says nothing about its age, but there are rarely two at a time.
  while (frames_.size() > max_frames_)
    frames_.erase(frames_.begin()->first == id ? std::next(frames_.begin()) : frames_.begin());
  return result;
}

std::vector<std::pair<std::size_t, idl::Bytes>> CloudViews::add(const std::string& topic,
                                                                const idl::Bytes& bytes,
                                                                const std::vector<bool>& wanted) {
  std::vector<std::pair<std::size_t, idl::Bytes>> result;
  const idl::FrameHeader header = idl::decode_header(bytes);
  Frame& frame = this->frame({header.epoch, header.sequence});
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const CloudView& view = views_[v];
    if (view.topic != topic || !wanted[v]) continue;
    if (view.type == "Segments")
      frame.ids[v] = idl::decode<Segments>(bytes).of_point;
    else if (view.type == "Labelling")
      frame.ids[v] = idl::decode<Labelling>(bytes).point_label;
    else
      result.emplace_back(v, encode_point_cloud(idl::decode<Cloud>(bytes), {}, "", header.stamp));
  }
  const bool is_awaited = std::ranges::any_of(views_, [&](const CloudView& view) {
    return wanted[static_cast<std::size_t>(&view - views_.data())] &&
           std::ranges::find(view.clouds, topic) != view.clouds.end();
  });
  if (is_awaited) frame.clouds[topic] = idl::decode<Cloud>(bytes);
  for (auto entry = frame.ids.begin(); entry != frame.ids.end();) {
    const auto& [v, ids] = *entry;
    const Cloud* cloud = nullptr;
    for (const auto& name : views_[v].clouds)
      if (const auto found = frame.clouds.find(name);
          cloud == nullptr && found != frame.clouds.end() && found->second.size() == ids.size())
        cloud = &found->second;
    if (cloud == nullptr) {
      ++entry;
      continue;
    }
    const char* name = views_[v].type == "Segments" ? "segment" : "label";
    result.emplace_back(v, encode_point_cloud(*cloud, ids, name, header.stamp));
    entry = frame.ids.erase(entry);
  }
  return result;
}

}  // namespace cosegraph::monitor
