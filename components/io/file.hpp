// Files that are whole or absent.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace cosegraph::io {

// Writes `bytes` under a temporary name beside `file`, syncs, renames. Throws InputError naming
// the file (unwritable folder, no space, ...) and leaves nothing behind in that case.
void write_file(const std::filesystem::path& file, std::string_view bytes);

// The whole file. Throws InputError naming the file.
std::string read_file(const std::filesystem::path& file);

}  // namespace cosegraph::io
