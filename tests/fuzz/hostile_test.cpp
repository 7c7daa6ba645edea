// Every stage with hostile samples on its inputs, over DDS: the frame that such a sample claims
// fails at that stage, the frame behind it is processed.
#include <gmock/gmock.h>
#include <unistd.h>

#include <atomic>
#include <limits>
#include <numeric>
#include <sstream>
#include <thread>

#include "fuzz/scene.hpp"
#include "graph/dds.hpp"
#include "graph/observer.hpp"
#include "graph/runtime.hpp"
#include "idl/inspect.hpp"
#include "io/file.hpp"

namespace cosegraph::stages {

std::unique_ptr<graph::Stage> make_supervoxels_stage();
std::unique_ptr<graph::Stage> make_cpc_stage();
std::unique_ptr<graph::Stage> make_descriptors_stage();
std::unique_ptr<graph::Stage> make_spectra_stage();
std::unique_ptr<graph::Stage> make_fisher_stage();
std::unique_ptr<graph::Stage> make_svm_stage();
std::unique_ptr<graph::Stage> make_astar_stage();
std::unique_ptr<graph::Stage> make_training_stage();
std::unique_ptr<graph::Stage> make_sink_stage();

}  // namespace cosegraph::stages

namespace cosegraph::graph {
namespace {

using namespace std::chrono_literals;
using fuzz::Scene;
using idl::Bytes;
using idl::FrameHeader;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::int32_t kHuge = 1 << 30;

const Scene& scene() {
  static const Scene scene = fuzz::make_scene(fuzz::small_training());
  return scene;
}

// -- what the stage under test is fed with --------------------------------------------------------

std::atomic<std::uint64_t> allowed = 0;  // frames that the feeder may give
std::atomic<std::uint64_t> epoch = 0;    // of the feeder's frames, once it has given one

// Gives the same good frame again and again.
class Feeder final : public SourceStage {
 public:
  std::string summary() const override { return "frames as many as are allowed"; }
  std::optional<std::string> next() override {
    while (given_ == allowed)
      if (stopping())
        return std::nullopt;
      else
        std::this_thread::sleep_for(1ms);
    return "frame " + std::to_string(given_++);
  }
  void process(Frame& frame) override {
    cloud_.put(frame, scene().cloud);
    supervoxels_.put(frame, scene().supervoxels);
    segments_.put(frame, scene().segments);
    descriptors_.put(frame, scene().descriptors);
    spectrum_.put(frame, scene().spectrum);
    encodings_.put(frame, scene().encodings);
    scores_.put(frame, scene().scores);
    labelling_.put(frame, scene().labelling);
    epoch = frame.header().epoch;
  }

 private:
  LatchedInput<AppearanceModel> model_{*this, "model", ""};
  Output<Cloud> cloud_{*this, "cloud", ""};
  Output<Supervoxels> supervoxels_{*this, "supervoxels", ""};
  Output<Segments> segments_{*this, "segments", ""};
  Output<Descriptors> descriptors_{*this, "descriptors", ""};
  Output<Spectrum> spectrum_{*this, "spectrum", ""};
  Output<Encodings> encodings_{*this, "encodings", ""};
  Output<Scores> scores_{*this, "scores", ""};
  Output<Labelling> labelling_{*this, "labelling", ""};
  std::uint64_t given_ = 0;
};

class Provider final : public Stage {
 public:
  std::string summary() const override { return "the model"; }
  void start() override {
    appearance_.put(scene().model.appearance);
    relations_.put(scene().model.relation);
  }
  void process(Frame&) override {}

 private:
  LatchedOutput<AppearanceModel> appearance_{*this, "appearance", ""};
  LatchedOutput<RelationModel> relations_{*this, "relations", ""};
};

// -- hostile values -------------------------------------------------------------------------------

template <class Value>
using Changes = std::vector<std::pair<const char*, void (*)(Value&)>>;

void changes_of(Changes<Cloud>& all) {
  all = {{"a coordinate too few", [](Cloud& c) { c.xyz.pop_back(); }},
         {"normals too few", [](Cloud& c) { c.normal.resize(c.normal.size() - 3); }},
         {"scale that is NaN", [](Cloud& c) { c.scale = kNan; }},
         {"width that is huge", [](Cloud& c) { c.width = ~0U; }},
         {"label that does not exist", [](Cloud& c) { c.label[0] = 99; }},
         {"dense points before the first", [](Cloud& c) { c.dense_index[0] = -7; }}};
}

void changes_of(Changes<Supervoxels>& all) {
  all = {{"centroid that is NaN", [](Supervoxels& s) { s.centroid[1] = kNan; }},
         {"normals too few", [](Supervoxels& s) { s.normal.pop_back(); }},
         {"point of none", [](Supervoxels& s) { s.of_point[0] = kHuge; }},
         {"neighbour that does not exist", [](Supervoxels& s) {
            s.adjacency[0] = {0, 99};
          }}};
}

void changes_of(Changes<Segments>& all) {
  all = {{"huge number of them", [](Segments& s) { s.count = kHuge; }},
         {"negative number of them", [](Segments& s) { s.count = -1; }},
         {"point of none", [](Segments& s) { s.of_point[0] = kHuge; }},
         {"supervoxel of none", [](Segments& s) { s.of_supervoxel[0] = -5; }},
         {"concavities too few", [](Segments& s) { s.concavity.pop_back(); }}};
}

void changes_of(Changes<Descriptors>& all) {
  all = {
      {"number that is NaN", [](Descriptors& d) { d.channels[0].value[2] = kNan; }},
      {"keypoint that does not exist", [](Descriptors& d) { d.channels[0].keypoint[0] = kHuge; }},
      {"dimension that is huge", [](Descriptors& d) { d.channels[0].dimension = kHuge; }},
      {"other recipe", [](Descriptors& d) { d.recipe = "no such"; }},
      {"no channel", [](Descriptors& d) { d.channels.clear(); }}};
}

void changes_of(Changes<Spectrum>& all) {
  all = {{"eigenfunction that is NaN", [](Spectrum& s) { s.eigenfunction[0] = kNan; }},
         {"eigenvalue too few", [](Spectrum& s) { s.eigenvalue.pop_back(); }},
         {"sample that is no point", [](Spectrum& s) { s.sample[0] = kHuge; }},
         {"point of no sample", [](Spectrum& s) { s.nearest_sample[0] = kHuge; }},
         {"other recipe", [](Spectrum& s) { s.recipe = "no such"; }}};
}

void changes_of(Changes<Encodings>& all) {
  all = {{"number that is NaN", [](Encodings& e) { e.value[0] = kNan; }},
         {"huge number of segments", [](Encodings& e) { e.segment_count = kHuge; }},
         {"packet of no segment", [](Encodings& e) { e.segment[0] = 99; }},
         {"dimension that is huge", [](Encodings& e) { e.dimension = kHuge; }},
         {"other dimension", [](Encodings& e) {
            e.dimension = 1;
            e.value.resize(e.segment.size());
          }}};
}

void changes_of(Changes<Scores>& all) {
  all = {{"probability that is NaN", [](Scores& s) { s.probability[0] = kNan; }},
         {"huge number of segments", [](Scores& s) { s.segment_count = kHuge; }},
         {"probability too few", [](Scores& s) { s.probability.pop_back(); }},
         {"majority that does not exist", [](Scores& s) { s.majority = 99; }},
         {"one segment", [](Scores& s) {
            s.segment_count = 1;
            s.probability.resize(s.label_names.size());
          }}};
}

void changes_of(Changes<Labelling>& all) {
  all = {{"label that does not exist", [](Labelling& l) { l.point_label[0] = kHuge; }},
         {"confidences too few", [](Labelling& l) { l.point_confidence.pop_back(); }},
         {"no points", [](Labelling& l) {
            l.point_label.clear();
            l.point_confidence.clear();
          }}};
}

// A message behind a header.
struct Hostile {
  std::string what;
  std::function<Bytes(FrameHeader)> message;
};

// The longest list of numbers in `node` that stands in the message.
std::span<const std::uint8_t> longest_list(const idl::Node& node) {
  const bool stands_there = node.is_list && node.unpacked == nullptr;
  std::span<const std::uint8_t> longest = stands_there ? node.numbers : decltype(node.numbers){};
  for (const auto& member : node.members)
    if (const auto list = longest_list(member); list.size() > longest.size()) longest = list;
  return longest;
}

// With a list that claims to have two thousand million numbers.
Bytes with_huge_length(std::string_view type, Bytes message) {
  const auto list = longest_list(idl::inspect(type, message));
  const auto at = static_cast<std::size_t>(list.data() - message.data());
  message.at(at - 1) = 0x7f;
  return message;
}

template <class Value>
std::vector<Hostile> hostile(const Value& good) {
  std::vector<Hostile> all{
      {"message cut short",
       [&](const FrameHeader& header) {
         Bytes message = idl::encode(header, good);
         message.resize(message.size() - message.size() / 4);
         return message;
       }},
      {"huge length",
       [&](const FrameHeader& header) {
         return with_huge_length(idl::type_name<Value>(), idl::encode(header, good));
       }},
      {"bytes behind the header", [&](const FrameHeader& header) {
         Bytes message = idl::encode(header, good);
         const std::size_t begin = idl::encode(header, idl::StreamEnd{}).size();
         for (std::size_t i = begin; i < message.size(); ++i)
           message[i] = static_cast<std::uint8_t>(0xa5 + 31 * i);
         return message;
       }}};
  Changes<Value> changes;
  changes_of(changes);
  for (const auto& [what, change] : changes)
    all.push_back({what, [&, change = change](const FrameHeader& header) {
                     Value value = good;
                     change(value);
                     return idl::encode(header, value);
                   }});
  return all;
}

// What `take` makes of the good value that the feeder gives on `output`.
template <class Take>
auto with_good(const std::string& output, Take take) {
  const Scene& good = scene();
  if (output == "cloud") return take(good.cloud);
  if (output == "supervoxels") return take(good.supervoxels);
  if (output == "segments") return take(good.segments);
  if (output == "descriptors") return take(good.descriptors);
  if (output == "spectrum") return take(good.spectrum);
  if (output == "encodings") return take(good.encodings);
  if (output == "scores") return take(good.scores);
  return take(good.labelling);
}

// -- stages ---------------------------------------------------------------------------------------

struct Kind {
  std::string name;
  std::unique_ptr<Stage> (*make)();
  std::string params;
};

std::ostream& operator<<(std::ostream& out, const Kind& kind) {
  return out << kind.name;
}

const Kind kKinds[] = {
    {"supervoxels", stages::make_supervoxels_stage, "voxel: 0.08, seed: 0.25"},
    {"cpc", stages::make_cpc_stage, ""},
    {"descriptors", stages::make_descriptors_stage, "channels: ['fpfh:0.3:0.25'], threads: 1"},
    {"spectra", stages::make_spectra_stage, "samples: 30, eigenpairs: 4"},
    {"fisher", stages::make_fisher_stage, "clusters: 3, packets: 2"},
    {"svm", stages::make_svm_stage, ""},
    {"astar", stages::make_astar_stage, "spatial: iso"},
    {"training", stages::make_training_stage, ""},
    {"sink", stages::make_sink_stage, "folder: FOLDER"}};

// The output of the feeder, or of the provider, that feeds a port.
std::string output_for(const PortInfo& port) {
  static const std::map<std::string, std::string> kOutputs{{"Cloud", "cloud"},
                                                           {"Supervoxels", "supervoxels"},
                                                           {"Segments", "segments"},
                                                           {"Descriptors", "descriptors"},
                                                           {"Spectrum", "spectrum"},
                                                           {"Encodings", "encodings"},
                                                           {"Scores", "scores"},
                                                           {"Labelling", "labelling"},
                                                           {"AppearanceModel", "appearance"},
                                                           {"RelationModel", "relations"}};
  return kOutputs.at(port.type);
}

std::vector<PortInfo> inputs_of(const Kind& kind) {
  return kind.make()->inputs();
}

GraphDescription graph_of(const Kind& kind, const std::filesystem::path& folder) {
  std::ostringstream text;
  text << "version: 1\ngraph: hostile\nstages:\n"
       << "  feeder: {use: feeder, inputs: {model: provider/appearance}}\n"
       << "  provider: {use: provider}\n"
       << "  stage:\n    use: " << kind.name << "\n    inputs:\n";
  for (const auto& port : inputs_of(kind))
    text << "      " << port.name << ": " << (port.latched ? "provider/" : "feeder/")
         << output_for(port) << '\n';
  std::string params = kind.params;
  if (const auto at = params.find("FOLDER"); at != std::string::npos)
    params.replace(at, 6, folder.string());
  text << "    params: {" << params << "}\n";
  std::vector<Fault> faults;
  GraphDescription graph = parse(text.str(), "test.yaml", faults);
  for (const auto& fault : faults) ADD_FAILURE() << fault.message;
  graph.instance = "hostile-" + std::to_string(::getpid());
  graph.one_process = true;
  return graph;
}

class HostileSamples : public testing::TestWithParam<Kind> {
 protected:
  void SetUp() override {
    allowed = 0;
    epoch = 0;
    graph_ = graph_of(GetParam(), folder_.path());
    stranger_ = std::make_unique<Participant>(graph_, "stranger");
    observer_ = std::make_unique<Observer>(graph_);
    run("provider", std::make_unique<Provider>());
    run("stage", GetParam().make());
    run("feeder", std::make_unique<Feeder>());
  }

  void TearDown() override {
    for (const auto& [name, runner] : runners_) runner->request_stop();
    runners_.clear();
  }

  void run(const std::string& name, std::unique_ptr<Stage> stage) {
    apply_params(graph_, *graph_.stage(name), *stage);
    runners_[name] = std::make_unique<StageRunner>(graph_, name, std::move(stage),
                                                   RunnerOptions{.leaves = {"stage"}});
  }

  idl::Account account() const { return runners_.at("feeder")->status().account; }

  std::uint64_t heard_on(const std::string& output) const {
    const auto status = runners_.at("stage")->status();
    std::uint64_t messages = 0;
    for (const auto& port : status.ports)
      if (port.topic == topic_name(graph_, "feeder", output)) messages += port.messages;
    return messages;
  }

  // Lets so many frames through, and waits for what became of them.
  void give(std::uint64_t frames) {
    allowed += frames;
    await([&] { return over(account()) == allowed; });
  }

  static std::uint64_t over(const idl::Account& account) {
    return account.labelled + account.consumed + account.failed;
  }

  void await(const std::function<bool()>& condition) {
    for (int i = 0; i < 6000 && !condition(); ++i) std::this_thread::sleep_for(5ms);
    ASSERT_TRUE(condition()) << "in vain for half a minute";
  }

  std::string failure_of(std::uint64_t sequence) {
    for (int i = 0; i < 100; ++i, observer_->wait(50ms))
      for (const auto& failure : observer_->failures())
        if (failure.sequence == sequence) return failure.stage + ": " + failure.reason;
    return "";
  }

  // A sample for the next frame arrives before the feeder's own: that frame fails, the one behind
  // it does not.
  void expect_failure(const std::string& output, const Bytes& sample) {
    const std::uint64_t claimed = allowed;
    const idl::Account before = account();
    const std::uint64_t heard = heard_on(output);
    writers_.at(output)->write(sample);
    await([&] { return heard_on(output) > heard; });
    give(2);
    EXPECT_EQ(account().failed, before.failed + 1);
    EXPECT_EQ(over(account()), over(before) + 2);
    const std::string failure = failure_of(claimed);
    EXPECT_THAT(failure, testing::StartsWith("stage: "));
    EXPECT_FALSE(runners_.at("stage")->failed());
  }

  FrameHeader next_header() const {
    return {.graph = graph_.graph,
            .stage = "feeder",
            .source = "feeder",
            .epoch = epoch,
            .sequence = allowed,
            .model_id = scene().model.appearance.id,
            .name = "frame " + std::to_string(allowed)};
  }

  void open_writer(const std::string& output, const std::string& type) {
    auto& writer = writers_[output];
    if (writer != nullptr) return;
    writer = stranger_->writer(topic_name(graph_, "feeder", output), type, {.depth = 8});
    ASSERT_TRUE(writer->await_readers(10s));
  }

  io::TemporaryFolder folder_;
  GraphDescription graph_;
  std::unique_ptr<Participant> stranger_;
  std::unique_ptr<Observer> observer_;
  std::map<std::string, std::unique_ptr<Writer>> writers_;
  std::map<std::string, std::unique_ptr<StageRunner>> runners_;
};

TEST_P(HostileSamples, FailTheirFrameAndNoOther) {
  give(1);
  ASSERT_EQ(account().failed, 0U) << failure_of(0);
  bool has_model = false;
  std::string output;
  for (const auto& port : inputs_of(GetParam())) {
    has_model = has_model || port.latched;
    if (port.latched) continue;
    output = output_for(port);
    open_writer(output, port.type);
    for (const auto& sample : with_good(output, [](const auto& good) { return hostile(good); })) {
      SCOPED_TRACE(port.name + ": " + sample.what);
      expect_failure(output, sample.message(next_header()));
      if (HasFatalFailure()) return;
    }
  }
  if (!has_model) return;
  SCOPED_TRACE("of a model that nobody has");
  FrameHeader header = next_header();
  header.model_id = 999;
  expect_failure(output,
                 with_good(output, [&](const auto& good) { return idl::encode(header, good); }));
}

INSTANTIATE_TEST_SUITE_P(Stages, HostileSamples, testing::ValuesIn(kKinds),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace cosegraph::graph
