#include "io/mesh_io.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <optional>
#include <string_view>

#include "core/error.hpp"
#include "io/cloud_io.hpp"
#include "io/columns.hpp"
#include "io/extension.hpp"
#include "io/file.hpp"
#include "io/labels.hpp"
#include "io/ply.hpp"
#include "io/text.hpp"

namespace cosegraph::io {
namespace {

using Path = std::filesystem::path;

constexpr std::size_t kMaxFaces = 2 * kMaxPoints;

// Vertex and face counts of a header against what a reader takes.
void check_counts(const Path& file, std::size_t vertices, std::size_t faces) {
  if (faces == 0) throw InputError(file.string() + ": holds no faces");
  if (vertices > kMaxPoints || faces > kMaxFaces)
    throw InputError(file.string() + ": " + std::to_string(vertices) + " vertices and " +
                     std::to_string(faces) + " faces are more than are read");
}

// Fans a polygon into triangles around its first corner; returns how many. The reason, if the
// polygon cannot be taken, goes to `fault`.
std::size_t add_polygon(const std::vector<double>& corners, Mesh& mesh, std::string& fault) {
  if (corners.size() < 3) {
    fault = "a face needs at least three corners";
    return 0;
  }
  for (const double corner : corners) {
    const bool inside = corner >= 0.0 && corner < static_cast<double>(mesh.vertex_count());
    if (!inside || corner != std::floor(corner)) {
      fault = "a face names vertex ";
      append_number(fault, corner);
      fault += " of " + std::to_string(mesh.vertex_count());
      return 0;
    }
  }
  for (std::size_t c = 2; c < corners.size(); ++c)
    for (const double corner : {corners[0], corners[c - 1], corners[c]})
      mesh.face.push_back(static_cast<std::int32_t>(corner));
  return corners.size() - 2;
}

// ---- OFF

// Takes `count` numbers off the front of `text`; more may follow.
void take_numbers(const Lines& lines, std::string_view& text, std::size_t count,
                  std::vector<double>& values) {
  values.clear();
  for (std::size_t i = 0; i < count; ++i) {
    const std::string_view word = take_word(text);
    if (word.empty()) lines.fail("the line has too few values");
    const auto value = parse_number<double>(word);
    if (!value) lines.fail(in_quotes(word) + " is not a number");
    values.push_back(*value);
  }
}

std::string_view next_off_line(const Path& file, Lines& lines) {
  const auto line = lines.next_filled('#');
  if (!line) throw InputError(file.string() + ": the file ends before its last face");
  return *line;
}

// The text behind the keyword, which may have colours and normals announced before it: these
// stand behind the coordinates and are passed over.
std::string_view after_keyword(const Path& file, Lines& lines) {
  const auto line = lines.next_filled('#');
  for (const std::string_view keyword : {"OFF", "COFF", "NOFF", "CNOFF"})
    if (line && line->starts_with(keyword)) return trimmed(line->substr(keyword.size()));
  throw InputError(file.string() + ": is not an OFF file");
}

struct OffCounts {
  std::size_t vertices;
  std::size_t faces;
};

OffCounts read_counts(const Path& file, Lines& lines, std::size_t bytes) {
  std::string_view text = after_keyword(file, lines);
  if (text.empty()) text = next_off_line(file, lines);
  const auto vertices = parse_number<std::size_t>(take_word(text));
  const auto faces = parse_number<std::size_t>(take_word(text));
  if (!vertices || !faces) lines.fail("expected the numbers of vertices and faces");
  check_counts(file, *vertices, *faces);
  // "0 0 0" and "3 0 1 2" with their line ends are the shortest lines there are.
  if (6 * *vertices + 8 * *faces > bytes + 1)
    throw InputError(file.string() + ": the header promises " + std::to_string(*vertices) +
                     " vertices and " + std::to_string(*faces) +
                     " faces, but the file ends before that");
  return {*vertices, *faces};
}

Mesh decode_off(const Path& file, const std::string& bytes) {
  Lines lines(file, bytes);
  const OffCounts counts = read_counts(file, lines, bytes.size());
  Mesh mesh;
  mesh.vertex.reserve(3 * counts.vertices);
  mesh.face.reserve(3 * counts.faces);
  std::vector<double> values;
  for (std::size_t v = 0; v < counts.vertices; ++v) {
    std::string_view text = next_off_line(file, lines);
    take_numbers(lines, text, 3, values);
    for (const double value : values) mesh.vertex.push_back(static_cast<float>(value));
  }
  std::string fault;
  for (std::size_t f = 0; f < counts.faces; ++f) {
    std::string_view text = next_off_line(file, lines);
    const auto corners = parse_number<std::uint32_t>(take_word(text));
    if (!corners) lines.fail("expected the number of corners of a face");
    take_numbers(lines, text, *corners, values);
    if (add_polygon(values, mesh, fault) == 0) lines.fail(fault);
  }
  return mesh;
}

// ---- PLY

struct FaceLayout {
  std::size_t corners;
  std::optional<std::size_t> label;
};

FaceLayout face_layout(const Path& file, const ply::Element& face) {
  const auto corners = face.find({"vertex_indices", "vertex_index"});
  if (!corners || !face.properties[*corners].count_type)
    throw InputError(file.string() + ": element 'face' lacks the list vertex_indices");
  const auto label = face.find({"label"});
  const bool scalar = label && !face.properties[*label].count_type;
  return {*corners, scalar ? label : std::nullopt};
}

Mesh decode_ply(const Path& file, const std::string& bytes) {
  const ply::Header header = ply::parse_header(file, bytes);
  const ply::Element* vertex = header.find("vertex");
  const ply::Element* face = header.find("face");
  if (vertex == nullptr || face == nullptr || face < vertex)
    throw InputError(file.string() + ": needs the elements 'vertex' and, behind it, 'face'");
  check_counts(file, vertex->count, face->count);
  const std::array position{vertex->find({"x"}), vertex->find({"y"}), vertex->find({"z"})};
  for (const auto& column : position)
    if (!column || vertex->properties[*column].count_type)
      throw InputError(file.string() + ": element 'vertex' lacks the properties x y z");
  const FaceLayout layout = face_layout(file, *face);

  Mesh mesh;
  std::string fault;
  const auto add_face = [&](std::size_t index, const ply::Row& row) {
    const std::size_t triangles = add_polygon(row[layout.corners], mesh, fault);
    if (triangles == 0)
      throw InputError(file.string() + ": face " + std::to_string(index) + ": " + fault);
    if (!layout.label) return;
    const std::int32_t label = label_number(file, "face", index, row[*layout.label][0]);
    mesh.face_label.insert(mesh.face_label.end(), triangles, label);
  };
  ply::read_rows(file, bytes, header,
                 [&](const ply::Element& element, std::size_t index, const ply::Row& row) {
                   if (&element == vertex)
                     for (const auto& column : position)
                       mesh.vertex.push_back(static_cast<float>(row[*column][0]));
                   if (&element == face) add_face(index, row);
                 });
  LabelNames names;
  for (const std::string& comment : header.comments) read_label_comment(file, comment, names);
  if (!mesh.face_label.empty())
    mesh.label_names = to_indices(file, std::move(names), mesh.face_label);
  return mesh;
}

// ---- Labelled Princeton Segmentation Benchmark

void read_label_line(const Lines& lines, std::string_view text, std::int32_t label,
                     std::vector<std::int32_t>& face_label) {
  for (std::string_view word = take_word(text); !word.empty(); word = take_word(text)) {
    const auto number = parse_number<std::size_t>(word);
    if (!number || *number == 0 || *number > face_label.size())
      lines.fail(in_quotes(word) + " is not one of the faces 1 .. " +
                 std::to_string(face_label.size()));
    std::int32_t& value = face_label[*number - 1];
    if (value != kNoLabel) lines.fail("face " + std::to_string(*number) + " has a second label");
    value = label;
  }
}

}  // namespace

Mesh read_mesh(const Path& file) {
  const std::string extension = extension_of(file);
  if (extension != ".off" && extension != ".ply")
    throw InputError(file.string() + ": meshes are read from .off and .ply files");
  const std::string bytes = read_file(file);
  return extension == ".off" ? decode_off(file, bytes) : decode_ply(file, bytes);
}

void read_labels(const Path& file, Mesh& mesh) {
  const std::string bytes = read_file(file);
  Lines lines(file, bytes);
  std::vector<std::string> names;
  std::vector<std::int32_t> face_label(mesh.face_count(), kNoLabel);
  while (const auto line = lines.next_filled()) {
    const std::string name(*line);
    if (std::find(names.begin(), names.end(), name) != names.end())
      lines.fail("a second list of label " + in_quotes(name));
    names.push_back(name);
    const auto faces = lines.next();
    if (!faces) lines.fail("no line of face numbers follows the label's name");
    read_label_line(lines, *faces, static_cast<std::int32_t>(names.size()) - 1, face_label);
  }
  const auto bare = std::find(face_label.begin(), face_label.end(), kNoLabel);
  if (bare != face_label.end())
    lines.fail("the file ends and face " + std::to_string(bare - face_label.begin() + 1) +
               " has no label");
  mesh.face_label = std::move(face_label);
  mesh.label_names = std::move(names);
}

void write_off(const Path& file, const Mesh& mesh) {
  check_before_writing(file, mesh);
  std::string text = "OFF\n" + std::to_string(mesh.vertex_count()) + " " +
                     std::to_string(mesh.face_count()) + " 0\n";
  for (std::size_t i = 0; i < mesh.vertex.size(); ++i) {
    append_number(text, mesh.vertex[i]);
    text += i % 3 == 2 ? '\n' : ' ';
  }
  for (std::size_t i = 0; i < mesh.face.size(); ++i) {
    if (i % 3 == 0) text += "3 ";
    append_number(text, mesh.face[i]);
    text += i % 3 == 2 ? '\n' : ' ';
  }
  write_file(file, text);
}

void write_labels(const Path& file, const Mesh& mesh) {
  check_before_writing(file, mesh);
  label_comments(file, "", mesh.label_names);  // refuses names that do not fit a line
  std::vector<std::string> lines(mesh.label_names.size());
  for (std::size_t f = 0; f < mesh.face_label.size(); ++f) {
    if (mesh.face_label[f] == kNoLabel)
      throw InputError(file.string() + ": cannot write: face " + std::to_string(f + 1) +
                       " has no label");
    std::string& line = lines[static_cast<std::size_t>(mesh.face_label[f])];
    if (!line.empty()) line += ' ';
    append_number(line, f + 1);
  }
  std::string text;
  for (std::size_t l = 0; l < lines.size(); ++l)
    text += mesh.label_names[l] + "\n" + lines[l] + "\n";
  write_file(file, text);
}

bool is_mesh_file(const Path& file) {
  const std::string extension = extension_of(file);
  if (extension == ".off") return true;
  if (extension != ".ply") return false;
  constexpr std::size_t kLongestHeader = 1 << 20;
  std::string bytes(kLongestHeader, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(stream.gcount()));
  try {
    const ply::Header header = ply::parse_header(file, bytes);
    const ply::Element* face = header.find("face");
    return face != nullptr && face->count > 0;
  } catch (const InputError&) {
    return false;  // read_mesh or read_cloud will say what is wrong with it
  }
}

}  // namespace cosegraph::io
