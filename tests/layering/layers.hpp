// Who may include whom, and what else the sources must not contain. See ARCHITECTURE.md.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cosegraph::layering {

struct Breach {
  std::string file;  // relative to the tree
  int line = 0;
  std::string rule;

  bool operator==(const Breach&) const = default;
};

// Every breach in a source tree, by file and line. Build folders and what git keeps for itself are
// left out.
std::vector<Breach> breaches(const std::filesystem::path& tree);

// "FILE:LINE: RULE".
std::string to_text(const Breach& breach);

}  // namespace cosegraph::layering
