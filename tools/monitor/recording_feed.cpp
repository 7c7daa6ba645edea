#include "tools/monitor/recording_feed.hpp"

#include <algorithm>

#include "core/error.hpp"
#include "graph/control.hpp"
#include "tools/monitor/channels.hpp"
#include "tools/recording/recording.hpp"

namespace cosegraph::monitor {

RecordingFeed::RecordingFeed(const std::filesystem::path& file, std::uint64_t first)
    : name_(file.filename().string()) {
  const recording::McapReader reader(file);
  graph_ = recording::graph_in(reader);
  // Places of channels, and the schemas of the time: types may have changed since.
  std::map<std::uint16_t, std::size_t> place;
  for (auto& [channel, topic] : recording::topics_in(reader)) {
    place[channel] = topics_.size();
    topics_.push_back(topic);
  }
  views_ = cloud_views_of(graph_, topics_);
  channels_ = channels_of(graph_, topics_, views_);
  for (const auto& [channel, at] : place)
    channels_[at].schema = reader.schemas().at(reader.channels().at(channel).schema).data;

  auto messages = reader.messages();
  for (;;) {
    try {
      const auto message = messages.next();
      if (!message) break;
      const std::size_t topic = place.at(message->channel);
      take(topics_[topic],
           {topic,
            {.time = message->log_time,
             .payload =
                 std::make_shared<const idl::Bytes>(message->data.begin(), message->data.end()),
             .keep = true}},
           first);
    } catch (const InputError&) {
      ++damaged_;
    }
  }
  if (first > 0 && kept_.empty())
    throw InputError(file.string() + ": it has " + std::to_string(frames_.size()) +
                     " frames, and none with the number " + std::to_string(first));

  GraphState state(graph_, topics_);
  state.hear(processes_, failures_);
  state.end(RunState::file);
  state.set_note(note(first));
  const std::uint64_t end = reader.statistics().end_time;
  state_ = {
      .time = end, .payload = to_payload(state.to_json(GraphState::Time{}, end)), .keep = true};
}

// Which part is shown, if it is not all.
std::string RecordingFeed::note(std::uint64_t first) const {
  std::string note;
  if (kept_.size() < frames_.size())
    note = "Frames " + std::to_string(first) + " to " + std::to_string(first + kept_.size() - 1) +
           " of " + std::to_string(frames_.size()) +
           ". Others: --from NUMBER, or 'cosegraph replay'.";
  if (damaged_ > 0)
    note += (note.empty() ? "" : " ") + std::to_string(damaged_) +
            " damaged parts of the file are left out.";
  return note;
}

void RecordingFeed::take(const Topic& topic, Entry entry, std::uint64_t first) {
  const idl::Bytes& bytes = *entry.message.payload;
  const idl::FrameHeader header = idl::decode_header(bytes);
  if (topic.type == "StageStatus") {
    const auto status = idl::decode<idl::StageStatus>(bytes);
    const graph::StageNode* node = graph_.stage(header.stage);
    if (node != nullptr && !status.candidate)
      processes_[graph::process_name(*node, status.replica)] = {header, status, {}};
    return;
  }
  if (topic.type == "FrameFailure")
    failures_.push_back({.stage = header.stage,
                         .frame = header.name,
                         .sequence = header.sequence,
                         .reason = idl::decode<idl::FrameFailure>(bytes).reason,
                         .heard = static_cast<std::int64_t>(entry.message.time)});
  if (topic.has_frames()) {
    const FrameId id{header.epoch, header.sequence};
    const std::size_t number = frames_.try_emplace(id, frames_.size()).first->second;
    const bool begins = number >= first && !full_ && kept_.size() < kMaxFrames;
    if (begins) kept_.insert(id);
    if (!kept_.contains(id)) return;
    bytes_ += bytes.size();
    full_ = full_ || bytes_ > kMaxBytes;
  }
  entries_.push_back(std::move(entry));
}

std::vector<Message> RecordingFeed::subscribe(std::size_t channel) {
  if (channel + 1 == channels_.size()) return {state_};
  if (channel >= topics_.size()) return draw(channel - topics_.size());
  std::vector<Message> result;
  for (const auto& entry : entries_)
    if (entry.topic == channel) result.push_back(entry.message);
  return result;
}

std::vector<Message> RecordingFeed::draw(std::size_t view) const {
  CloudViews joined(views_, kMaxFrames);
  std::vector<bool> wanted(views_.size(), false);
  wanted[view] = true;
  std::vector<Message> result;
  for (const auto& entry : entries_) {
    if (!topics_[entry.topic].has_frames()) continue;
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
