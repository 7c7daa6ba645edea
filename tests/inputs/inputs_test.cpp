#include "inputs/inputs.hpp"

#include <gmock/gmock.h>

#include "io/cloud_io.hpp"
#include "io/file.hpp"
#include "io/mesh_io.hpp"
#include "support/program.hpp"

namespace cosegraph::inputs {
namespace {

using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;

std::vector<std::string> names(const std::vector<Item>& items) {
  std::vector<std::string> result;
  for (const auto& item : items) result.push_back(item.name);
  return result;
}

const Cloud kPoint{.xyz = {1, 2, 3}, .width = 1};
const Mesh kTetrahedron{.vertex = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1},
                        .face = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}};

TEST(Inputs, FolderIsReadInNaturalOrderAndOtherFilesAreLeftOut) {
  const TemporaryFolder folder;
  for (const char* name : {"view10.ply", "view9.ply", "view1.pcd"})
    io::write_cloud(folder / name, kPoint);
  io::write_file(folder / "notes.txt", "no cloud");
  EXPECT_THAT(names(list({folder.path().string()}, {})), ElementsAre("view1", "view9", "view10"));
}

TEST(Inputs, MeshStandsForItsViews) {
  const TemporaryFolder folder;
  io::write_off(folder / "t.off", kTetrahedron);
  camera::Params camera;
  camera.count = 3;
  const auto items = list({(folder / "t.off").string()}, camera);
  EXPECT_THAT(names(items), ElementsAre("t-view0", "t-view1", "t-view2"));
  Reader reader;
  std::size_t seen = 0;
  for (const auto& item : items) seen += finite_points(reader.read(item, camera)).size();
  EXPECT_GT(seen, 100U);
}

TEST(Inputs, SameBaseNameTwiceGetsANumber) {
  const TemporaryFolder folder;
  io::write_cloud(folder / "mug.ply", kPoint);
  io::write_cloud(folder / "mug.pcd", kPoint);
  EXPECT_THAT(names(list({folder.path().string()}, {})), ElementsAre("mug", "mug-2"));
}

TEST(Inputs, LabelsBesideTheMeshAreFound) {
  const TemporaryFolder folder;
  Mesh mesh = kTetrahedron;
  mesh.face_label = {0, 0, 1, 1};
  mesh.label_names = {"a", "b"};
  io::write_off(folder / "t.off", mesh);
  EXPECT_TRUE(read_labelled_mesh(folder / "t.off").face_label.empty());
  io::write_labels(folder / "t_labels.txt", mesh);
  EXPECT_EQ(read_labelled_mesh(folder / "t.off").face_label, mesh.face_label);
}

TEST(Inputs, RefusalsNameThePath) {
  const TemporaryFolder folder;
  io::write_file(folder / "notes.txt", "no cloud");
  const auto message = [](const std::string& path) -> std::string {
    try {
      list({path}, {});
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(message((folder / "absent").string()), HasSubstr("absent: no such file"));
  EXPECT_THAT(message((folder / "notes.txt").string()), HasSubstr("notes.txt"));
  EXPECT_THAT(message(folder.path().string()), HasSubstr("no input file"));
}

}  // namespace
}  // namespace cosegraph::inputs
