#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>
#include <regex>

#include "graph_description/fake_catalog.hpp"

namespace cosegraph::graph::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string drawn(const std::string& yaml) {
  return to_dot(parsed(yaml), fake_catalog());
}

// The statement that begins with `start`, to the end of its line.
std::string statement(const std::string& dot, const std::string& start) {
  const std::size_t begin = dot.find("\n  " + start);
  if (begin == std::string::npos) return "";
  return dot.substr(begin, dot.find('\n', begin + 1) - begin);
}

std::size_t count_of(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  return static_cast<std::size_t>(
      std::distance(std::sregex_iterator(text.begin(), text.end(), regex), {}));
}

TEST(ToDot, HasEveryStageAndEveryEdgeOnce) {
  const GraphDescription graph = parsed(kSegmentGraph);
  const std::string dot = to_dot(graph, fake_catalog());
  std::size_t edges = 0;
  for (const auto& stage : graph.stages) {
    EXPECT_EQ(count_of(dot, "\n  \"" + stage.name + "\" \\["), 1U);
    for (const auto& input : stage.inputs)
      EXPECT_THAT(dot, HasSubstr("\"" + input.from_stage + "\" -> \"" + stage.name + "\""));
    edges += stage.inputs.size();
  }
  EXPECT_EQ(count_of(dot, "\" -> \""), edges);
}

TEST(ToDot, ShowsKindHostAndChangedParameters) {
  const std::string dot = drawn(kSegmentGraph);
  const std::string features = statement(dot, "\"features\" [");
  EXPECT_THAT(features, HasSubstr("descriptors on rack"));
  EXPECT_THAT(features, HasSubstr("channels = fpfh:0.08, shot:0.13"));
  EXPECT_THAT(statement(dot, "\"camera\" ["), HasSubstr("loop = true"));
}

TEST(ToDot, LeavesOutParametersAtTheirDefaults) {
  const std::string dot = drawn(
      "{version: 1, graph: g, stages: {camera: {use: source, params: {size: 4e-2, path: a}},"
      " work: {use: supervoxels, inputs: {cloud: camera/dense}}}}");
  EXPECT_THAT(dot, Not(HasSubstr("size = ")));
  EXPECT_THAT(dot, HasSubstr("path = a"));
}

TEST(ToDot, DashesLatchedEdgesOnly) {
  const std::string dot = drawn(kSegmentGraph);
  const std::string latched = statement(dot, "\"model\" -> \"svm\"");
  EXPECT_THAT(latched, HasSubstr("AppearanceModel"));
  EXPECT_THAT(latched, HasSubstr("style=dashed"));
  const std::string framed = statement(dot, "\"camera\" -> \"supervoxels\"");
  EXPECT_THAT(framed, HasSubstr("Cloud (dense)"));
  EXPECT_THAT(framed, Not(HasSubstr("dashed")));
  EXPECT_EQ(count_of(dot, "style=dashed"), 3U);
}

TEST(ToDot, ExplainsItself) {
  EXPECT_THAT(drawn(kSegmentGraph), HasSubstr("one message per frame"));
  EXPECT_THAT(drawn(kSegmentGraph), HasSubstr("latched"));
  EXPECT_THAT(drawn("{version: 1, graph: g, stages: {camera: {use: source},"
                    " work: {use: supervoxels, inputs: {cloud: camera/dense}}}}"),
              Not(HasSubstr("latched")));
}

TEST(ToDot, ShortensLongValuesAndEscapesOddOnes) {
  const std::string dot = drawn(
      "{version: 1, graph: g, stages: {camera: {use: source, params: {path: '<a & \"b\">\\'}},"
      " work: {use: recorder, inputs: {cloud: camera/dense}, params: {path: "
      "/a/very/long/path/of/folders/in/folders/to/the/file.bin}}}}");
  EXPECT_THAT(dot, HasSubstr("&lt;a &amp; &quot;b&quot;&gt;"));
  EXPECT_THAT(dot, HasSubstr("path = ...olders/in/folders/to/the/file.bin"));
}

TEST(ToDot, ShowsARunningGraphInstead) {
  Overlay overlay{.title = ", 3 frames in flight"};
  overlay.stages["camera"] = {
      .mood = LiveStage::Mood::busy, .state = "working", .figures = {"12 frames <2 failed>"}};
  overlay.stages["features"] = {.mood = LiveStage::Mood::wrong, .state = "failed"};
  const GraphDescription graph = parsed(kSegmentGraph);
  overlay.topics[topic_name(graph, "camera", "dense")] = "8.5 Hz, 120 messages";
  const std::string dot = to_dot(graph, fake_catalog(), &overlay);
  const std::string camera = statement(dot, "\"camera\" [");
  EXPECT_THAT(camera, HasSubstr("working"));
  EXPECT_THAT(camera, HasSubstr("12 frames &lt;2 failed&gt;"));
  EXPECT_THAT(camera, Not(HasSubstr("loop = true"))) << "parameters";
  EXPECT_THAT(statement(dot, "\"features\" ["), Not(HasSubstr("not heard")));
  EXPECT_THAT(statement(dot, "\"svm\" ["), HasSubstr("not heard"));
  EXPECT_THAT(statement(dot, "\"camera\" -> \"supervoxels\""),
              HasSubstr("Cloud (dense) \\n8.5 Hz, 120 messages"));
  EXPECT_THAT(statement(dot, "\"camera\" -> \"features\""), Not(HasSubstr("Hz")));
  EXPECT_THAT(dot, HasSubstr("segment, 3 frames in flight"));
  EXPECT_EQ(to_dot(graph, fake_catalog(), nullptr), to_dot(graph, fake_catalog()));
}

TEST(ToDot, MoodsOfStagesDiffer) {
  const auto drawn_as = [](LiveStage::Mood mood) {
    Overlay overlay;
    overlay.stages["camera"] = {.mood = mood, .state = "s"};
    return statement(to_dot(parsed(kSegmentGraph), fake_catalog(), &overlay), "\"camera\" [");
  };
  EXPECT_NE(drawn_as(LiveStage::Mood::idle), drawn_as(LiveStage::Mood::busy));
  EXPECT_NE(drawn_as(LiveStage::Mood::busy), drawn_as(LiveStage::Mood::wrong));
}

TEST(ToDot, IsAcceptedByGraphviz) {
  if (std::system("dot -V 2> /dev/null") != 0) GTEST_SKIP() << "Graphviz is not installed";
  const std::string folder = ::testing::TempDir();
  const std::string file = folder + "cosegraph_draw_test.dot";
  const std::string errors = folder + "cosegraph_draw_test.errors";
  GraphDescription graph = parsed(kSegmentGraph);
  set_param(graph, "camera", "path", {"\"]; <b>&\\ \n\x01 é"});
  Overlay overlay{.title = "<&>"};
  overlay.stages["camera"] = {.state = "\"<odd>\\ \x01", .figures = {"&"}};
  overlay.topics[topic_name(graph, "camera", "dense")] = "\"5\" Hz\\";
  std::ofstream(file) << to_dot(graph, fake_catalog()) << to_dot(graph, fake_catalog(), &overlay);
  const std::string command = "dot -Tsvg '" + file + "' -o '" + file + ".svg' 2> '" + errors + "'";
  EXPECT_EQ(std::system(command.c_str()), 0);
  std::string complaint;
  std::getline(std::ifstream(errors), complaint);
  EXPECT_EQ(complaint, "");
  for (const auto& name : {file, file + ".svg", errors}) std::remove(name.c_str());
}

}  // namespace
}  // namespace cosegraph::graph::test
