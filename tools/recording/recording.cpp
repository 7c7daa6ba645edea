#include "tools/recording/recording.hpp"

#include <algorithm>

#include "graph/control.hpp"
#include "idl/schema.hpp"

namespace cosegraph::recording {
namespace {

constexpr std::size_t kModelsKept = 2;  // the newest of a latched topic

void keep_model(std::deque<Entry>& models, const Entry& entry) {
  models.push_back(entry);
  if (models.size() > kModelsKept) models.pop_front();
}

}  // namespace

Recording::Recording(std::filesystem::path file, const graph::GraphDescription& graph,
                     std::vector<Topic> topics, RecordingOptions options)
    : file_(std::move(file)),
      graph_(graph::to_yaml(graph)),
      topics_(std::move(topics)),
      options_(options),
      tally_(topics_, graph::frame_history(graph)),
      models_(topics_.size()) {
  open(0);
}

void Recording::open(std::uint64_t time) {
  std::filesystem::path file = file_;
  if (options_.split)
    file.replace_filename(file_.stem().string() + "_" + std::to_string(files_.size()) +
                          file_.extension().string());
  writer_ = std::make_unique<McapWriter>(file, WriterOptions{.compressed = options_.compressed});
  files_.push_back(file);
  writer_->attach({.log_time = time,
                   .name = std::string(kGraphName),
                   .media_type = "application/yaml",
                   .data = graph_});
  std::map<std::string, std::uint16_t> schemas;
  channels_.clear();
  for (const auto& topic : topics_) {
    std::uint16_t& schema = schemas[topic.type];
    if (schema == 0)
      schema = writer_->add_schema(idl::wire_type(topic.type), std::string(idl::kSchemaEncoding),
                                   std::string(idl::idl_text(topic.type)));
    channels_.push_back(writer_->add_channel(topic.name, schema, std::string(idl::kMessageEncoding),
                                             to_metadata(topic)));
  }
}

void Recording::write(const Entry& entry) {
  if (options_.split && writer_->statistics().messages > 0 && !has_room(entry.sample->size())) {
    close("continued in the next file", std::vector<std::uint64_t>(topics_.size()));
    open(entry.time);
    for (const auto& models : models_)
      for (const auto& model : models) put(model, entry.time);
  }
  tally_.add(entry.topic, *entry.sample);
  put(entry, entry.time);
  if (topics_[entry.topic].latched) keep_model(models_[entry.topic], entry);
}

void Recording::put(const Entry& entry, std::uint64_t time) {
  writer_->write(
      {.channel = channels_[entry.topic],
       .sequence = static_cast<std::uint32_t>(idl::decode_header(*entry.sample).sequence),
       .log_time = time,
       .publish_time = entry.time,
       .data = *entry.sample});
}

bool Recording::has_room(std::uint64_t bytes) {
  if (options_.max_size == 0 || writer_->size() + bytes <= options_.max_size) return true;
  writer_->flush();  // only now it is known what the last messages take
  return writer_->size() + bytes <= options_.max_size;
}

bool Recording::full() {
  return !options_.split && !has_room(0);
}

void Recording::close(const std::string& ended, const std::vector<std::uint64_t>& lost) {
  completeness_ = tally_.completeness();
  completeness_.ended = ended;
  for (std::size_t i = 0; i < topics_.size(); ++i)
    completeness_.topics[topics_[i].name].lost = lost[i];
  writer_->add(to_metadata(completeness_));
  writer_->close();
}

Ring::Ring(std::vector<bool> latched, std::uint64_t nanoseconds, std::uint64_t bytes)
    : latched_(std::move(latched)),
      nanoseconds_(nanoseconds),
      room_(bytes),
      models_(latched_.size()) {}

void Ring::push(Entry entry) {
  bytes_ += entry.sample->size();
  entries_.push_back(std::move(entry));
  const std::uint64_t newest = entries_.back().time;
  while (entries_.front().time + nanoseconds_ < newest) drop_oldest();
  while (bytes_ > room_ && entries_.size() > 1) {
    drop_oldest();
    was_full_ = true;
  }
}

void Ring::drop_oldest() {
  const Entry& oldest = entries_.front();
  bytes_ -= oldest.sample->size();
  if (latched_[oldest.topic]) keep_model(models_[oldest.topic], oldest);
  entries_.pop_front();
}

std::vector<Entry> Ring::entries() const {
  std::vector<Entry> result;
  if (entries_.empty()) return result;
  for (const auto& models : models_)
    for (const auto& model : models)
      result.push_back({model.topic, entries_.front().time, model.sample});
  result.insert(result.end(), entries_.begin(), entries_.end());
  return result;
}

std::map<std::uint16_t, Topic> topics_in(const McapReader& reader) {
  std::map<std::uint16_t, Topic> result;
  try {
    for (const auto& [id, channel] : reader.channels()) {
      const auto schema = reader.schemas().find(channel.schema);
      if (schema == reader.schemas().end())
        throw InputError("channel " + channel.topic + " has no schema");
      result.emplace(id, topic_of(channel, schema->second));
    }
  } catch (const InputError& error) {
    throw InputError(reader.file().string() + ": " + error.what());
  }
  return result;
}

graph::GraphDescription graph_in(const McapReader& reader) {
  const auto attached = reader.attachment(kGraphName);
  if (!attached) throw InputError(reader.file().string() + ": no graph file is attached");
  return graph::parse(attached->data, reader.file().string() + "/" + std::string(kGraphName));
}

Completeness completeness_in(const McapReader& reader) {
  if (const auto metadata = reader.metadata(kCompletenessName)) {
    try {
      return completeness_of(*metadata);
    } catch (const InputError& error) {
      throw InputError(reader.file().string() + ": " + error.what());
    }
  }
  const std::map<std::uint16_t, Topic> topics = topics_in(reader);
  std::map<std::uint16_t, std::size_t> index;
  std::vector<Topic> all;
  for (const auto& [channel, topic] : topics) {
    index[channel] = all.size();
    all.push_back(topic);
  }
  Tally tally(std::move(all), graph::frame_history(graph_in(reader)));
  try {
    for (auto messages = reader.messages(); const auto message = messages.next();)
      tally.add(index.at(message->channel), message->data);
  } catch (const InputError& error) {
    throw InputError(reader.file().string() + ": " + error.what());
  }
  return tally.completeness();
}

}  // namespace cosegraph::recording
