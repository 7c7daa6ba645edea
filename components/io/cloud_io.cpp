#include "io/cloud_io.hpp"

#include <algorithm>
#include <array>
#include <optional>

#include "core/error.hpp"
#include "io/columns.hpp"
#include "io/depth.hpp"
#include "io/extension.hpp"
#include "io/file.hpp"
#include "io/labels.hpp"
#include "io/pcd.hpp"
#include "io/ply.hpp"

namespace cosegraph::io {
namespace {

using Path = std::filesystem::path;
using Columns = std::array<std::optional<std::size_t>, 3>;

constexpr Spelling kPlySpelling{.normal = {"nx", "ny", "nz"}, .packed_colour = false};

// Where in a vertex row the parts of a point stand.
struct VertexLayout {
  Columns position;
  Columns normal;
  Columns colour;
  std::optional<std::size_t> label;
  std::array<double, 3> colour_range{};  // what counts as full intensity
};

bool complete(const Columns& columns) {
  return std::all_of(columns.begin(), columns.end(), [](const auto& c) { return c.has_value(); });
}

double full_intensity(ply::Type type) {
  switch (type) {
    case ply::Type::uint8:
      return 255.0;
    case ply::Type::uint16:
      return 65535.0;
    default:
      return 1.0;
  }
}

VertexLayout layout_of(const Path& file, const ply::Element& vertex) {
  const auto scalar = [&](std::string_view name) {
    const auto column = vertex.find({name});
    return column && !vertex.properties[*column].count_type ? column : std::nullopt;
  };
  VertexLayout layout{.position = {scalar("x"), scalar("y"), scalar("z")},
                      .normal = {scalar("nx"), scalar("ny"), scalar("nz")},
                      .colour = {scalar("red"), scalar("green"), scalar("blue")},
                      .label = scalar("label")};
  if (!complete(layout.position))
    throw InputError(file.string() + ": element 'vertex' lacks the properties x y z");
  if (complete(layout.colour))
    for (int c = 0; c < 3; ++c)
      layout.colour_range[c] = full_intensity(vertex.properties[*layout.colour[c]].type);
  return layout;
}

void add_vertex(const Path& file, const VertexLayout& layout, std::size_t index,
                const ply::Row& row, Cloud& cloud) {
  for (const auto& column : layout.position)
    cloud.xyz.push_back(static_cast<float>(row[*column][0]));
  if (complete(layout.normal))
    for (const auto& column : layout.normal)
      cloud.normal.push_back(static_cast<float>(row[*column][0]));
  if (complete(layout.colour)) {
    for (int c = 0; c < 3; ++c) {
      const double value = row[*layout.colour[c]][0] / layout.colour_range[c];
      if (!(value >= 0.0 && value <= 1.0))
        throw InputError(file.string() + ": the colour of point " + std::to_string(index) +
                         " is out of range");
      cloud.rgb.push_back(static_cast<float>(value));
    }
  }
  if (layout.label)
    cloud.label.push_back(label_number(file, "point", index, row[*layout.label][0]));
}

Cloud decode_ply(const Path& file, const std::string& bytes) {
  const ply::Header header = ply::parse_header(file, bytes);
  const ply::Element* vertex = header.find("vertex");
  if (vertex == nullptr) throw InputError(file.string() + ": has no element 'vertex'");
  check_point_count(file, vertex->count);
  const VertexLayout layout = layout_of(file, *vertex);
  LabelNames names;
  for (const std::string& comment : header.comments) read_label_comment(file, comment, names);

  Cloud cloud;
  ply::read_rows(file, bytes, header,
                 [&](const ply::Element& element, std::size_t index, const ply::Row& row) {
                   if (&element == vertex) add_vertex(file, layout, index, row, cloud);
                 });
  finish_labels(file, std::move(names), cloud);
  cloud.width = static_cast<std::uint32_t>(vertex->count);
  return cloud;
}

std::string encode_ply(const Path& file, const Cloud& cloud, std::span<const Column> extra,
                       Encoding encoding) {
  const auto columns = columns_of(file, cloud, extra, kPlySpelling);
  std::string bytes = "ply\nformat ";
  bytes += encoding == Encoding::binary ? "binary_little_endian 1.0\n" : "ascii 1.0\n";
  bytes += label_comments(file, "comment", cloud.label_names);
  bytes += "element vertex " + std::to_string(cloud.size()) + "\n";
  for (const OutputColumn& column : columns) {
    switch (column.type) {
      case ColumnType::uint8:
        bytes += "property uchar ";
        break;
      case ColumnType::int32:
        bytes += "property int ";
        break;
      case ColumnType::uint32:
        bytes += "property uint ";
        break;
      case ColumnType::float32:
        bytes += "property float ";
        break;
    }
    bytes += column.name + "\n";
  }
  bytes += "end_header\n";
  append_rows(bytes, columns, cloud.size(), encoding);
  return bytes;
}

}  // namespace

Cloud read_cloud(const Path& file) {
  const std::string extension = extension_of(file);
  if (extension == ".ply") return decode_ply(file, read_file(file));
  if (extension == ".pcd") return pcd::decode(file, read_file(file));
  if (extension == ".png") return depth::decode(file, read_file(file));
  throw InputError(file.string() + ": clouds are read from .ply, .pcd and .png files");
}

std::vector<float> read_column(const Path& file, std::string_view name) {
  if (extension_of(file) != ".ply") return {};
  const std::string bytes = read_file(file);
  const ply::Header header = ply::parse_header(file, bytes);
  const ply::Element* vertex = header.find("vertex");
  const auto column = vertex == nullptr ? std::nullopt : vertex->find({name});
  if (!column || vertex->properties[*column].count_type) return {};
  std::vector<float> values;
  ply::read_rows(file, bytes, header,
                 [&](const ply::Element& element, std::size_t, const ply::Row& row) {
                   if (&element == vertex) values.push_back(static_cast<float>(row[*column][0]));
                 });
  return values;
}

bool is_cloud_file(const Path& file) {
  const std::string extension = extension_of(file);
  return extension == ".ply" || extension == ".pcd" || extension == ".png";
}

void write_cloud(const Path& file, const Cloud& cloud, std::span<const Column> extra,
                 Encoding encoding) {
  check_before_writing(file, cloud);
  const std::string extension = extension_of(file);
  if (extension == ".ply") return write_file(file, encode_ply(file, cloud, extra, encoding));
  if (extension == ".pcd") return write_file(file, pcd::encode(file, cloud, extra, encoding));
  throw InputError(file.string() + ": clouds are written as .ply and .pcd files");
}

}  // namespace cosegraph::io
