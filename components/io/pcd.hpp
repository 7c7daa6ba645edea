// PCD files (Point Cloud Library), versions .6 and .7. Internal to io.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "core/cloud.hpp"
#include "io/cloud_io.hpp"

namespace cosegraph::io::pcd {

// The cloud in `bytes`, the content of `file`. Everything that PCL would repair, pass over or
// crash on is checked before it is given to PCL's decoder; PCL itself prints nothing.
Cloud decode(const std::filesystem::path& file, const std::string& bytes);

std::string encode(const std::filesystem::path& file, const Cloud& cloud,
                   std::span<const Column> extra, Encoding encoding);

}  // namespace cosegraph::io::pcd
