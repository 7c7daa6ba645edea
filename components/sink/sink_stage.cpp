#include <filesystem>

#include "graph/ros2.hpp"
#include "graph/stage.hpp"
#include "idl/point_cloud2.hpp"
#include "io/cloud_io.hpp"
#include "io/file.hpp"
#include "sink/results.hpp"
#include "sink/sink.hpp"

namespace cosegraph::stages {
namespace {

enum class Format { ply, pcd };

}  // namespace
}  // namespace cosegraph::stages

template <>
cosegraph::Names<cosegraph::stages::Format> cosegraph::names<cosegraph::stages::Format>() {
  using enum stages::Format;
  static constexpr std::pair<stages::Format, std::string_view> kTable[] = {{ply, "ply"},
                                                                           {pcd, "pcd"}};
  return kTable;
}

namespace cosegraph::stages {
namespace {

namespace fs = std::filesystem;

class SinkStage final : public graph::Stage {
 public:
  std::string summary() const override {
    return "writes labelled clouds, figures and pictures; publishes labelled clouds to ROS 2";
  }

  Fields parameters() override {
    Fields fields{
        text_field("folder", folder_,
                   "where the results go; made if it does not exist. Empty: nothing is "
                   "written, for those who publish"),
        choice_field("format", format_, "of the labelled clouds"),
        boolean_field("picture", picture_, "a PNG per frame: query, segments, labels, truth"),
        text_field("reference", reference_,
                   "labelled cloud shown as first panel of the pictures; empty: none")};
    return concatenated(
        std::move(fields),
        prefixed("ros2", graph::ros2::describe(
                             topic_, "PointCloud2 topic of the labelled clouds; empty: none",
                             "clouds kept for slow subscribers")));
  }

  void start() override {
    if (!topic_.name.empty()) publisher_.emplace(topic_, domain());
    if (folder_.empty() && !publisher_)
      throw ParameterError("folder: neither an output folder nor ros2.topic is given");
    if (!folder_.empty()) open_folder();
  }

  void process(graph::Frame& frame) override {
    const Cloud input = input_.get(frame);
    const Labelling labelling = labelling_.get(frame);
    const sink::Labelled labelled = sink::to_input(input, labelling);
    if (publisher_)
      publisher_->publish(idl::encode(idl::to_point_cloud2(labelled.cloud, labelled.confidence)));
    if (!folder_.empty()) write(frame, input, labelling, labelled);
  }

  void end() override {
    if (publisher_) publisher_->await_subscribers(kPatience);
  }

 private:
  static constexpr std::chrono::seconds kPatience{2};  // for subscribers at the stream's end

  void open_folder() {
    std::error_code error;
    fs::create_directories(folder_, error);
    if (error) throw InputError(folder_ + ": cannot be made: " + error.message());
    // Found out now rather than after the first frame.
    if (!resumed()) begin_results("", "");
    if (!reference_.empty()) reference_cloud_ = io::read_cloud(reference_);
  }

  void write(const graph::Frame& frame, const Cloud& input, const Labelling& labelling,
             const sink::Labelled& labelled) {
    const Segments segments = segments_.get(frame);
    const fs::path base = fs::path(folder_) / file_name(frame.name());
    if (picture_) write_picture(base.string() + ".png", frame.name(), input, segments, labelling);
    const io::Column confidence{.name = "confidence", .value = labelled.confidence};
    io::write_cloud(base.string() + "." + std::string(to_name(format_)), labelled.cloud,
                    {&confidence, 1});
    add_result(sink::result_of(frame.name(), input, segments, labelling));
  }

  void begin_results(std::string_view earlier, std::string_view redone) {
    results_.emplace(earlier, redone);
    io::write_file(results_file(), results_->begun());
  }

  // A process of this stage that came before may have written the frame and then died.
  void add_result(const sink::Result& result) {
    if (!results_ || results_->began_with(result.name))
      begin_results(fs::exists(results_file()) ? io::read_file(results_file()) : "", result.name);
    const auto growth = results_->add(result);
    try {
      io::replace_end(results_file(), growth.at, growth.bytes);
    } catch (const Error&) {
      results_.reset();  // the next frame goes on with what the file holds
      throw;
    }
  }

  // A frame's name comes with its messages, and must not lead out of the folder.
  static const std::string& file_name(const std::string& frame) {
    if (frame.empty() || frame.find('/') != std::string::npos ||
        frame.find('\0') != std::string::npos)
      throw InputError("the frame's name '" + frame + "' cannot be that of a file");
    return frame;
  }

  fs::path results_file() const { return fs::path(folder_) / "results.json"; }

  void write_picture(const fs::path& file, const std::string& name, const Cloud& input,
                     const Segments& segments, const Labelling& labelling) const {
    io::write_file(
        file, sink::picture_of({.name = name,
                                .input = &input,
                                .segments = &segments,
                                .labelling = &labelling,
                                .reference = reference_.empty() ? nullptr : &reference_cloud_}));
  }

  graph::Input<Cloud> input_{*this, "input", "the input's own points"};
  graph::Input<Segments> segments_{*this, "segments", "for the pictures and the oracle"};
  graph::Input<Labelling> labelling_{*this, "labelling", "what is written"};
  graph::ros2::Topic topic_{.depth = 10};
  std::optional<graph::ros2::Publisher> publisher_;
  std::string folder_;
  std::string reference_;
  Format format_ = Format::ply;
  bool picture_ = false;
  Cloud reference_cloud_;
  std::optional<sink::ResultsText> results_;
};

}  // namespace

std::unique_ptr<graph::Stage> make_sink_stage() {
  return std::make_unique<SinkStage>();
}

}  // namespace cosegraph::stages
