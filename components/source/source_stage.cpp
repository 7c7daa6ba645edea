#include "source/source.hpp"

#include "graph/ros2.hpp"
#include "graph/stage.hpp"
#include "idl/point_cloud2.hpp"
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

// Clouds of a ROS 2 topic. A frame is named after its stamp, in seconds.
class TopicInput {
 public:
  Fields describe() {
    const Fields limits{
        integer_field("frames", most_, 0, 1'000'000'000, "",
                      "the stream ends after so many frames; 0: never"),
        number_field("idle", idle_, 0.0, 1e6, "s",
                     "the stream ends when nothing has come for so long; 0: never")};
    return concatenated(
        graph::ros2::describe(topic_, "PointCloud2 topic that is read instead of path",
                              "clouds that wait while the window is full; of more, the newest"),
        limits);
  }

  bool is_wanted() const { return !topic_.name.empty(); }
  void open(int domain) { subscription_.emplace(topic_, domain); }

  // What came before its place was taken over has been seen by the process that had it.
  void skip(std::uint64_t frames) {
    taken_ = frames;
    if (frames > 0) subscription_->clear();
  }

  bool is_endless() const { return is_wanted() && most_ == 0 && idle_ == 0.0; }
  bool is_over() const {
    const auto silence = std::chrono::duration<double>(Clock::now() - newest_);
    return (most_ > 0 && taken_ >= static_cast<std::uint64_t>(most_)) ||
           (idle_ > 0.0 && newest_ != Clock::time_point() && silence.count() > idle_);
  }

  // Whether there is a frame, or none will come.
  bool ready(std::chrono::milliseconds patience) {
    if (newest_ == Clock::time_point()) newest_ = Clock::now();
    return is_over() || subscription_->wait(patience);
  }

  std::optional<std::string> next() {
    const graph::Sample message = is_over() ? nullptr : subscription_->take();
    if (message == nullptr) return std::nullopt;
    ++taken_;
    newest_ = Clock::now();
    fault_.clear();
    cloud_ = {};
    try {
      cloud_ = idl::decode_point_cloud2(*message);
    } catch (const InputError& error) {
      fault_ = error.what();
    }
    return name_of(cloud_.stamp);
  }

  // The frame that next() has named.
  Cloud read() const {
    try {
      if (!fault_.empty()) throw InputError(fault_);
      return idl::to_cloud(cloud_);
    } catch (const InputError& error) {
      throw InputError(topic_.name + ": " + error.what());
    }
  }

  std::uint64_t missed() { return subscription_->missed(); }
  std::string waiting_for() const { return subscription_->waiting_for(); }

 private:
  using Clock = std::chrono::steady_clock;

  // Stamps may stand still, or go back when a recording is played again.
  std::string name_of(std::int64_t stamp) {
    constexpr std::size_t kDigits = 9;
    std::string text = std::to_string(stamp);
    if (text.size() <= kDigits) text.insert(0, kDigits + 1 - text.size(), '0');
    text.insert(text.size() - kDigits, ".");
    if (stamp <= newest_stamp_) return text + "-" + std::to_string(taken_);
    newest_stamp_ = stamp;
    return text;
  }

  graph::ros2::Topic topic_;
  int most_ = 0;
  double idle_ = 0.0;
  std::optional<graph::ros2::Subscription> subscription_;
  std::uint64_t taken_ = 0;
  Clock::time_point newest_;  // when the newest frame was taken, or waiting began
  std::int64_t newest_stamp_ = 0;
  idl::PointCloud2 cloud_;
  std::string fault_;  // why the message is no cloud
};

class SourceStage final : public graph::SourceStage {
 public:
  std::string summary() const override {
    return "admits clouds, depth images and meshes from files, or clouds of a ROS 2 topic";
  }

  Fields parameters() override {
    Fields fields{
        list_field("path", paths_, "files, or folders of files: PLY, PCD, depth PNG, OFF"),
        text_field("labels", labels_,
                   "label file of the mesh; empty: NAME_labels.txt beside it, if there is one"),
        number_field("rate", rate_, 0.0, 1000.0, "Hz",
                     "inputs arrive at this rate; 0: as fast as the graph takes them"),
        choice_field("when_full", when_full_, "with a rate: what happens when the window is full")};
    fields = concatenated(std::move(fields), prefixed("ros2", topic_.describe()));
    fields = concatenated(std::move(fields), describe(params_));
    fields = concatenated(std::move(fields), prefixed("extract", describe(extraction_)));
    return concatenated(std::move(fields), prefixed("camera", describe(camera_)));
  }

  std::string recipe() override { return cosegraph::recipe(describe(params_)); }

  void start() override {
    if (!topic_.is_wanted()) {
      items_ = inputs::list(paths_, camera_, labels_);
      return;
    }
    if (rate_ > 0.0) throw ParameterError("rate: the frames of a topic have their own");
    topic_.open(domain());
  }

  bool live() const override { return topic_.is_wanted(); }
  bool endless() const override { return topic_.is_endless(); }
  bool ready(std::chrono::milliseconds patience) override {
    if (topic_.ready(patience)) return true;
    report(topic_.waiting_for());
    return false;
  }
  std::uint64_t missed() override { return topic_.missed(); }
  void skip(std::uint64_t count) override {
    if (live())
      topic_.skip(count);
    else
      graph::SourceStage::skip(count);
  }

  std::optional<std::string> next() override {
    if (live()) return topic_.next();
    if (next_ == items_.size()) return std::nullopt;
    report("reading", static_cast<double>(next_) / static_cast<double>(items_.size()));
    return items_[next_++].name;
  }

  void process(graph::Frame& frame) override {
    Cloud cloud = live() ? topic_.read() : reader_.read(items_[next_ - 1], camera_);
    source::Frame made = source::prepare(std::move(cloud), extraction_, params_);
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
  TopicInput topic_;
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
