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

TEST(ToDot, IsAcceptedByGraphviz) {
  if (std::system("dot -V 2> /dev/null") != 0) GTEST_SKIP() << "Graphviz is not installed";
  const std::string folder = ::testing::TempDir();
  const std::string file = folder + "cosegraph_draw_test.dot";
  const std::string errors = folder + "cosegraph_draw_test.errors";
  GraphDescription graph = parsed(kSegmentGraph);
  set_param(graph, "camera", "path", {"\"]; <b>&\\ \n\x01 é"});
  std::ofstream(file) << to_dot(graph, fake_catalog());
  const std::string command = "dot -Tsvg '" + file + "' -o '" + file + ".svg' 2> '" + errors + "'";
  EXPECT_EQ(std::system(command.c_str()), 0);
  std::string complaint;
  std::getline(std::ifstream(errors), complaint);
  EXPECT_EQ(complaint, "");
  for (const auto& name : {file, file + ".svg", errors}) std::remove(name.c_str());
}

}  // namespace
}  // namespace cosegraph::graph::test
