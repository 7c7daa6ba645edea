#include "tools/monitor/file_feed.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "idl/schema.hpp"
#include "inputs/inputs.hpp"
#include "io/cloud_io.hpp"
#include "io/file.hpp"
#include "model/model.hpp"
#include "pipeline/pipeline.hpp"
#include "tools/monitor/channels.hpp"
#include "tools/monitor/point_cloud.hpp"

namespace cosegraph::monitor {
namespace {

namespace fs = std::filesystem;

bool is_model_file(const fs::path& file) {
  return file.extension() == ".coseg";
}

// The points that have coordinates; files of sensors have others too.
struct Frame {
  Cloud cloud;
  std::vector<float> confidence;  // empty unless the labels are an answer
};

Frame read_frame(inputs::Reader& reader, const inputs::Item& item) {
  Frame frame{.cloud = reader.read(item, {})};
  if (item.view < 0 && !frame.cloud.label.empty())
    frame.confidence = io::read_column(item.file, "confidence");
  return frame;
}

Labelling to_labelling(Frame& frame) {
  Labelling labelling{.label_names = frame.cloud.label_names,
                      .point_label = frame.cloud.label,
                      .point_confidence = frame.confidence};
  frame.cloud.label.clear();
  frame.cloud.label_names.clear();
  return labelling;
}

}  // namespace

FileFeed::FileFeed(const std::vector<std::string>& paths, bool with_spectra) {
  pipeline::Config config = pipeline::config_from_name(pipeline::kBest);
  std::vector<std::string> clouds;
  for (const auto& path : paths) {
    if (is_model_file(path))
      add_model(path, config);
    else
      clouds.push_back(path);
  }
  if (with_spectra && !config.with_spectra)
    throw InputError("the model was trained without spectra");
  if (!clouds.empty()) add_clouds(clouds, with_spectra ? &config : nullptr);
  name_ = paths.size() == 1 ? fs::path(paths[0]).filename().string()
                            : std::to_string(paths.size()) + " files";
  add_state();
}

void FileFeed::add_model(const fs::path& file, pipeline::Config& config) {
  const Model model = model::from_bytes(io::read_file(file), file.string());
  pipeline::adopt_model(model, config);
  const idl::FrameHeader header{.stage = "model", .name = file.filename().string()};
  add("model/appearance", "AppearanceModel", nullptr, idl::encode(header, model.appearance));
  add("model/relations", "RelationModel", nullptr, idl::encode(header, model.relation));
}

void FileFeed::add_clouds(const std::vector<std::string>& paths, const pipeline::Config* spectra) {
  inputs::Reader reader;
  for (const auto& item : inputs::list(paths, {})) {
    Frame frame = read_frame(reader, item);
    const idl::FrameHeader header{
        .stage = "file", .source = "file", .sequence = frames_.size(), .name = item.name};
    const std::vector<std::int32_t> label = frame.cloud.label;
    if (!frame.confidence.empty())
      add("file/labelling", "Labelling", &header, idl::encode(header, to_labelling(frame)));
    if (spectra != nullptr) add_spectrum(header, frame.cloud, *spectra);
    add("file/cloud", "Cloud", &header, idl::encode(header, frame.cloud));
    add("file/cloud/points", "", &header, encode_point_cloud(frame.cloud, label, "label", 0));
  }
}

void FileFeed::add_spectrum(const idl::FrameHeader& header, Cloud cloud,
                            const pipeline::Config& config) {
  try {
    const source::Frame frame = source::prepare(std::move(cloud), config.extraction, config.source);
    Spectrum spectrum = spectra::compute(frame.cloud, config.spectra);
    // What is said of points here is said of the file's own: each dense point has one among them.
    std::vector<std::int32_t> own(frame.dense.size(), 0);
    for (std::size_t i = frame.input.dense_index.size(); i-- > 0;)
      if (const std::int32_t dense = frame.input.dense_index[i]; dense >= 0)
        own[static_cast<std::size_t>(dense)] = static_cast<std::int32_t>(i);
    for (auto& sample : spectrum.sample_dense) sample = own[static_cast<std::size_t>(sample)];
    add("file/reduced", "Cloud", &header, idl::encode(header, frame.cloud));
    add("file/spectrum", "Spectrum", &header, idl::encode(header, spectrum));
  } catch (const InputError& error) {
    throw InputError(header.name + ": " + error.what());
  }
}

void FileFeed::add(const std::string& topic, const std::string& type,
                   const idl::FrameHeader* header, idl::Bytes bytes) {
  bytes_ += bytes.size();
  if (bytes_ > kMaxBytes)
    throw InputError("the files take more than " + std::to_string(kMaxBytes >> 20U) +
                     " MB; open fewer of them");
  const std::size_t channel = channel_of(topic, type);
  Entry entry;
  if (header != nullptr) entry.frame = frames_.add(*header, 0, bytes.size());
  entry.message = {.payload = std::make_shared<const idl::Bytes>(std::move(bytes)), .keep = true};
  entries_[channel].push_back(std::move(entry));
}

std::size_t FileFeed::channel_of(const std::string& topic, const std::string& type) {
  const auto found = std::ranges::find(channels_, topic, &Channel::topic);
  if (found != channels_.end()) return static_cast<std::size_t>(found - channels_.begin());
  channels_.push_back(
      {.topic = topic,
       .encoding = std::string(idl::kMessageEncoding),
       .schema_name = type.empty() ? std::string(kPointCloudSchemaName) : idl::wire_type(type),
       .schema = std::string(type.empty() ? kPointCloudSchema : idl::idl_text(type)),
       .schema_encoding = std::string(idl::kSchemaEncoding)});
  entries_.emplace_back();
  return channels_.size() - 1;
}

void FileFeed::add_state() {
  nlohmann::ordered_json state = {{"graph", name_},
                                  {"state", "file"},
                                  {"stages", nlohmann::json::array()},
                                  {"failures", nlohmann::json::array()}};
  describe_frames(state, frames_, 0);
  parts_ = frames_.parts();
  const std::string text = state.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  channels_.push_back(state_channel("file", {}));
  entries_.push_back({{.message = {.payload = to_payload(text), .keep = true}}});
}

std::vector<Message> FileFeed::subscribe(std::size_t channel, std::optional<std::size_t> part) {
  std::vector<Message> result;
  for (const auto& [frame, message] : entries_[channel])
    if (!part || !frame || parts_[*part].contains(*frame)) result.push_back(message);
  return result;
}

bool is_viewable(const fs::path& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) return true;
  if (!fs::is_regular_file(path, error)) return false;
  const std::string extension = path.extension().string();
  return extension != ".yaml" && extension != ".yml";
}

}  // namespace cosegraph::monitor
