// The folder of the Labelled Princeton Segmentation Benchmark: DIR/<Category>/N.off, and beside it
// the labels of its faces in N_labels.txt.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cosegraph::evaluation {

// Something that was left out, and why.
struct Problem {
  std::string where;  // "Cup/21", "Cup/21 view 3"
  std::string what;

  friend bool operator==(const Problem&, const Problem&) = default;
};

struct Shape {
  std::string name;  // "21"
  std::filesystem::path mesh;
  std::filesystem::path labels;
};

// Where the files of a shape are.
std::filesystem::path mesh_file(const std::filesystem::path& folder, const std::string& category,
                                const std::string& shape);
std::filesystem::path labels_file(const std::filesystem::path& folder, const std::string& category,
                                  const std::string& shape);

struct Category {
  std::string name;
  std::vector<Shape> shapes;
};

// The folders in `folder`, sorted by name; hidden ones are passed over. Throws InputError if there
// are none.
std::vector<std::string> category_names(const std::filesystem::path& folder);

// Those of category_names(folder) that are in `wanted`, all if that is empty, in the folder's
// order. Throws ParameterError for one that does not exist or is named twice.
std::vector<std::string> choose_categories(const std::filesystem::path& folder,
                                           const std::vector<std::string>& wanted);

// The shapes of one category by number (names that are no numbers behind, by name). A mesh without
// labels, and labels without a mesh, are left out and added to `problems`.
Category read_category(const std::filesystem::path& folder, const std::string& name,
                       std::vector<Problem>& problems);

}  // namespace cosegraph::evaluation
