#include "tools/monitor/recording_feed.hpp"

#include <algorithm>

#include "core/error.hpp"
#include "graph/control.hpp"
#include "tools/monitor/channels.hpp"
#include "tools/recording/recording.hpp"

namespace cosegraph::monitor {
namespace {

Message message_of(std::uint64_t time, std::span<const std::uint8_t> data) {
  return {.time = time,
          .payload = std::make_shared<const idl::Bytes>(data.begin(), data.end()),
          .keep = true};
}

// By epoch: of the frames before it the recording, which began in their midst, has only a part.
std::map<std::uint64_t, std::uint64_t> first_whole_frames(const recording::McapReader& reader) {
  std::map<std::uint64_t, std::uint64_t> result;
  try {
    for (const auto& stretch : recording::completeness_in(reader).stretches)
      result[stretch.frames.epoch] = stretch.frames.first;
  } catch (const InputError&) {
    result.clear();  // damaged: what is there is shown
  }
  return result;
}

}  // namespace

RecordingFeed::RecordingFeed(const std::filesystem::path& file, std::uint64_t first)
    : name_(file.filename().string()),
      reader_(file),
      graph_(recording::graph_in(reader_)),
      first_whole_(first_whole_frames(reader_)) {
  for (auto& [channel, topic] : recording::topics_in(reader_)) {
    place_[channel] = topics_.size();
    topics_.push_back(topic);
  }
  views_ = cloud_views_of(graph_, topics_);
  channels_ = channels_of(graph_, topics_, views_);
  // The schemas of the time: types may have changed since.
  for (const auto& [channel, at] : place_)
    channels_[at].schema = reader_.schemas().at(reader_.channels().at(channel).schema).data;

  const std::size_t damaged =
      read({}, [this](std::size_t topic, std::uint64_t time, std::span<const std::uint8_t> data) {
        survey(topics_[topic], time, data);
      });
  if (first > 0 && first >= frames_.size())
    throw InputError(file.string() + ": it has " + std::to_string(frames_.size()) +
                     " frames, and none with the number " + std::to_string(first));
  parts_ = frames_.parts();
  default_ = frames_.range(first, kMaxFrames, kMaxBytes);

  GraphState state(graph_, topics_);
  state.hear(std::move(processes_), failures_);
  state.end(RunState::file);
  state.set_frames(frames_, first);
  if (damaged > 0)
    state.set_note(std::to_string(damaged) + " damaged parts of the file are left out.");
  const std::uint64_t end = reader_.statistics().end_time;
  state_ = {
      .time = end, .payload = to_payload(state.to_json(GraphState::Time{}, end)), .keep = true};
}

// Returns how many damaged chunks were left out.
template <class Take>
std::size_t RecordingFeed::read(const recording::Selection& selection, const Take& take) const {
  std::size_t damaged = 0;
  auto messages = reader_.messages(selection);
  for (;;) {
    try {
      const auto message = messages.next();
      if (!message) return damaged;
      take(place_.at(message->channel), message->log_time, message->data);
    } catch (const InputError&) {
      ++damaged;
    }
  }
}

void RecordingFeed::survey(const Topic& topic, std::uint64_t time,
                           std::span<const std::uint8_t> data) {
  const idl::FrameHeader header = idl::decode_header(data);
  if (topic.has_frames()) {
    const auto first = first_whole_.find(header.epoch);
    if (first == first_whole_.end() || header.sequence >= first->second)
      frames_.add(header, time, data.size());
    return;
  }
  if (topic.type == "StageStatus") {
    const auto status = idl::decode<idl::StageStatus>(data);
    const graph::StageNode* node = graph_.stage(header.stage);
    if (node != nullptr && !status.candidate)
      processes_[graph::process_name(*node, status.replica)] = {header, status, {}};
    return;
  }
  if (topic.type == "FrameFailure")
    failures_.push_back({.stage = header.stage,
                         .frame = header.name,
                         .sequence = header.sequence,
                         .reason = idl::decode<idl::FrameFailure>(data).reason,
                         .heard = static_cast<std::int64_t>(time)});
  const auto at = static_cast<std::size_t>(&topic - topics_.data());
  lasting_.push_back({at, message_of(time, data)});
}

void RecordingFeed::load(FrameIndex::Range range) {
  if (range == loaded_) return;
  entries_.clear();
  loaded_ = {};
  recording::Selection selection{.from = UINT64_MAX, .to = 0, .channels = {{}}};
  for (std::size_t i = range.from; i < range.to; ++i) {
    selection.from = std::min(selection.from, frames_[i].begin);
    selection.to = std::max(selection.to, frames_[i].end + 1);
  }
  for (const auto& [channel, topic] : place_)
    if (topics_[topic].has_frames()) selection.channels->insert(channel);
  read(selection, [&](std::size_t topic, std::uint64_t time, std::span<const std::uint8_t> data) {
    const auto number = frames_.number_of(idl::decode_header(data));
    if (number && range.contains(*number)) entries_.push_back({topic, message_of(time, data)});
  });
  loaded_ = range;
}

std::vector<Message> RecordingFeed::subscribe(std::size_t channel,
                                              std::optional<std::size_t> part) {
  if (channel + 1 == channels_.size()) return {state_};
  const bool is_view = channel >= topics_.size();
  const bool has_frames = is_view || topics_[channel].has_frames();
  if (has_frames) load(part ? parts_[*part] : default_);
  if (is_view) return draw(channel - topics_.size());
  std::vector<Message> result;
  for (const auto& entry : has_frames ? entries_ : lasting_)
    if (entry.topic == channel) result.push_back(entry.message);
  return result;
}

std::vector<Message> RecordingFeed::draw(std::size_t view) const {
  CloudViews joined(views_, kMaxFrames);
  std::vector<bool> wanted(views_.size(), false);
  wanted[view] = true;
  std::vector<Message> result;
  for (const auto& entry : entries_) {
    try {
      for (auto& [drawn, bytes] :
           joined.add(topics_[entry.topic].name, *entry.message.payload, wanted))
        result.push_back({.time = entry.message.time,
                          .payload = std::make_shared<const idl::Bytes>(std::move(bytes)),
                          .keep = true});
    } catch (const InputError&) {
      continue;  // of another version of the type
    }
  }
  return result;
}

}  // namespace cosegraph::monitor
