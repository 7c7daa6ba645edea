#include "tools/recording/stage_frames.hpp"

#include <algorithm>

#include "tools/recording/recording.hpp"

namespace cosegraph::recording {
namespace {

graph::Sample copy_of(const Message& message) {
  return std::make_shared<idl::Bytes>(message.data.begin(), message.data.end());
}

}  // namespace

StageWiring wiring_of(const graph::GraphDescription& graph, const std::string& stage,
                      const graph::StageInfo& info) {
  const graph::StageNode* node = graph.stage(stage);
  if (node == nullptr) {
    std::vector<std::string> names;
    for (const auto& other : graph.stages) names.push_back(other.name);
    throw ParameterError("there is no stage '" + stage + "'" + did_you_mean(stage, names));
  }
  StageWiring wiring{.stage = stage};
  for (const auto& input : node->inputs) {
    const graph::PortInfo* port = info.input(input.port);
    if (port == nullptr)
      throw InputError("stage '" + stage + "' has no input '" + input.port + "' any more");
    (port->latched ? wiring.model_inputs : wiring.frame_inputs)[port->name] =
        graph::topic_name(graph, input.from_stage, input.from_port);
    wiring.types[port->name] = port->type;
  }
  for (const auto& port : info.outputs) {
    if (port.latched) continue;
    wiring.frame_outputs[port.name] = graph::topic_name(graph, stage, port.name);
    wiring.types[port.name] = port.type;
  }
  return wiring;
}

StageFrames::StageFrames(const McapReader& reader, StageWiring wiring, Want want, int window,
                         std::uint64_t from, std::uint64_t to)
    : wiring_(std::move(wiring)), want_(want), window_(static_cast<std::uint64_t>(window)) {
  const std::map<std::uint16_t, Topic> topics = topics_in(reader);
  std::string unknown;
  std::set<std::uint16_t> channels;
  const auto find = [&](const auto& ports, std::map<std::uint16_t, std::string>& port_of) {
    for (const auto& [port, name] : ports) {
      const auto found = std::ranges::find_if(
          topics, [&](const auto& entry) { return entry.second.name == name; });
      if (found == topics.end()) {
        unknown += (unknown.empty() ? "" : ", ") + name;
        continue;
      }
      port_of[found->first] = port;
      channels.insert(found->first);
    }
  };
  find(wiring_.frame_inputs, input_of_);
  if (want == Want::inputs_and_outputs) find(wiring_.frame_outputs, output_of_);
  std::map<std::uint16_t, std::string> model_channels;
  find(wiring_.model_inputs, model_channels);
  if (!unknown.empty())
    throw InputError(reader.file().string() + ": was recorded without " + unknown);
  for (const auto& [id, port] : model_channels) channels.erase(id);
  for (const auto& [id, topic] : topics) {
    if (topic.type == idl::type_name<idl::FrameFailure>()) failures_ = id;
    if (input_of_.contains(id))
      upstream_.insert(upstream_.end(), topic.upstream.begin(), topic.upstream.end());
  }
  if (failures_) channels.insert(*failures_);
  read_models(reader);
  messages_.emplace(reader.messages({.from = from, .to = to, .channels = std::move(channels)}));
}

void StageFrames::read_models(const McapReader& reader) {
  for (const auto& [port, topic] : wiring_.model_inputs) {
    auto& models = models_[port];
    Selection selection{.channels = std::set<std::uint16_t>{}};
    for (const auto& [id, channel] : reader.channels())
      if (channel.topic == topic) selection.channels->insert(id);
    for (auto messages = reader.messages(selection); const auto message = messages.next();)
      models.emplace_back(idl::decode_header(message->data).model_id, copy_of(*message));
  }
}

// False at the end of the recording.
bool StageFrames::read_message() {
  const auto message = messages_->next();
  if (!message) return false;
  const idl::FrameHeader header = idl::decode_header(message->data);
  const Identity identity{header.epoch, header.sequence};
  // What comes again, or for a frame that was handed out, is of no use.
  if (handed_out_ && identity <= *handed_out_) return true;
  if (message->channel == failures_) {
    const std::string reason = idl::decode<idl::FrameFailure>(message->data).reason;
    if (header.stage == wiring_.stage)
      open_[identity].failure = reason;
    else if (std::ranges::find(upstream_, header.stage) != upstream_.end())
      open_[identity].failed_before = header.stage;
    else
      return true;
    if (open_[identity].header.stage.empty()) open_[identity].header = header;
  } else if (const auto input = input_of_.find(message->channel); input != input_of_.end()) {
    RecordedFrame& frame = open_[identity];
    const std::uint32_t generation = frame.outputs.empty() ? 0 : frame.header.generation;
    frame.header = header;
    frame.header.generation = generation;
    frame.time = std::max(frame.time, message->log_time);
    frame.inputs[input->second] = copy_of(*message);
  } else {
    RecordedFrame& frame = open_[identity];
    frame.header = header;
    frame.outputs[output_of_.at(message->channel)] = copy_of(*message);
  }
  open_[identity].header.stage = wiring_.stage;
  newest_ = std::max(newest_.value_or(identity), identity);
  return true;
}

// Nothing more is to be expected for the oldest frame.
bool StageFrames::front_is_done() const {
  const auto& [identity, frame] = *open_.begin();
  if (!frame.failed_before.empty()) return true;
  const bool has_inputs = frame.inputs.size() == wiring_.frame_inputs.size();
  const bool has_outputs = want_ == Want::inputs || frame.failure ||
                           frame.outputs.size() == wiring_.frame_outputs.size();
  if (has_inputs && has_outputs) return true;
  // The graph has no more frames under way than its window; twice that is on the safe side.
  return newest_->first > identity.first || newest_->second > identity.second + 2 * window_;
}

RecordedFrame StageFrames::take_front() {
  auto node = open_.extract(open_.begin());
  handed_out_ = node.key();
  RecordedFrame frame = std::move(node.mapped());
  for (const auto& [port, topic] : wiring_.frame_inputs)
    if (!frame.inputs.contains(port)) frame.lacking.push_back(port);
  for (const auto& [port, models] : models_) {
    const auto wanted =
        std::ranges::find_if(models.rbegin(), models.rend(), [&](const auto& model) {
          return frame.header.model_id == 0 || model.first == frame.header.model_id;
        });
    if (wanted == models.rend())
      frame.lacking.push_back(port);
    else
      frame.inputs[port] = wanted->second;
  }
  return frame;
}

std::optional<RecordedFrame> StageFrames::next() {
  while (!at_end_ && (open_.empty() || !front_is_done())) at_end_ = !read_message();
  if (open_.empty()) return std::nullopt;
  return take_front();
}

}  // namespace cosegraph::recording
