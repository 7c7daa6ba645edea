// Depth images: 16 bit PNG with the camera's intrinsics beside it as JSON. Internal to io.
#pragma once

#include <filesystem>
#include <string>

#include "core/cloud.hpp"

namespace cosegraph::io::depth {

// The organised cloud of the depth image in `png`, the content of `file`; the intrinsics are read
// from the file of the same name with the extension .json.
Cloud decode(const std::filesystem::path& file, const std::string& png);

}  // namespace cosegraph::io::depth
