#include "tools/evaluation/store.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "core/error.hpp"
#include "io/file.hpp"

namespace cosegraph::evaluation {
namespace {

namespace fs = std::filesystem;
using Record = std::vector<std::string>;

// The one file of a store with one record.
fs::path only_file(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files.push_back(entry.path());
  EXPECT_EQ(files.size(), 1U);
  return files.at(0);
}

TEST(Store, GivesBackWhatWasWrittenUnderTheSameKeyOnly) {
  const io::TemporaryFolder folder;
  const Record record{"first", "", std::string("\0bytes\n", 7)};
  Store writer(folder.path());
  writer.write("key", record);
  writer.write("no texts", {});
  const Store reader(folder.path());
  EXPECT_EQ(reader.read("key"), record);
  EXPECT_EQ(reader.read("no texts"), Record{});
  EXPECT_EQ(reader.read("other key"), std::nullopt);
  writer.write("key", Record{"second"});
  EXPECT_EQ(reader.read("key"), Record{"second"});
}

TEST(Store, ACutOrChangedFileIsNoRecord) {
  const io::TemporaryFolder folder;
  Store store(folder.path());
  store.write("key", Record{"some text", "more"});
  const fs::path file = only_file(folder.path());
  const std::string whole = io::read_file(file);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    std::ofstream(file, std::ios::binary) << whole.substr(0, size);
    EXPECT_EQ(store.read("key"), std::nullopt) << size;
  }
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string changed = whole;
    changed[at] = static_cast<char>(changed[at] ^ 0x10);
    std::ofstream(file, std::ios::binary) << changed;
    EXPECT_EQ(store.read("key"), std::nullopt) << at;
  }
  std::ofstream(file, std::ios::binary) << whole;
  EXPECT_EQ(store.read("key"), (Record{"some text", "more"}));
}

TEST(Store, WhatOtherProgramsLeftIsRemovedAndOtherFilesAreNot) {
  const io::TemporaryFolder folder;
  fs::create_directories(folder / "0123456789abcdef" / "01");
  fs::create_directories(folder / "notes");
  Store store(folder.path());
  EXPECT_FALSE(fs::exists(folder / "0123456789abcdef"));
  EXPECT_TRUE(fs::exists(folder / "notes"));
}

TEST(Store, WithoutAFolderNothingIsKept) {
  Store store("");
  store.write("key", Record{"text"});
  EXPECT_EQ(store.read("key"), std::nullopt);
  EXPECT_EQ(store.failure(), "");
}

TEST(Store, GivesUpWritingAfterAFailureAndSaysWhy) {
  const io::TemporaryFolder folder;
  std::ofstream(folder / "plain") << "a file";
  Store store(folder / "plain");
  store.write("key", Record{"text"});
  EXPECT_NE(store.failure().find("plain"), std::string::npos);
  EXPECT_EQ(store.read("key"), std::nullopt);
}

TEST(Fingerprint, FollowsTheContentOfAFile) {
  const io::TemporaryFolder folder;
  std::ofstream(folder / "a") << "one";
  std::ofstream(folder / "b") << "one";
  std::ofstream(folder / "c") << "two";
  EXPECT_EQ(fingerprint_of(folder / "a"), fingerprint_of(folder / "b"));
  EXPECT_NE(fingerprint_of(folder / "a"), fingerprint_of(folder / "c"));
  EXPECT_THROW(fingerprint_of(folder / "d"), InputError);
}

}  // namespace
}  // namespace cosegraph::evaluation
