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

// Puts `bytes` in the place of all that stands in `file` from byte `at` on, for a file that grows
// too long to be written anew. Throws InputError naming the file if it is not there, is shorter, or
// cannot be written, and leaves it as it was; only a process that is killed meanwhile does not.
void replace_end(const std::filesystem::path& file, std::size_t at, std::string_view bytes);

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
