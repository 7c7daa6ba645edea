#pragma once

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string>

namespace cosegraph::io {

// The extension in lower case, with its dot.
inline std::string extension_of(const std::filesystem::path& file) {
  std::string text = file.extension().string();
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace cosegraph::io
