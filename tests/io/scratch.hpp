// A folder for the files of one test, removed with everything in it.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "io/file.hpp"

namespace cosegraph::test {

class Scratch {
 public:
  std::filesystem::path operator/(std::string_view name) const { return folder_ / name; }
  const std::filesystem::path& folder() const { return folder_.path(); }

  // The path of a new file with this content.
  std::filesystem::path file(std::string_view name, std::string_view content) const {
    const std::filesystem::path path = folder_ / name;
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }

  std::size_t file_count() const {
    std::size_t count = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder()))
      ++count;
    return count;
  }

 private:
  io::TemporaryFolder folder_;
};

// The text of the E that `action` throws, "" if it throws nothing.
template <class E, class Action>
std::string error_of(const Action& action) {
  try {
    action();
  } catch (const E& error) {
    return error.what();
  }
  return {};
}

}  // namespace cosegraph::test
