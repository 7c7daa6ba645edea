// Replays a target's corpus as an ordinary test, with some mutations of every file: a build without
// libFuzzer still meets what was found, and a little of what was not.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <iostream>

#include "fuzz/target.hpp"
#include "io/file.hpp"

namespace cosegraph::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr int kMutations = 20;  // of every file

std::vector<fs::path> corpus() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(fs::path(COSEGRAPH_SOURCE_DIR) /
                                                  "tests/fuzz/corpus" / COSEGRAPH_TARGET))
    files.push_back(entry.path());
  std::ranges::sort(files);
  return files;
}

Bundle read(const fs::path& file) {
  // Should it crash, the last line of the output names the file.
  std::cout << file.filename().string() << std::endl;
  const std::string text = io::read_file(file);
  return unpack({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

TEST(Fuzz, CorpusIsHandled) {
  const auto files = corpus();
  ASSERT_FALSE(files.empty());
  for (const auto& file : files) {
    const Bundle bundle = read(file);
    EXPECT_NO_THROW(run(bundle)) << file;
    EXPECT_EQ(pack(unpack(pack(bundle))), pack(bundle)) << file;
  }
}

TEST(Fuzz, MutationsOfTheCorpusAreHandled) {
  for (const auto& file : corpus()) {
    const Bundle original = read(file);
    for (int i = 0; i < kMutations; ++i) {
      Bundle bundle = original;
      Random random(static_cast<std::uint64_t>(i));
      mutate(bundle, random);
      EXPECT_NO_THROW(run(bundle)) << file << ", mutation " << i;
    }
  }
}

}  // namespace
}  // namespace cosegraph::fuzz
