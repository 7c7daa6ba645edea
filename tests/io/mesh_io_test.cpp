#include "io/mesh_io.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.hpp"
#include "io/file.hpp"
#include "io/scratch.hpp"
#include "support/data.hpp"

namespace cosegraph::io {
namespace {

using test::error_of;
using test::Scratch;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kSquare = "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0.5\n0 1 0\n4 0 1 2 3\n";

Mesh tetrahedron() {
  Mesh mesh;
  mesh.vertex = {0, 0, 0, 1.1F, 0, 0, 0, 1e-7F, 0, 0, 0, -3.3F};
  mesh.face = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};
  mesh.face_label = {1, 0, 1, 1};
  mesh.label_names = {"side wall", "rest"};
  return mesh;
}

TEST(Off, WhatIsWrittenIsRead) {
  const Scratch scratch;
  const Mesh mesh = tetrahedron();
  write_off(scratch / "m.off", mesh);
  write_labels(scratch / "m_labels.txt", mesh);
  Mesh read = read_mesh(scratch / "m.off");
  read_labels(scratch / "m_labels.txt", read);
  EXPECT_EQ(read.vertex, mesh.vertex);
  EXPECT_EQ(read.face, mesh.face);
  EXPECT_EQ(read.face_label, mesh.face_label);
  EXPECT_EQ(read.label_names, mesh.label_names);
}

TEST(Off, PolygonsAreFanned) {
  const Scratch scratch;
  const Mesh mesh = read_mesh(scratch.file("m.off", kSquare));
  EXPECT_THAT(mesh.face, ElementsAre(0, 1, 2, 0, 2, 3));
  EXPECT_EQ(mesh.vertex[8], 0.5F);
}

TEST(Off, DialectsAreUnderstood) {
  const Scratch scratch;
  const std::string body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2";
  for (const std::string& text :
       {"OFF\n3 1 0\n" + body, "OFF 3 1 0\n" + body, "OFF3 1 0\n" + body, "OFF\n3 1\n" + body,
        "# by hand\n\nOFF # header\r\n\r\n3 1 0\r\n" + body + " 0.5 0.5 0.5\n\n",
        std::string("COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 0 0 0 0\n0 1 0 9 9 9 9\n3 0 1 2\n")}) {
    const Mesh mesh = read_mesh(scratch.file("m.off", text));
    EXPECT_EQ(mesh.vertex, (std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0})) << text;
    EXPECT_THAT(mesh.face, ElementsAre(0, 1, 2)) << text;
  }
}

TEST(Off, FaultsAreNamedByLine) {
  const Scratch scratch;
  const auto error_in = [&](const std::string& text) {
    const auto file = scratch.file("bad.off", text);
    return error_of<InputError>([&] { read_mesh(file); });
  };
  EXPECT_THAT(error_in("ply\n"), HasSubstr("not an OFF"));
  EXPECT_THAT(error_in(""), HasSubstr("not an OFF"));
  EXPECT_THAT(error_in("OFF\nthree\n"), HasSubstr("bad.off:2"));
  EXPECT_THAT(error_in("OFF\n1 0 0\n0 0 0\n"), HasSubstr("no faces"));
  EXPECT_THAT(error_in("OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n"), HasSubstr("bad.off:4"));
  EXPECT_THAT(error_in("OFF\n3 1 0\n0 0 0\n1 0 q\n0 1 0\n3 0 1 2\n"), HasSubstr("'q'"));
  EXPECT_THAT(error_in("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"),
              HasSubstr("bad.off:6: a face names vertex 3 of 3"));
  EXPECT_THAT(error_in("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n"), HasSubstr("vertex -1"));
  EXPECT_THAT(error_in("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n"), HasSubstr("three corners"));
  EXPECT_THAT(error_in("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n"),
              HasSubstr("too few"));
  EXPECT_THAT(error_in("OFF\n4000000000 4000000000 0\n0 0 0\n"), HasSubstr("more than are read"));
  EXPECT_THAT(error_in("OFF\n19000000 1 0\n0 0 0\n"), HasSubstr("the header promises"));
  const std::string square = kSquare;
  for (std::size_t length = 0; length + 2 < square.size(); ++length)
    EXPECT_THAT(error_in(square.substr(0, length)), HasSubstr("bad.off")) << length;
}

TEST(PlyMesh, PolygonsKeepTheirLabels) {
  const Scratch scratch;
  const auto file = scratch.file(
      "m.ply",
      "ply\nformat ascii 1.0\ncomment label 2 top\nelement vertex 5\nproperty float x\n"
      "property float y\nproperty float z\nelement face 2\nproperty uchar flags\n"
      "property list uchar int vertex_index\nproperty int label\nend_header\n"
      "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n0 4 0 1 2 3 2\n9 3 0 1 4 5\n");
  ASSERT_TRUE(is_mesh_file(file));
  const Mesh mesh = read_mesh(file);
  EXPECT_THAT(mesh.face, ElementsAre(0, 1, 2, 0, 2, 3, 0, 1, 4));
  EXPECT_THAT(mesh.face_label, ElementsAre(0, 0, 1));
  EXPECT_THAT(mesh.label_names, ElementsAre("top", "5"));
}

TEST(PlyMesh, FaultsAreNamed) {
  const Scratch scratch;
  const auto error_in = [&](const std::string& faces, const std::string& body) {
    const auto file =
        scratch.file("bad.ply",
                     "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                     "property float z\n" +
                         faces + "end_header\n0 0 0\n1 0 0\n0 1 0\n" + body);
    return error_of<InputError>([&] { read_mesh(file); });
  };
  const std::string list = "element face 1\nproperty list uchar int vertex_indices\n";
  EXPECT_EQ(error_in(list, "3 0 1 2\n"), "");
  EXPECT_THAT(error_in("", ""), HasSubstr("needs the elements"));
  EXPECT_THAT(error_in("element face 0\nproperty list uchar int vertex_indices\n", ""),
              HasSubstr("no faces"));
  EXPECT_THAT(error_in("element face 1\nproperty int vertex_indices\n", "0\n"),
              HasSubstr("lacks the list"));
  EXPECT_THAT(error_in(list, "3 0 1 3\n"), HasSubstr("face 0: a face names vertex 3 of 3"));
  EXPECT_THAT(error_in(list, "2 0 1\n"), HasSubstr("three corners"));
  EXPECT_THAT(error_in(list, "250 0 1\n"), HasSubstr("too short"));
  EXPECT_THAT(error_in(list + "property double label\n", "3 0 1 2 1e300\n"),
              HasSubstr("label of face 0"));
}

TEST(MeshIo, TellsMeshesFromCloudsByLookingInside) {
  const Scratch scratch;
  EXPECT_TRUE(is_mesh_file("anything.OFF"));
  EXPECT_FALSE(is_mesh_file("a.pcd"));
  EXPECT_FALSE(is_mesh_file(scratch / "absent.ply"));
  EXPECT_FALSE(is_mesh_file(scratch.file("c.ply",
                                         "ply\nformat ascii 1.0\nelement vertex 1\n"
                                         "property float x\nend_header\n1\n")));
  EXPECT_THAT(error_of<InputError>([] { read_mesh("a.obj"); }), HasSubstr("a.obj"));
}

TEST(Labels, FaultsAreNamedByLineAndFace) {
  const Scratch scratch;
  const auto error_in = [&](const std::string& text) {
    Mesh mesh = tetrahedron();
    const auto file = scratch.file("bad.txt", text);
    const std::string error = error_of<InputError>([&] { read_labels(file, mesh); });
    if (!error.empty()) {
      EXPECT_EQ(mesh.face_label, tetrahedron().face_label);
    }
    return error;
  };
  EXPECT_EQ(error_in("a\n1 2 \r\nb\n3 4\n\n"), "");
  EXPECT_EQ(error_in("a\n1 2 3 4\nempty\n\n"), "");
  EXPECT_THAT(error_in(""), HasSubstr("face 1 has no label"));
  EXPECT_THAT(error_in("a\n1 2\nb\n4\n"), HasSubstr("face 3 has no label"));
  EXPECT_THAT(error_in("a\n1 2 3\nb\n3 4\n"), HasSubstr("bad.txt:4: face 3 has a second label"));
  EXPECT_THAT(error_in("a\n1 2 3 5\n"), HasSubstr("bad.txt:2: '5' is not one of the faces 1 .. 4"));
  EXPECT_THAT(error_in("a\n0\n"), HasSubstr("'0' is not"));
  EXPECT_THAT(error_in("a\n1 two\n"), HasSubstr("'two' is not"));
  EXPECT_THAT(error_in("a\n1 2\na\n3 4\n"), HasSubstr("bad.txt:3: a second list"));
  EXPECT_THAT(error_in("a"), HasSubstr("no line of face numbers"));
}

TEST(Labels, UnlabelledFacesCannotBeWritten) {
  const Scratch scratch;
  Mesh mesh = tetrahedron();
  mesh.face_label[2] = kNoLabel;
  EXPECT_THAT(error_of<InputError>([&] { write_labels(scratch / "l.txt", mesh); }),
              HasSubstr("face 3 has no label"));
  mesh.face[0] = 17;
  EXPECT_THAT(error_of<InputError>([&] { write_off(scratch / "m.off", mesh); }),
              HasSubstr("m.off"));
  EXPECT_EQ(scratch.file_count(), 0U);
}

TEST(Labels, TheBenchmarksFilesComeBackAsTheyWere) {
  COSEGRAPH_NEEDS_DATA("lpsb/Cup/21.off");
  const Scratch scratch;
  Mesh mesh = read_mesh(test::data_folder() / "lpsb/Cup/21.off");
  EXPECT_EQ(mesh.vertex_count(), 15198U);
  EXPECT_EQ(mesh.face_count(), 30396U);
  read_labels(test::data_folder() / "lpsb/Cup/21_labels.txt", mesh);
  EXPECT_THAT(mesh.label_names, ElementsAre("body", "handle"));
  check_sizes(mesh);
  write_labels(scratch / "l.txt", mesh);
  Mesh again = mesh;
  read_labels(scratch / "l.txt", again);
  EXPECT_EQ(again.face_label, mesh.face_label);
}

}  // namespace
}  // namespace cosegraph::io
