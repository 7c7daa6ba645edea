// Every faulty/NAME.yaml must give exactly the faults in faulty/NAME.expected, one per line.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "graph_description/fake_catalog.hpp"

namespace cosegraph::graph::test {
namespace {

const std::filesystem::path kFolder =
    std::filesystem::path(COSEGRAPH_SOURCE_DIR) / "tests/graph_description/faulty";

std::vector<std::string> file_names() {
  std::vector<std::string> result;
  for (const auto& entry : std::filesystem::directory_iterator(kFolder))
    if (entry.path().extension() == ".yaml") result.push_back(entry.path().stem().string());
  std::ranges::sort(result);
  return result;
}

std::string text_of(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::ostringstream text;
  text << stream.rdbuf();
  EXPECT_TRUE(stream) << file;
  return text.str();
}

// The faults that load() reports; messages with the folder's path name it FOLDER.
std::string faults_of(const std::filesystem::path& file) {
  std::string result;
  try {
    load(file, fake_catalog());
  } catch (const GraphError& error) {
    for (const auto& fault : error.faults()) {
      EXPECT_EQ(fault.file, file.string());
      EXPECT_THAT(error.what(), ::testing::HasSubstr(to_text(fault)));
    }
    for (const auto& line : lines_of(error.faults())) result += line + "\n";
  }
  for (auto at = result.find(kFolder); at != std::string::npos; at = result.find(kFolder))
    result.replace(at, kFolder.string().size(), "FOLDER");
  return result;
}

class FaultyGraph : public ::testing::TestWithParam<std::string> {};

TEST_P(FaultyGraph, IsRefusedWithExactlyTheExpectedFaults) {
  const std::string expected = text_of(kFolder / (GetParam() + ".expected"));
  EXPECT_FALSE(expected.empty());
  EXPECT_EQ(faults_of(kFolder / (GetParam() + ".yaml")), expected);
}

INSTANTIATE_TEST_SUITE_P(Folder, FaultyGraph, ::testing::ValuesIn(file_names()),
                         [](const auto& info) {
                           std::string name = info.param;
                           std::ranges::replace(name, '-', '_');
                           return name;
                         });

TEST(FaultyGraphs, AreAtLeastTwentyAndEachHasItsExpectation) {
  const auto names = file_names();
  EXPECT_GE(names.size(), 20U);
  std::size_t expectations = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kFolder))
    expectations += entry.path().extension() == ".expected" ? 1 : 0;
  EXPECT_EQ(expectations, names.size());
}

}  // namespace
}  // namespace cosegraph::graph::test
