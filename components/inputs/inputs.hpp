// Files and folders as a list of frames: clouds, depth images, and meshes through the camera.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "camera/camera.hpp"
#include "core/cloud.hpp"

namespace cosegraph::inputs {

struct Item {
  std::string name;  // unique within a list: the file's base name, "-viewK" for a mesh
  std::filesystem::path file;
  int view = -1;                 // of a mesh: which of its views; -1: the file is a cloud
  std::filesystem::path labels;  // of a mesh: its label file; empty: NAME_labels.txt beside it
};

// Files as given, folders as the readable files in them, sorted by name (numbers by value). A mesh
// stands for camera.count views of it (see camera::choose_views). Throws InputError for a path
// that does not exist, a file of unknown kind, or a list without any file. `labels` is the label
// file of the one mesh among the paths.
std::vector<Item> list(const std::vector<std::string>& paths, const camera::Params& camera,
                       const std::filesystem::path& labels = {});

// Reads items, remembering the mesh in use so that its views are chosen once.
class Reader {
 public:
  Reader();
  ~Reader();
  // Throws InputError naming the file; also if a mesh has fewer valid views than were asked for.
  Cloud read(const Item& item, const camera::Params& camera);

 private:
  struct Cache;
  std::unique_ptr<Cache> cache_;
};

// The mesh of `file` with the labels of `labels`; if that is empty with its own, or those of
// "NAME_labels.txt" beside it if that exists.
Mesh read_labelled_mesh(const std::filesystem::path& file,
                        const std::filesystem::path& labels = {});

}  // namespace cosegraph::inputs
