// Topics of ROS 2 against Cyclone DDS, another implementation of DDS, over UDP.
#include "graph/ros2.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <thread>

#include "idl/point_cloud2.hpp"
#include "io/file.hpp"
#include "support/program.hpp"

namespace cosegraph::stages {
std::unique_ptr<graph::Stage> make_source_stage();
std::unique_ptr<graph::Stage> make_sink_stage();
}  // namespace cosegraph::stages

namespace cosegraph::graph::ros2 {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

constexpr int kDomain = 83;
constexpr auto kPatience = 30s;  // against waiting for ever

// One per test and process, so that runs beside each other do not meet.
std::string topic_name() {
  std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
  std::ranges::replace(name, '/', '_');
  return "/test_" + std::to_string(::getpid()) + "/" + name;
}

Topic topic(Reliability reliability = Reliability::reliable, int depth = 1) {
  return {.name = topic_name(), .reliability = reliability, .depth = depth, .domain = kDomain};
}

std::string program(const std::string& name) {
  return std::string(COSEGRAPH_BINARY_DIR) + "/tests/" + name;
}

// How a driver lays its points out.
struct Layout {
  int width = 0;
  std::string fields = "x:7:0,y:7:4,z:7:8";
  int step = 12;
  int padding = 0;
  bool big = false;
};

// cyclone-publish with points in a file.
class CyclonePublisher {
 public:
  CyclonePublisher(const std::string& points, const Layout& layout, int count = 1,
                   const std::string& reliability = "reliable", int milliseconds = 0)
      : program_(words(points, layout, count, reliability, milliseconds)) {}
  ~CyclonePublisher() {
    if (!over_) ::kill(program_.pid(), SIGKILL);
    wait();
  }

  test::Outcome wait() {
    if (!over_) outcome_ = program_.wait();
    over_ = true;
    return outcome_;
  }

 private:
  std::vector<std::string> words(const std::string& points, const Layout& layout, int count,
                                 const std::string& reliability, int milliseconds) const {
    io::write_file(folder_ / "points", points);
    return {program("cyclone-publish"),
            std::to_string(kDomain),
            topic_name(),
            reliability,
            (folder_ / "points").string(),
            std::to_string(layout.width),
            layout.fields,
            std::to_string(layout.step),
            std::to_string(layout.padding),
            layout.big ? "big" : "little",
            std::to_string(count),
            std::to_string(milliseconds)};
  }

  test::TemporaryFolder folder_;
  test::Program program_;
  test::Outcome outcome_;
  bool over_ = false;
};

idl::PointCloud2 received(Subscription& subscription) {
  if (!subscription.wait(kPatience)) {
    ADD_FAILURE() << subscription.waiting_for();
    return {};
  }
  return idl::decode_point_cloud2(*subscription.take());
}

TEST(Ros2, NamesOfTopics) {
  EXPECT_EQ(dds_name("/camera/points"), "rt/camera/points");
  EXPECT_EQ(dds_name("points_2"), "rt/points_2");
  for (const std::string bad :
       {"", "/", "//points", "/camera/", "/a b", "~/points", "/camera/2d", "/{x}"})
    EXPECT_THROW(dds_name(bad), ParameterError) << bad;
}

class Layouts : public testing::TestWithParam<Layout> {};

TEST_P(Layouts, OfCycloneBecomeTheSameCloud) {
  Subscription subscription(topic(), 0);
  CyclonePublisher publisher("0.5 -1 2\n nan nan nan\n 3 4 5\n 6 7 8.25\n", GetParam());
  const Cloud cloud = idl::to_cloud(received(subscription));
  EXPECT_EQ(publisher.wait().status, 0);
  EXPECT_EQ(cloud.frame_id, "camera_optical");
  EXPECT_EQ(cloud.stamp, 1'000'000'500);
  EXPECT_EQ(cloud.height, GetParam().width == 0 ? 1U : 2U);
  ASSERT_THAT(cloud.xyz, SizeIs(12));
  EXPECT_TRUE(std::isnan(cloud.xyz[3]) && std::isnan(cloud.xyz[5]));
  EXPECT_THAT(std::vector<float>(cloud.xyz.begin(), cloud.xyz.begin() + 3),
              ElementsAre(0.5F, -1.0F, 2.0F));
  EXPECT_THAT(std::vector<float>(cloud.xyz.begin() + 6, cloud.xyz.end()),
              ElementsAre(3.0F, 4.0F, 5.0F, 6.0F, 7.0F, 8.25F));
  if (GetParam().fields.find("rgb") == std::string::npos) return;
  ASSERT_THAT(cloud.rgb, SizeIs(12));
  EXPECT_FLOAT_EQ(cloud.rgb[0] * 255.0F, 0x10);
  EXPECT_FLOAT_EQ(cloud.rgb[1] * 255.0F, 0x20);
  EXPECT_FLOAT_EQ(cloud.rgb[11] * 255.0F, 0x33);
}

INSTANTIATE_TEST_SUITE_P(
    Ros2, Layouts,
    testing::Values(Layout{}, Layout{.width = 2}, Layout{.width = 2, .padding = 20, .big = true},
                    // As PCL has them: 16 bytes for the place, 16 for the colour.
                    Layout{.fields = "x:7:0,y:7:4,z:7:8,rgb:6:16", .step = 32},
                    Layout{.width = 2,
                           .fields = "ring:4:0,z:8:2,y:7:10,x:8:14,rgb:6:22",
                           .step = 31,
                           .padding = 1,
                           .big = true}));

TEST(Ros2, ReadsSensorData) {
  Subscription subscription(topic(Reliability::best_effort), 0);
  CyclonePublisher publisher("1 2 3\n", {}, 1000, "best_effort", 10);
  EXPECT_EQ(idl::to_cloud(received(subscription)).size(), 1U);
}

TEST(Ros2, ACloudOfACameraArrivesWhole) {
  std::string points;
  for (int i = 0; i < 640 * 480; ++i) points += std::to_string(i) + " 1 2\n";
  Subscription subscription(topic(), 0);
  CyclonePublisher publisher(points, {.width = 640, .step = 32});
  const Cloud cloud = idl::to_cloud(received(subscription));
  ASSERT_EQ(cloud.size(), 640U * 480U);
  for (std::size_t i = 0; i < cloud.size(); ++i) ASSERT_EQ(cloud.xyz[3 * i], static_cast<float>(i));
}

TEST(Ros2, TheNewestStayAndTheOthersAreCounted) {
  Subscription subscription(topic(Reliability::reliable, 2), 0);
  CyclonePublisher publisher("1 2 3\n", {}, 5);
  EXPECT_EQ(publisher.wait().status, 0);  // all have arrived
  EXPECT_EQ(received(subscription).stamp, 4'000'000'500);
  EXPECT_EQ(received(subscription).stamp, 5'000'000'500);
  EXPECT_EQ(subscription.take(), nullptr);
  EXPECT_EQ(subscription.missed(), 3U);
  EXPECT_EQ(subscription.missed(), 0U);
}

TEST(Ros2, TellsWhyNothingComes) {
  Subscription subscription(topic(), 0);
  EXPECT_THAT(subscription.waiting_for(), HasSubstr("nobody publishes /test_"));
  CyclonePublisher publisher("1 2 3\n", {}, 1, "best_effort");
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (subscription.waiting_for().find("best effort") == std::string::npos &&
         std::chrono::steady_clock::now() < end)
    subscription.wait(10ms);
  EXPECT_THAT(subscription.waiting_for(), HasSubstr("set reliability to best_effort"));
}

// -- stages --------------------------------------------------------------------------------------

class Host final : public StageHost {
 public:
  void publish_latched(const std::string&, const idl::Bytes&) override {}
  void report(std::string_view, double) override {}
  bool stopping() const override { return false; }
  bool resumed() const override { return false; }
  idl::FrameHeader header() const override { return {}; }
  int domain() const override { return kDomain; }
};

using Settings = std::vector<std::pair<std::string, std::string>>;

// A stage with its parameters, started.
std::unique_ptr<Stage> started(std::unique_ptr<Stage> stage, Host& host, const Settings& settings) {
  for (const auto& [name, value] : settings) set_field(stage->parameters(), name, {value});
  stage->attach(host);
  stage->start();
  return stage;
}

std::unique_ptr<Stage> source_of_topic(Host& host, Settings settings) {
  settings.emplace_back("ros2.topic", topic_name());
  return started(stages::make_source_stage(), host, settings);
}

std::optional<std::string> next(SourceStage& source) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!source.ready(10ms))
    if (std::chrono::steady_clock::now() > end) {
      ADD_FAILURE() << "nothing has come";
      return std::nullopt;
    }
  return source.next();
}

// A bowl of 900 points, which source::prepare takes.
std::string bowl() {
  std::string points;
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 30; ++j) {
      const double x = 0.01 * (i - 15);
      const double y = 0.01 * (j - 15);
      points += std::to_string(x) + " " + std::to_string(y) + " " +
                std::to_string(1.0 + 2.0 * (x * x + y * y)) + "\n";
    }
  return points;
}

TEST(Ros2Source, GivesTheCloudsOfATopic) {
  Host host;
  const auto stage = source_of_topic(host, {{"ros2.frames", "2"}, {"ros2.depth", "5"}});
  auto& source = dynamic_cast<SourceStage&>(*stage);
  EXPECT_TRUE(source.live());
  EXPECT_FALSE(source.endless());
  source.skip(0);
  CyclonePublisher publisher(bowl(), {.width = 30, .big = true}, 3);
  EXPECT_EQ(next(source), "1.000000500");
  Frame frame({.name = "1.000000500"}, {});
  source.process(frame);
  const auto input = idl::decode<Cloud>(frame.outputs().at("input"));
  EXPECT_EQ(input.size(), 900U);
  EXPECT_EQ(input.height, 30U);
  EXPECT_EQ(input.frame_id, "camera_optical");
  EXPECT_EQ(input.stamp, 1'000'000'500);
  EXPECT_EQ(next(source), "2.000000500");
  EXPECT_EQ(next(source), std::nullopt);  // after as many as were asked for
}

TEST(Ros2Source, ACloudThatCannotBeUsedFailsItsFrame) {
  Host host;
  const auto stage = source_of_topic(host, {{"ros2.depth", "5"}});
  auto& source = dynamic_cast<SourceStage&>(*stage);
  EXPECT_TRUE(source.endless());
  source.skip(0);
  CyclonePublisher publisher(bowl(), {.fields = "x:7:0,y:7:4,depth:7:8"});
  ASSERT_TRUE(next(source));
  Frame frame({}, {});
  try {
    source.process(frame);
    ADD_FAILURE() << "it was taken";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()), topic_name() + ": the points have no field 'z'");
  }
}

TEST(Ros2Source, EndsWhenNothingComes) {
  Host host;
  const auto stage = source_of_topic(host, {{"ros2.idle", "0.1"}});
  auto& source = dynamic_cast<SourceStage&>(*stage);
  EXPECT_FALSE(source.endless());
  source.skip(0);
  EXPECT_EQ(next(source), std::nullopt);
}

// What came while another process was in its place has been seen by that one.
TEST(Ros2Source, GoesOnWithWhatIsNewAndCountsOn) {
  Host host;
  const auto stage = source_of_topic(host, {{"ros2.frames", "8"}});
  auto& source = dynamic_cast<SourceStage&>(*stage);
  CyclonePublisher publisher(bowl(), {}, 3);
  EXPECT_EQ(publisher.wait().status, 0);
  source.skip(7);
  EXPECT_EQ(source.missed(), 0U);
  CyclonePublisher later(bowl(), {});
  EXPECT_EQ(next(source), "1.000000500");
  EXPECT_EQ(next(source), std::nullopt);
}

TEST(Ros2Source, RefusesWhatContradictsATopic) {
  Host host;
  EXPECT_THROW(source_of_topic(host, {{"rate", "5"}}), ParameterError);
  EXPECT_THROW(started(stages::make_source_stage(), host, {{"ros2.topic", "/no/"}}),
               ParameterError);
}

std::shared_ptr<const idl::Bytes> message(const auto& value) {
  return std::make_shared<const idl::Bytes>(idl::encode({}, value));
}

// As cyclone-echo prints it.
std::string printed(const idl::PointCloud2& cloud) {
  std::string text = cloud.frame_id + " " + std::to_string(cloud.stamp / 1'000'000'000) + " " +
                     std::to_string(cloud.stamp % 1'000'000'000) + " " +
                     std::to_string(cloud.width) + " x " + std::to_string(cloud.height) + " big " +
                     (cloud.is_bigendian ? "1" : "0") + " step " +
                     std::to_string(cloud.point_step) + " row " + std::to_string(cloud.row_step) +
                     " dense " + (cloud.is_dense ? "1" : "0") + "\n";
  for (const auto& field : cloud.fields)
    text += "field " + field.name + " " + std::to_string(field.offset) + " " +
            std::to_string(static_cast<int>(field.type)) + " " + std::to_string(field.count) + "\n";
  constexpr std::string_view kDigits = "0123456789abcdef";
  for (const std::uint8_t byte : cloud.data) (text += kDigits[byte >> 4U]) += kDigits[byte & 15U];
  return text + "\n";
}

TEST(Ros2Sink, CycloneReadsTheLabels) {
  for (const std::string reliability : {"reliable", "best_effort"}) {
    Host host;
    const auto sink = started(stages::make_sink_stage(), host,
                              {{"ros2.topic", topic_name()}, {"ros2.reliability", reliability}});
    test::Program echo(
        {program("cyclone-echo"), std::to_string(kDomain), topic_name(), reliability, "1"});
    const Cloud input{.xyz = {0, 0, 1, 0, 1, 1, NAN, NAN, NAN},
                      .dense_index = {0, 1, kNoPoint},
                      .width = 3,
                      .frame_id = "camera",
                      .stamp = 5'000'000'006};
    const Segments segments{.of_supervoxel = {0, 0}, .of_point = {0, 0}, .count = 1};
    const Labelling labelling{.label_names = {"body", "handle"},
                              .segment_label = {1},
                              .segment_confidence = {0.5F},
                              .point_label = {1, 0},
                              .point_confidence = {0.5F, 0.25F}};
    Frame frame({.name = "f"}, {{"input", message(input)},
                                {"segments", message(segments)},
                                {"labelling", message(labelling)}});
    // Published until it has been heard: nothing is kept for subscribers that come later.
    const auto end = std::chrono::steady_clock::now() + kPatience;
    siginfo_t over{};
    while (over.si_pid == 0 && std::chrono::steady_clock::now() < end) {
      sink->process(frame);
      std::this_thread::sleep_for(20ms);
      ::waitid(P_PID, static_cast<id_t>(echo.pid()), &over, WEXITED | WNOHANG | WNOWAIT);
    }
    sink->end();
    const test::Outcome outcome = echo.wait();
    EXPECT_EQ(outcome.status, 0) << outcome.errors;
    idl::PointCloud2 expected = idl::to_point_cloud2(Cloud{.xyz = input.xyz,
                                                           .rgb = std::vector<float>(9, 0.0F),
                                                           .label = {1, 0, kNoLabel},
                                                           .label_names = labelling.label_names,
                                                           .width = 3,
                                                           .frame_id = "camera",
                                                           .stamp = 5'000'000'006},
                                                     std::vector<float>{0.5F, 0.25F, 0.0F});
    // The colours of labels are the sink's own affair: blank them in both.
    std::string heard = outcome.output;
    const std::size_t data = printed(expected).size() - 1 - 2 * expected.data.size();
    ASSERT_EQ(heard.size(), printed(expected).size()) << heard;
    std::string colours;
    for (std::size_t point = 0; point < 3; ++point) {
      const std::size_t at = data + 2 * (point * expected.point_step + expected.fields[3].offset);
      colours += heard.substr(at, 8);
      heard.replace(at, 8, 8, '0');
    }
    EXPECT_EQ(heard, printed(expected));
    EXPECT_EQ(colours, "0076bf00dd792500a6a6a600");  // handle, body, none
  }
}

TEST(Ros2Sink, NeedsSomewhereToPutResults) {
  Host host;
  EXPECT_THROW(started(stages::make_sink_stage(), host, {}), ParameterError);
}

}  // namespace
}  // namespace cosegraph::graph::ros2
