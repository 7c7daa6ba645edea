// Results kept on disk, so that a run that was stopped goes on where it was.
#pragma once

#include <filesystem>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cosegraph::evaluation {

// A record is a list of texts (any bytes) under a key. Every record is a file of its own that is
// whole or absent: a writer may be killed at any moment, and two may write at once. Records are
// only found by the program that wrote them, to the byte: whoever changes an algorithm starts
// anew. Thread-safe.
class Store {
 public:
  // Uses `folder`/PROGRAM, made when it is first written to, and removes what other programs left
  // in `folder`. An empty path: keeps nothing.
  explicit Store(const std::filesystem::path& folder);

  // The record, if there is a whole one with exactly this key.
  std::optional<std::vector<std::string>> read(std::string_view key) const;

  // After the first failure (a full disk) nothing is written any more.
  void write(std::string_view key, std::span<const std::string> record);

  // Why writing was given up; empty if it was not.
  std::string failure() const;

 private:
  std::filesystem::path file_of(std::string_view key) const;

  std::filesystem::path folder_;
  mutable std::mutex mutex_;
  std::string failure_;
};

// A short text for the content of a file. Throws InputError naming the file.
std::string fingerprint_of(const std::filesystem::path& file);

}  // namespace cosegraph::evaluation
