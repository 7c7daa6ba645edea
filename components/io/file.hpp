// Files that are whole or absent.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace cosegraph::io {

// Writes `bytes` under a temporary name beside `file`, syncs, renames. Throws InputError naming
// the file (unwritable folder, no space, ...) and leaves nothing behind in that case. `mode`: who
// may read it, at no time anybody else; the umask takes away from it.
void write_file(const std::filesystem::path& file, std::string_view bytes, unsigned mode = 0666);

// A new folder, only for this user, that vanishes with everything in it. Throws InputError if it
// cannot be made.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(std::string_view name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

// The whole file. Throws InputError naming the file.
std::string read_file(const std::filesystem::path& file);

}  // namespace cosegraph::io
