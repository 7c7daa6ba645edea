// Files that the tools write or read as a feed that never changes: each cloud is a frame, labels
// with a confidence beside them are a labelling; a model file gives its two halves. On request
// with the spectrum of each cloud.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tools/monitor/channel.hpp"
#include "tools/monitor/frame_index.hpp"

namespace cosegraph::pipeline {
struct Config;
}

namespace cosegraph::monitor {

class FileFeed final : public Feed {
 public:
  // Clouds, depth images, meshes (seen by the virtual camera), models; folders stand for the clouds
  // in them. Everything is read now. Throws InputError naming the file, also if all of them take
  // more memory than kMaxBytes.
  // Spectra are those that the model among the files was trained with, if there is one.
  explicit FileFeed(const std::vector<std::string>& paths, bool with_spectra = false);

  static constexpr std::size_t kMaxBytes = 1U << 30U;

  std::string name() const override { return name_; }
  const std::vector<Channel>& channels() const override { return channels_; }
  void open(Deliver) override {}
  std::vector<Message> subscribe(std::size_t channel, std::optional<std::size_t> part) override;
  void unsubscribe(std::size_t) override {}
  std::size_t parts() const override { return parts_.size(); }

 private:
  struct Entry {
    std::optional<std::size_t> frame;
    Message message;
  };

  // Gives `config` what the model was trained with.
  void add_model(const std::filesystem::path& file, pipeline::Config& config);
  void add_clouds(const std::vector<std::string>& paths, const pipeline::Config* spectra);
  void add_spectrum(const idl::FrameHeader& header, Cloud cloud, const pipeline::Config& config);
  // `header`: of the frame; none: the message belongs to none.
  void add(const std::string& topic, const std::string& type, const idl::FrameHeader* header,
           idl::Bytes bytes);
  void add_state();
  std::size_t channel_of(const std::string& topic, const std::string& type);

  std::string name_;
  FrameIndex frames_;
  std::vector<FrameIndex::Range> parts_;
  std::vector<Channel> channels_;
  std::vector<std::vector<Entry>> entries_;  // per channel
  std::size_t bytes_ = 0;
};

// Whether a command's argument names a file or folder that FileFeed opens, rather than a graph.
bool is_viewable(const std::filesystem::path& path);

}  // namespace cosegraph::monitor
