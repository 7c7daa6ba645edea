// Where tests find the benchmark data, which is not part of the repository.
#pragma once

#include <cstdlib>
#include <filesystem>

namespace cosegraph::test {

// The folder named by COSEGRAPH_DATA, by default ../shared beside the source tree.
inline std::filesystem::path data_folder() {
  if (const char* named = std::getenv("COSEGRAPH_DATA"); named != nullptr) return named;
  return std::filesystem::path(COSEGRAPH_SOURCE_DIR) / ".." / "shared";
}

}  // namespace cosegraph::test

// Ends the current test as skipped where `path` (relative to the data folder) is absent.
#define COSEGRAPH_NEEDS_DATA(path)                                       \
  if (!std::filesystem::exists(cosegraph::test::data_folder() / (path))) \
  GTEST_SKIP() << "no " << (cosegraph::test::data_folder() / (path))     \
               << ": set COSEGRAPH_DATA to the folder with the benchmark data"
