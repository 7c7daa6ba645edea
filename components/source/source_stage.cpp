#include "source/source.hpp"

#include "graph/stage.hpp"
#include "inputs/inputs.hpp"

namespace cosegraph::stages {
namespace {

enum class WhenFull { wait, drop_oldest };

}  // namespace
}  // namespace cosegraph::stages

template <>
cosegraph::Names<cosegraph::stages::WhenFull> cosegraph::names<cosegraph::stages::WhenFull>() {
  using enum stages::WhenFull;
  static constexpr std::pair<stages::WhenFull, std::string_view> kTable[] = {
      {wait, "wait"}, {drop_oldest, "drop_oldest"}};
  return kTable;
}

namespace cosegraph::stages {
namespace {

class SourceStage final : public graph::SourceStage {
 public:
  std::string summary() const override {
    return "admits clouds, depth images and meshes from files";
  }

  Fields parameters() override {
    Fields fields{
        list_field("path", paths_, "files, or folders of files: PLY, PCD, depth PNG, OFF"),
        text_field("labels", labels_,
                   "label file of the mesh; empty: NAME_labels.txt beside it, if there is one"),
        number_field("rate", rate_, 0.0, 1000.0, "Hz",
                     "inputs arrive at this rate; 0: as fast as the graph takes them"),
        choice_field("when_full", when_full_, "with a rate: what happens when the window is full")};
    fields = concatenated(std::move(fields), describe(params_));
    fields = concatenated(std::move(fields), prefixed("extract", describe(extraction_)));
    return concatenated(std::move(fields), prefixed("camera", describe(camera_)));
  }

  std::string recipe() override { return cosegraph::recipe(describe(params_)); }

  void start() override { items_ = inputs::list(paths_, camera_, labels_); }

  std::optional<std::string> next() override {
    if (next_ == items_.size()) return std::nullopt;
    report("reading", static_cast<double>(next_) / static_cast<double>(items_.size()));
    return items_[next_++].name;
  }

  void process(graph::Frame& frame) override {
    const inputs::Item& item = items_[next_ - 1];
    source::Frame made = source::prepare(reader_.read(item, camera_), extraction_, params_);
    made.input.notes = std::move(made.notes);
    input_.put(frame, made.input);
    dense_.put(frame, made.dense);
    cloud_.put(frame, made.cloud);
  }

  double rate() const override { return rate_; }
  bool drop_when_full() const override { return when_full_ == WhenFull::drop_oldest; }

 private:
  graph::LatchedInput<AppearanceModel> model_{
      *this, "model", "the model that frames are worked on with", graph::Need::optional};
  graph::Output<Cloud> input_{*this, "input", "the input's own points, in its order"};
  graph::Output<Cloud> dense_{*this, "dense", "about 20000 points, for supervoxels"};
  graph::Output<Cloud> cloud_{*this, "cloud", "about 2400 points with normals"};
  std::vector<std::string> paths_;
  std::string labels_;
  double rate_ = 0.0;
  WhenFull when_full_ = WhenFull::wait;
  source::Params params_;
  source::Extraction extraction_;
  camera::Params camera_;
  std::vector<inputs::Item> items_;
  inputs::Reader reader_;
  std::size_t next_ = 0;
};

}  // namespace

std::unique_ptr<graph::Stage> make_source_stage() {
  return std::make_unique<SourceStage>();
}

}  // namespace cosegraph::stages
