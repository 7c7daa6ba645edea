#include "inputs/inputs.hpp"

#include <algorithm>
#include <cctype>
#include <set>

#include "io/cloud_io.hpp"
#include "io/mesh_io.hpp"

namespace cosegraph::inputs {
namespace {

namespace fs = std::filesystem;

// "view2" before "view10": runs of digits compare by value.
bool natural_less(const std::string& a, const std::string& b) {
  std::size_t i = 0;
  std::size_t j = 0;
  const auto digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  while (i < a.size() && j < b.size()) {
    if (digit(a[i]) && digit(b[j])) {
      const auto run = [&](const std::string& s, std::size_t& at) {
        const std::size_t begin = at;
        while (at < s.size() && digit(s[at])) ++at;
        std::string number = s.substr(begin, at - begin);
        number.erase(0, std::min(number.find_first_not_of('0'), number.size()));
        return number;
      };
      const std::string x = run(a, i);
      const std::string y = run(b, j);
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
    } else if (a[i] != b[j]) {
      return a[i] < b[j];
    } else {
      ++i;
      ++j;
    }
  }
  return a.size() - i < b.size() - j;
}

std::vector<fs::path> files_of(const fs::path& path) {
  if (!fs::exists(path)) throw InputError(path.string() + ": no such file or folder");
  if (!fs::is_directory(path)) {
    if (!io::is_cloud_file(path) && !io::is_mesh_file(path))
      throw InputError(path.string() + ": not a PLY, PCD, PNG or OFF file");
    return {path};
  }
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(path))
    if (entry.is_regular_file() &&
        (io::is_cloud_file(entry.path()) || io::is_mesh_file(entry.path())))
      files.push_back(entry.path());
  std::ranges::sort(files, natural_less, [](const fs::path& file) { return file.string(); });
  return files;
}

}  // namespace

std::vector<Item> list(const std::vector<std::string>& paths, const camera::Params& camera,
                       const fs::path& labels) {
  std::vector<Item> items;
  std::set<std::string> used;
  const auto unique = [&](const std::string& wanted) {
    std::string name = wanted;
    for (int i = 2; !used.insert(name).second; ++i) name = wanted + "-" + std::to_string(i);
    return name;
  };
  for (const auto& path : paths)
    for (const auto& file : files_of(path)) {
      const std::string stem = file.stem().string();
      if (!io::is_mesh_file(file)) {
        items.push_back({.name = unique(stem), .file = file});
        continue;
      }
      for (int view = 0; view < camera.count; ++view)
        items.push_back({.name = unique(stem + "-view" + std::to_string(view)),
                         .file = file,
                         .view = view,
                         .labels = labels});
    }
  if (items.empty()) throw InputError("there is no input file (PLY, PCD, PNG or OFF)");
  return items;
}

struct Reader::Cache {
  std::filesystem::path file;
  Mesh mesh;
  std::vector<camera::View> views;
};

Reader::Reader() = default;
Reader::~Reader() = default;

Cloud Reader::read(const Item& item, const camera::Params& camera) {
  if (item.view < 0) return io::read_cloud(item.file);
  if (cache_ == nullptr || cache_->file != item.file) {
    auto fresh = std::make_unique<Cache>();
    fresh->file = item.file;
    fresh->mesh = read_labelled_mesh(item.file, item.labels);
    fresh->views = camera::choose_views(fresh->mesh, camera);
    cache_ = std::move(fresh);
  }
  const auto view = static_cast<std::size_t>(item.view);
  if (view >= cache_->views.size())
    throw InputError(item.file.string() + ": only " + std::to_string(cache_->views.size()) +
                     " views show every part");
  return camera::render(cache_->mesh, cache_->views[view].direction, cache_->views[view].roll,
                        camera);
}

Mesh read_labelled_mesh(const std::filesystem::path& file, const std::filesystem::path& labels) {
  Mesh mesh = io::read_mesh(file);
  const fs::path beside = file.parent_path() / (file.stem().string() + "_labels.txt");
  if (!labels.empty())
    io::read_labels(labels, mesh);
  else if (mesh.face_label.empty() && fs::exists(beside))
    io::read_labels(beside, mesh);
  return mesh;
}

}  // namespace cosegraph::inputs
