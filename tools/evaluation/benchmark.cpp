#include "tools/evaluation/benchmark.hpp"

#include <algorithm>
#include <charconv>
#include <limits>
#include <map>
#include <tuple>

#include "core/fields.hpp"

namespace cosegraph::evaluation {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMeshEnd = ".off";
constexpr std::string_view kLabelsEnd = "_labels.txt";

// The number that `name` is; what is no number comes last.
std::uint64_t number_of(const std::string& name) {
  std::uint64_t value = 0;
  const char* end = name.data() + name.size();
  const auto [stop, error] = std::from_chars(name.data(), end, value);
  return error == std::errc{} && stop == end ? value : std::numeric_limits<std::uint64_t>::max();
}

bool by_number(const Shape& a, const Shape& b) {
  return std::tuple(number_of(a.name), a.name) < std::tuple(number_of(b.name), b.name);
}

fs::directory_iterator open_folder(const fs::path& folder) {
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  if (error) throw InputError(folder.string() + ": cannot be read: " + error.message());
  return entries;
}

}  // namespace

fs::path mesh_file(const fs::path& folder, const std::string& category, const std::string& shape) {
  return folder / category / (shape + std::string(kMeshEnd));
}

fs::path labels_file(const fs::path& folder, const std::string& category,
                     const std::string& shape) {
  return folder / category / (shape + std::string(kLabelsEnd));
}

std::vector<std::string> category_names(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : open_folder(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_directory() && !name.starts_with('.')) names.push_back(name);
  }
  if (names.empty())
    throw InputError(folder.string() + ": holds no category, that is no folder with shapes");
  std::ranges::sort(names);
  return names;
}

std::vector<std::string> choose_categories(const fs::path& folder,
                                           const std::vector<std::string>& wanted) {
  std::vector<std::string> names = category_names(folder);
  if (wanted.empty()) return names;
  std::string all;
  for (const auto& name : names) all += (all.empty() ? "" : ", ") + name;
  for (const auto& name : wanted) {
    if (std::ranges::find(names, name) == names.end())
      throw ParameterError("'" + name + "' is no category of " + folder.string() +
                           did_you_mean(name, names) + "; there are " + all);
    if (std::ranges::count(wanted, name) > 1)
      throw ParameterError("category '" + name + "' is named twice");
  }
  std::erase_if(names,
                [&](const auto& name) { return std::ranges::find(wanted, name) == wanted.end(); });
  return names;
}

Category read_category(const fs::path& folder, const std::string& name,
                       std::vector<Problem>& problems) {
  std::map<std::string, Shape> found;
  for (const auto& entry : open_folder(folder / name)) {
    const std::string file = entry.path().filename().string();
    const auto stem = [&](std::string_view end) {
      return file.substr(0, file.size() - end.size());
    };
    if (file.ends_with(kMeshEnd))
      found[stem(kMeshEnd)].mesh = entry.path();
    else if (file.ends_with(kLabelsEnd))
      found[stem(kLabelsEnd)].labels = entry.path();
  }
  Category category{.name = name};
  std::vector<Shape> incomplete;
  for (auto& [stem, shape] : found) {
    shape.name = stem;
    (shape.mesh.empty() || shape.labels.empty() ? incomplete : category.shapes).push_back(shape);
  }
  std::ranges::sort(category.shapes, by_number);
  std::ranges::sort(incomplete, by_number);
  for (const Shape& shape : incomplete)
    problems.push_back({name + "/" + shape.name,
                        shape.mesh.empty()
                            ? "labels without the mesh " + shape.name + std::string(kMeshEnd)
                            : "a mesh without the labels " + shape.name + std::string(kLabelsEnd)});
  if (found.empty()) problems.push_back({name, "no shapes in this folder"});
  return category;
}

}  // namespace cosegraph::evaluation
