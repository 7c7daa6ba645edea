#include "io/file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/error.hpp"
#include "io/scratch.hpp"

namespace cosegraph::io {
namespace {

namespace fs = std::filesystem;
using test::error_of;
using test::Scratch;
using testing::HasSubstr;

TEST(File, WhatIsWrittenIsRead) {
  const Scratch scratch;
  const std::string bytes("a\0b\r\n\xff", 6);
  for (const std::string& content : {bytes, std::string(), std::string(3'000'000, 'x')}) {
    write_file(scratch / "f", content);
    EXPECT_EQ(read_file(scratch / "f"), content);
    EXPECT_EQ(scratch.file_count(), 1U);
  }
}

TEST(File, LeavesNothingBehindWhenTheTargetIsAFolder) {
  const Scratch scratch;
  fs::create_directory(scratch / "there");
  EXPECT_THAT(error_of<InputError>([&] { write_file(scratch / "there", "x"); }),
              HasSubstr((scratch / "there").string()));
  EXPECT_EQ(scratch.file_count(), 1U);
}

TEST(File, FollowsASymbolicLinkInsteadOfReplacingIt) {
  const Scratch scratch;
  scratch.file("real", "old");
  fs::create_symlink(scratch / "real", scratch / "link");
  write_file(scratch / "link", "new");
  EXPECT_TRUE(fs::is_symlink(scratch / "link"));
  EXPECT_EQ(read_file(scratch / "real"), "new");
}

TEST(File, RefusesToReplaceADevice) {
  const std::string error = error_of<InputError>([] { write_file("/dev/null", "x"); });
  EXPECT_THAT(error, HasSubstr("/dev/null"));
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST(File, NamesTheFileThatCannotBeReadOrWritten) {
  const Scratch scratch;
  const fs::path missing = scratch / "no-folder" / "f";
  EXPECT_THAT(error_of<InputError>([&] { read_file(missing); }), HasSubstr(missing.string()));
  EXPECT_THAT(error_of<InputError>([&] { write_file(missing, ""); }), HasSubstr(missing.string()));
  EXPECT_THAT(error_of<InputError>([&] { read_file(scratch.folder()); }), HasSubstr("plain file"));
  EXPECT_NE(error_of<InputError>([] { write_file("", "x"); }), "");
}

TEST(File, RefusesAPipeWithoutHanging) {
  const Scratch scratch;
  ASSERT_EQ(::mkfifo((scratch / "pipe").c_str(), 0600), 0);
  EXPECT_THAT(error_of<InputError>([&] { read_file(scratch / "pipe"); }), HasSubstr("plain file"));
  EXPECT_THAT(error_of<InputError>([&] { write_file(scratch / "pipe", "x"); }),
              HasSubstr("plain file"));
}

TEST(File, AnUnwritableFolderIsAnError) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
  const Scratch scratch;
  fs::permissions(scratch.folder(), fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_THAT(error_of<InputError>([&] { write_file(scratch / "f", "x"); }),
              HasSubstr("Permission denied"));
  fs::permissions(scratch.folder(), fs::perms::owner_all);
}

// A file system of 64 kB, for as long as the object lives.
class TinyDisk {
 public:
  explicit TinyDisk(const fs::path& folder) : folder_(folder) {
    mounted_ = ::mount("tmpfs", folder.c_str(), "tmpfs", 0, "size=65536") == 0;
  }
  ~TinyDisk() {
    if (mounted_) ::umount2(folder_.c_str(), MNT_DETACH);
  }
  TinyDisk(const TinyDisk&) = delete;
  TinyDisk& operator=(const TinyDisk&) = delete;
  bool mounted() const { return mounted_; }

 private:
  fs::path folder_;
  bool mounted_;
};

TEST(File, AFullDiskKeepsTheOldFileWhole) {
  const Scratch scratch;
  const TinyDisk disk(scratch.folder());
  if (!disk.mounted()) GTEST_SKIP() << "a small file system can only be mounted by root";
  write_file(scratch / "f", "old");
  EXPECT_THAT(error_of<InputError>([&] { write_file(scratch / "f", std::string(1'000'000, 'x')); }),
              testing::AllOf(HasSubstr((scratch / "f").string()), HasSubstr("No space left")));
  EXPECT_EQ(read_file(scratch / "f"), "old");
  EXPECT_EQ(scratch.file_count(), 1U);
}

TEST(File, TheEndIsReplaced) {
  const Scratch scratch;
  write_file(scratch / "f", "one, two.");
  replace_end(scratch / "f", 8, ", three.");
  EXPECT_EQ(read_file(scratch / "f"), "one, two, three.");
  replace_end(scratch / "f", 3, ".");
  EXPECT_EQ(read_file(scratch / "f"), "one.");
  EXPECT_THAT(error_of<InputError>([&] { replace_end(scratch / "f", 5, "x"); }),
              testing::AllOf(HasSubstr((scratch / "f").string()), HasSubstr("shortened")));
  EXPECT_THAT(error_of<InputError>([&] { replace_end(scratch / "none", 0, "x"); }),
              HasSubstr("No such file"));
  EXPECT_FALSE(fs::exists(scratch / "none"));
}

TEST(File, AFullDiskKeepsTheOldEnd) {
  const Scratch scratch;
  const TinyDisk disk(scratch.folder());
  if (!disk.mounted()) GTEST_SKIP() << "a small file system can only be mounted by root";
  const std::string old(5000, 'o');
  write_file(scratch / "f", old);
  EXPECT_THAT(
      error_of<InputError>([&] { replace_end(scratch / "f", 10, std::string(1'000'000, 'x')); }),
      HasSubstr("No space left"));
  EXPECT_EQ(read_file(scratch / "f"), old);
}

TEST(File, AReadOnlyDiskIsAnError) {
  const Scratch scratch;
  if (::mount("tmpfs", scratch.folder().c_str(), "tmpfs", MS_RDONLY, "size=65536") != 0)
    GTEST_SKIP() << "a read-only file system can only be mounted by root";
  const std::string error = error_of<InputError>([&] { write_file(scratch / "f", "x"); });
  ::umount2(scratch.folder().c_str(), MNT_DETACH);
  EXPECT_THAT(error, HasSubstr("Read-only"));
}

}  // namespace
}  // namespace cosegraph::io
