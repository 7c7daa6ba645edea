#include "layering/layers.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string_view>
#include <tuple>

namespace cosegraph::layering {
namespace {

using Names = std::set<std::string, std::less<>>;

// The components that a component's algorithm may include, beside core and itself.
const std::map<std::string, Names, std::less<>> kAllowed = {
    {"core", {}},
    {"pcl_console", {}},
    {"io", {"pcl_console"}},
    {"metrics", {}},
    {"camera", {}},
    {"inputs", {"camera", "io"}},
    {"source", {"pcl_console"}},
    {"supervoxels", {"pcl_console"}},
    {"cpc", {"pcl_console"}},
    {"descriptors", {"pcl_console"}},
    {"fisher", {}},
    {"svm", {}},
    {"spectra", {}},
    {"astar", {"spectra"}},
    {"training", {"fisher", "svm", "astar", "model"}},
    {"model", {}},
    {"sink", {}},
    {"pipeline",
     {"source", "supervoxels", "cpc", "descriptors", "fisher", "svm", "spectra", "astar",
      "training"}},
};

// What a stage adds to its component beside the runtime: getting data in and out.
const Names kAllowedInStages = {"io", "inputs", "model"};

// What else includes components.
const std::map<std::string, Names, std::less<>> kAllowedElsewhere = {
    {"idl", {"core", "model"}},
    {"graph", {"core", "io"}},
};

// Components whose business files and clocks are; the algorithms of all others know neither.
const Names kOutsideWorld = {"io", "inputs", "pipeline"};
const Names kOutsideHeaders = {"fstream", "iostream",   "filesystem", "chrono",
                               "ctime",   "sys/time.h", "time.h",     "unistd.h"};

bool starts_with_any(std::string_view text, std::initializer_list<std::string_view> beginnings) {
  return std::ranges::any_of(beginnings, [&](auto one) { return text.starts_with(one); });
}

bool is_fast_dds(std::string_view header) {
  return starts_with_any(header, {"fastdds/", "fastrtps/"});
}
bool is_fast_cdr(std::string_view header) {
  return header.starts_with("fastcdr/");
}
bool is_vlfeat(std::string_view header) {
  return header.starts_with("vl/");
}
bool is_private_to_sources(std::string_view header) {
  return is_fast_dds(header) || is_fast_cdr(header) || is_vlfeat(header) ||
         starts_with_any(header, {"pcl/", "opencv2/"});
}
bool is_generated(std::string_view header) {
  return starts_with_any(header.substr(header.rfind('/') + 1), {"coseg_", "ros2_"});
}

// A source file, as its place in the tree tells.
struct File {
  std::string path;  // relative, with '/'
  std::string top;   // "components", "graph", "idl", "tools", "tests", ...
  std::string part;  // the folder below `top`, or nothing
  std::string name;

  bool is_header() const { return name.ends_with(".hpp") || name.ends_with(".h"); }
  bool is_stage() const { return top == "components" && name.ends_with("_stage.cpp"); }
  bool is_algorithm() const { return top == "components" && !is_stage(); }
};

File file_at(const std::filesystem::path& relative) {
  File file{.path = relative.generic_string(), .name = relative.filename().string()};
  auto it = relative.begin();
  if (relative.has_parent_path()) file.top = (it++)->string();
  if (std::distance(it, relative.end()) > 1) file.part = it->string();
  return file;
}

std::string folder_of(const std::string& header) {
  const std::size_t slash = header.find('/');
  return slash == std::string::npos ? "" : header.substr(0, slash);
}

// Third-party headers, whoever includes them.
std::string third_party_breach(const File& file, const std::string& header) {
  const bool is_product = file.top == "components" || file.top == "graph" || file.top == "idl";
  const bool is_graph =
      file.top == "graph" || (file.top == "tests" && file.part.starts_with("graph"));
  if (is_fast_dds(header) && !is_graph) return "only graph/ includes Fast DDS";
  if (is_fast_cdr(header) && !is_graph && file.top != "idl")
    return "only graph/ and idl/ include Fast CDR";
  if (is_product && file.is_header() && is_private_to_sources(header))
    return "PCL, OpenCV, VLFeat and Fast DDS stay in .cpp files";
  if (is_vlfeat(header) && is_product) return "VLFeat is an oracle for tests and benchmarks only";
  if (header == "opencv2/opencv.hpp") return "include the narrow headers of OpenCV";
  if (is_generated(header) && file.top != "idl") return "only idl/ sees generated types";
  return "";
}

std::string component_breach(const File& file, const std::string& header) {
  const std::string from = file.part;
  const std::string to = folder_of(header);
  const auto allowed = kAllowed.find(from);
  if (allowed == kAllowed.end()) return "component '" + from + "' is not in the table of layers";
  if (header.ends_with("_stage.hpp") || header.ends_with("_stage.cpp"))
    return "nobody includes a stage";
  if (to == "graph" || to == "idl")
    return file.is_stage() ? "" : "an algorithm knows neither graph/ nor idl/";
  if (file.is_algorithm() && !kOutsideWorld.contains(from) && kOutsideHeaders.contains(header))
    return "an algorithm knows neither files nor clocks: <" + header + ">";
  if (file.is_algorithm() && starts_with_any(header, {"spdlog/", "CLI/"}))
    return "an algorithm writes no logs and reads no options";
  if (!kAllowed.contains(to) || to == from || to == "core" || allowed->second.contains(to))
    return "";
  if (file.is_stage() && kAllowedInStages.contains(to)) return "";
  return "'" + from + "' does not include '" + to + "'";
}

std::string include_breach(const File& file, const std::string& header) {
  const std::string third_party = third_party_breach(file, header);
  if (!third_party.empty()) return third_party;
  if (file.top == "components" && !file.part.empty()) return component_breach(file, header);
  const auto allowed = kAllowedElsewhere.find(file.top);
  const std::string to = folder_of(header);
  if (allowed == kAllowedElsewhere.end() || !kAllowed.contains(to)) return "";
  return allowed->second.contains(to) ? "" : file.top + "/ does not include '" + to + "'";
}

// The name in an include directive, or nothing.
std::string included(const std::string& line) {
  static const std::regex kInclude(R"(^\s*#\s*include\s*["<]([^">]+)[">])");
  std::smatch match;
  return std::regex_search(line, match, kInclude) ? match[1].str() : "";
}

// Written in pieces, so that this file does not contain what it looks for.
const std::vector<std::pair<std::string, std::string>> kForbiddenWords = {
    {std::string("PCL_NO_") + "PRECOMPILE", "PCL's own instantiations are used"},
    {std::string("-mar") + "ch=", "no target has flags that change Eigen's alignment"},
    {std::string("-mav") + "x", "no target has flags that change Eigen's alignment"},
    {std::string("-ffast-") + "math", "results must not depend on reordered arithmetic"},
    {std::string("/ho") + "me/", "no path of somebody's machine"},
    {std::string("/Us") + "ers/", "no path of somebody's machine"},
};

// The folder of the tree itself and its neighbours' folder of data, where they say anything.
std::vector<std::string> machine_paths(const std::filesystem::path& tree) {
  const auto folder = std::filesystem::absolute(tree).lexically_normal();
  const auto shared = folder.parent_path() / "shared";
  return {folder.string() + "/", shared.string()};
}

bool is_source(const File& file) {
  return file.name.ends_with(".cpp") || file.name.ends_with(".hpp") || file.name.ends_with(".h") ||
         file.name.ends_with(".in");
}

bool is_left_out(const std::string& name) {
  static const Names kFolders = {".git", "out", "node_modules", ".cache"};
  return kFolders.contains(name) || name == "build" || name.starts_with("build-");
}

void check_line(const File& file, int number, const std::string& line,
                const std::vector<std::string>& paths, std::vector<Breach>& result) {
  if (const std::string header = included(line); is_source(file) && !header.empty())
    if (const std::string rule = include_breach(file, header); !rule.empty())
      result.push_back({file.path, number, rule});
  for (const auto& [word, rule] : kForbiddenWords)
    if (line.find(word) != std::string::npos) result.push_back({file.path, number, rule});
  for (const auto& path : paths)
    if (line.find(path) != std::string::npos)
      result.push_back({file.path, number, "no path of somebody's machine"});
}

// Binary files say nothing.
std::string text_of(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(stream), {}};
  return text.find('\0') == std::string::npos ? text : "";
}

}  // namespace

std::vector<Breach> breaches(const std::filesystem::path& tree) {
  const auto paths = machine_paths(tree);
  std::vector<Breach> result;
  auto it = std::filesystem::recursive_directory_iterator(tree);
  for (; it != std::filesystem::recursive_directory_iterator(); ++it) {
    if (it->is_directory() && is_left_out(it->path().filename().string())) {
      it.disable_recursion_pending();
    } else if (it->is_regular_file()) {
      const File file = file_at(it->path().lexically_relative(tree));
      std::istringstream lines(text_of(it->path()));
      std::string line;
      for (int number = 1; std::getline(lines, line); ++number)
        check_line(file, number, line, paths, result);
    }
  }
  std::ranges::sort(result, {}, [](const Breach& breach) {
    return std::tie(breach.file, breach.line, breach.rule);
  });
  return result;
}

std::string to_text(const Breach& breach) {
  return breach.file + ":" + std::to_string(breach.line) + ": " + breach.rule;
}

}  // namespace cosegraph::layering
