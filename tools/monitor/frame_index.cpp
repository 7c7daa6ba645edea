#include "tools/monitor/frame_index.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace cosegraph::monitor {

std::size_t FrameIndex::add(const idl::FrameHeader& header, std::uint64_t time, std::size_t bytes) {
  const auto [known, is_new] = number_.try_emplace({header.epoch, header.sequence}, frames_.size());
  if (is_new)
    frames_.push_back({.epoch = header.epoch,
                       .sequence = header.sequence,
                       .name = header.name,
                       .begin = time,
                       .end = time});
  Frame& frame = frames_[known->second];
  frame.begin = std::min(frame.begin, time);
  frame.end = std::max(frame.end, time);
  frame.bytes += bytes;
  return known->second;
}

std::optional<std::size_t> FrameIndex::number_of(const idl::FrameHeader& header) const {
  const auto found = number_.find({header.epoch, header.sequence});
  return found == number_.end() ? std::nullopt : std::optional(found->second);
}

FrameIndex::Range FrameIndex::range(std::size_t from, std::size_t max_frames,
                                    std::size_t max_bytes) const {
  Range range{from, from};
  std::size_t bytes = 0;
  while (range.to < size() && range.to - from < max_frames) {
    bytes += frames_[range.to].bytes;
    if (bytes > max_bytes && range.to > from) break;
    ++range.to;
  }
  return range;
}

std::vector<FrameIndex::Range> FrameIndex::parts() const {
  std::vector<Range> parts;
  for (std::size_t from = 0; from < size(); from = parts.back().to)
    parts.push_back(range(from, kPartFrames, kPartBytes));
  return parts;
}

void describe_frames(nlohmann::ordered_json& state, const FrameIndex& frames, std::size_t first) {
  constexpr std::uint64_t kMillisecond = 1'000'000;
  auto list = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < frames.size(); ++i)
    list.push_back({{"epoch", std::to_string(frames[i].epoch)},
                    {"sequence", frames[i].sequence},
                    {"name", frames[i].name},
                    {"time", frames[i].begin / kMillisecond}});
  auto starts = nlohmann::ordered_json::array();
  for (const auto& part : frames.parts()) starts.push_back(part.from);
  state["frames"] = std::move(list);
  state["parts"] = std::move(starts);
  state["first"] = first;
}

}  // namespace cosegraph::monitor
