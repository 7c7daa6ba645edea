#include "io/pcd.hpp"

#include <pcl/PCLPointCloud2.h>
#include <pcl/io/pcd_io.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <string_view>
#include <vector>

#include "core/error.hpp"
#include "io/columns.hpp"
#include "io/labels.hpp"
#include "io/text.hpp"
#include "pcl_console/pcl_console.hpp"

namespace cosegraph::io::pcd {
namespace {

using Path = std::filesystem::path;

enum class Data { ascii, binary, compressed };

// The header's lines by key, and what follows from them.
struct Header {
  std::map<std::string, std::vector<std::string>, std::less<>> lines;
  LabelNames label_names;
  std::uint64_t points = 0;
  std::uint64_t point_size = 0;        // bytes
  std::uint64_t values_per_point = 0;  // words in an ascii line
  Data data = Data::ascii;
  std::size_t size = 0;  // bytes, the DATA line included
  std::size_t line_count = 0;
};

constexpr std::array<std::string_view, 10> kKeys{
    "VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA"};

void take_line(const Path& file, const Lines& lines, std::string_view text, Header& header) {
  if (text.starts_with('#')) {
    read_label_comment(file, trimmed(text.substr(1)), header.label_names);
    return;
  }
  const auto words = words_of(text);
  const std::string_view key = words[0] == "COLUMNS" ? "FIELDS" : words[0];
  if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end())
    lines.fail("unknown PCD header line " + in_quotes(key));
  const auto [place, added] =
      header.lines.try_emplace(std::string(key), words.begin() + 1, words.end());
  if (!added) lines.fail("a second line " + in_quotes(key));
}

const std::vector<std::string>& line_of(const Path& file, const Header& header,
                                        std::string_view key, std::size_t words) {
  const auto found = header.lines.find(key);
  if (found == header.lines.end())
    throw InputError(file.string() + ": the PCD header has no line '" + std::string(key) + "'");
  if (found->second.size() != words)
    throw InputError(file.string() + ": the PCD header's line '" + std::string(key) + "' needs " +
                     std::to_string(words) + " words");
  return found->second;
}

std::uint64_t number_of(const Path& file, const Header& header, std::string_view key) {
  const std::string& word = line_of(file, header, key, 1)[0];
  if (const auto value = parse_number<std::uint32_t>(word)) return *value;
  throw InputError(file.string() + ": PCD " + std::string(key) + " " + in_quotes(word) +
                   " is not a count");
}

void read_fields(const Path& file, Header& header) {
  const auto found = header.lines.find("FIELDS");
  const std::size_t fields = found == header.lines.end() ? 0 : found->second.size();
  if (fields == 0) throw InputError(file.string() + ": the PCD header names no fields");
  const auto& sizes = line_of(file, header, "SIZE", fields);
  const auto& types = line_of(file, header, "TYPE", fields);
  const bool has_counts = header.lines.contains("COUNT");
  for (std::size_t f = 0; f < fields; ++f) {
    const auto size = parse_number<std::uint32_t>(sizes[f]);
    const bool whole = types[f] == "I" || types[f] == "U";
    const bool fine =
        size && (types[f] == "F" ? (*size == 4 || *size == 8)
                                 : whole && (*size == 1 || *size == 2 || *size == 4 || *size == 8));
    const auto count = has_counts
                           ? parse_number<std::uint32_t>(line_of(file, header, "COUNT", fields)[f])
                           : std::optional<std::uint32_t>(1);
    constexpr std::uint32_t kLargestCount = 65536;
    if (!fine || !count || *count == 0 || *count > kLargestCount)
      throw InputError(file.string() + ": PCD field " + in_quotes(found->second[f]) +
                       " has an impossible SIZE, TYPE or COUNT");
    header.point_size += std::uint64_t{*size} * *count;
    header.values_per_point += *count;
  }
}

void read_counts(const Path& file, Header& header) {
  header.points = number_of(file, header, "POINTS");
  if (header.lines.contains("WIDTH") || header.lines.contains("HEIGHT")) {
    const std::uint64_t cells =
        number_of(file, header, "WIDTH") * number_of(file, header, "HEIGHT");
    if (cells != header.points)
      throw InputError(file.string() + ": PCD WIDTH x HEIGHT is not POINTS");
  }
  check_point_count(file, header.points);
}

Header parse_header(const Path& file, std::string_view bytes) {
  Header header;
  Lines lines(file, bytes);
  while (!header.lines.contains("DATA")) {
    const auto line = lines.next();
    if (!line) throw InputError(file.string() + ": is not a PCD file, or ends in its header");
    if (const auto text = trimmed(*line); !text.empty()) take_line(file, lines, text, header);
  }
  header.size = bytes.size() - lines.rest().size();
  header.line_count = lines.number();
  read_fields(file, header);
  read_counts(file, header);
  const std::string& data = line_of(file, header, "DATA", 1)[0];
  if (data == "binary")
    header.data = Data::binary;
  else if (data == "binary_compressed")
    header.data = Data::compressed;
  else if (data != "ascii")
    throw InputError(file.string() + ": PCD encoding " + in_quotes(data) + " is unknown");
  return header;
}

[[noreturn]] void fail_short(const Path& file) {
  throw InputError(file.string() + ": the file ends before its last point");
}

void check_ascii(const Path& file, const Header& header, std::string_view body) {
  Lines lines(file, body, header.line_count);
  for (std::uint64_t i = 0; i < header.points; ++i) {
    const auto line = lines.next_filled();
    if (!line) fail_short(file);
    const auto words = words_of(*line);
    if (words.size() != header.values_per_point)
      lines.fail(std::to_string(words.size()) + " values where the header promises " +
                 std::to_string(header.values_per_point));
    for (const std::string_view word : words)
      if (!parse_number<double>(word)) lines.fail(in_quotes(word) + " is not a number");
  }
  if (lines.next_filled()) lines.fail("more points than the header promises");
}

std::uint32_t little_endian_word(std::string_view bytes) {
  std::uint32_t word = 0;
  for (int b = 3; b >= 0; --b) word = (word << 8) | static_cast<unsigned char>(bytes[b]);
  return word;
}

void check_compressed(const Path& file, const Header& header, std::string_view body) {
  constexpr std::size_t kSizes = 8;  // bytes of the two sizes in front
  // LZF's longest back reference makes 264 bytes out of 3.
  constexpr std::uint64_t kLargestRatio = 88;
  if (body.size() < kSizes) fail_short(file);
  const std::uint64_t packed = little_endian_word(body);
  const std::uint64_t plain = little_endian_word(body.substr(4));
  if (packed > body.size() - kSizes) fail_short(file);
  if (plain != header.points * header.point_size || plain > kLargestRatio * packed)
    throw InputError(file.string() + ": the compressed data do not hold " +
                     std::to_string(header.points) + " points");
}

void check_body(const Path& file, const Header& header, std::string_view body) {
  switch (header.data) {
    case Data::ascii:
      return check_ascii(file, header, body);
    case Data::compressed:
      return check_compressed(file, header, body);
    case Data::binary:
      if (body.size() < header.points * header.point_size) fail_short(file);
  }
}

struct Decoded {
  pcl::PCLPointCloud2 cloud;
  Eigen::Vector4f origin;
};

Decoded decode_with_pcl(const Path& file, const Header& header, const std::string& bytes) {
  silence_pcl();
  Decoded result;
  Eigen::Quaternionf orientation;
  int version = 0;
  int type = 0;
  unsigned int start = 0;
  int error = 0;
  try {
    pcl::PCDReader reader;
    std::istringstream stream(header.data == Data::ascii ? bytes : bytes.substr(0, header.size));
    error =
        reader.readHeader(stream, result.cloud, result.origin, orientation, version, type, start);
    const bool same = start == header.size && result.cloud.point_step == header.point_size &&
                      std::uint64_t{result.cloud.width} * result.cloud.height == header.points;
    if (error < 0 || !same) throw InputError("the header");
    stream.clear();
    stream.seekg(start);
    error = header.data == Data::ascii
                ? reader.readBodyASCII(stream, result.cloud, version)
                : reader.readBodyBinary(reinterpret_cast<const unsigned char*>(bytes.data()),
                                        result.cloud, version, type == 2, start);
    if (error < 0) throw InputError("the points");
  } catch (const std::exception& reason) {
    throw InputError(file.string() + ": PCL cannot read " + reason.what());
  }
  return result;
}

template <class T>
double value_at(const std::uint8_t* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return static_cast<double>(value);
}

// One field of a decoded cloud.
class FieldReader {
 public:
  FieldReader(const pcl::PCLPointCloud2& cloud, std::string_view name) : cloud_(&cloud) {
    for (const pcl::PCLPointField& field : cloud.fields)
      if (field.name == name && field.count == 1) field_ = &field;
  }

  explicit operator bool() const { return field_ != nullptr; }

  const std::uint8_t* bytes(std::size_t point) const {
    return cloud_->data.data() + point * cloud_->point_step + field_->offset;
  }

  double operator()(std::size_t point) const {
    using Field = pcl::PCLPointField;
    switch (field_->datatype) {
      case Field::INT8:
        return value_at<std::int8_t>(bytes(point));
      case Field::UINT8:
        return value_at<std::uint8_t>(bytes(point));
      case Field::INT16:
        return value_at<std::int16_t>(bytes(point));
      case Field::UINT16:
        return value_at<std::uint16_t>(bytes(point));
      case Field::INT32:
        return value_at<std::int32_t>(bytes(point));
      case Field::UINT32:
        return value_at<std::uint32_t>(bytes(point));
      case Field::INT64:
        return value_at<std::int64_t>(bytes(point));
      case Field::UINT64:
        return value_at<std::uint64_t>(bytes(point));
      case Field::FLOAT32:
        return value_at<float>(bytes(point));
      case Field::FLOAT64:
        return value_at<double>(bytes(point));
      default:
        return std::numeric_limits<double>::quiet_NaN();
    }
  }

  bool is_word() const {
    return field_->datatype == pcl::PCLPointField::UINT32 ||
           field_->datatype == pcl::PCLPointField::INT32 ||
           field_->datatype == pcl::PCLPointField::FLOAT32;
  }

 private:
  const pcl::PCLPointCloud2* cloud_;
  const pcl::PCLPointField* field_ = nullptr;
};

// Three fields side by side as 3N floats; empty unless all three are there.
std::vector<float> read_triples(const pcl::PCLPointCloud2& cloud,
                                const std::array<std::string_view, 3>& names, std::size_t points) {
  const std::array<FieldReader, 3> fields{
      FieldReader{cloud, names[0]}, FieldReader{cloud, names[1]}, FieldReader{cloud, names[2]}};
  if (!fields[0] || !fields[1] || !fields[2]) return {};
  std::vector<float> result(3 * points);
  for (std::size_t i = 0; i < points; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      result[3 * i + axis] = static_cast<float>(fields[axis](i));
  return result;
}

// The packed colour 0xAARRGGBB, whatever the declared type of its four bytes.
std::vector<float> read_colours(const pcl::PCLPointCloud2& cloud, std::size_t points) {
  FieldReader field(cloud, "rgba");
  if (!field) field = FieldReader(cloud, "rgb");
  if (!field || !field.is_word()) return {};
  std::vector<float> result(3 * points);
  for (std::size_t i = 0; i < points; ++i) {
    std::uint32_t word = 0;
    std::memcpy(&word, field.bytes(i), sizeof word);
    for (int c = 0; c < 3; ++c)
      result[3 * i + c] = static_cast<float>((word >> (16 - 8 * c)) & 0xFFU) / 255.0F;
  }
  return result;
}

constexpr Spelling kSpelling{.normal = {"normal_x", "normal_y", "normal_z"}, .packed_colour = true};

std::string repeated(std::span<const OutputColumn> columns,
                     const std::function<std::string(const OutputColumn&)>& word) {
  std::string text;
  for (const OutputColumn& column : columns) {
    text += ' ';
    text += word(column);
  }
  text += '\n';
  return text;
}

std::string type_letter(const OutputColumn& column) {
  switch (column.type) {
    case ColumnType::uint8:
    case ColumnType::uint32:
      return "U";
    case ColumnType::int32:
      return "I";
    case ColumnType::float32:
      return "F";
  }
  return "";
}

}  // namespace

Cloud decode(const Path& file, const std::string& bytes) {
  const Header header = parse_header(file, bytes);
  check_body(file, header, std::string_view(bytes).substr(header.size));
  const Decoded decoded = decode_with_pcl(file, header, bytes);
  const auto points = static_cast<std::size_t>(header.points);

  Cloud cloud;
  cloud.xyz = read_triples(decoded.cloud, {"x", "y", "z"}, points);
  if (cloud.xyz.empty()) throw InputError(file.string() + ": lacks the fields x y z");
  cloud.normal = read_triples(decoded.cloud, kSpelling.normal, points);
  cloud.rgb = read_colours(decoded.cloud, points);
  if (const FieldReader label(decoded.cloud, "label"); label) {
    cloud.label.reserve(points);
    for (std::size_t i = 0; i < points; ++i)
      cloud.label.push_back(label_number(file, "point", i, label(i)));
  }
  finish_labels(file, header.label_names, cloud);
  cloud.origin = {decoded.origin.x(), decoded.origin.y(), decoded.origin.z()};
  cloud.width = decoded.cloud.width;
  cloud.height = decoded.cloud.height;
  return cloud;
}

std::string encode(const Path& file, const Cloud& cloud, std::span<const Column> extra,
                   Encoding encoding) {
  const auto columns = columns_of(file, cloud, extra, kSpelling);
  const std::string points = std::to_string(cloud.size());
  std::string bytes = "# .PCD v0.7 - Point Cloud Data file format\n";
  bytes += label_comments(file, "#", cloud.label_names);
  bytes += "VERSION 0.7\nFIELDS" + repeated(columns, [](const auto& c) { return c.name; });
  bytes += "SIZE" + repeated(columns, [](const auto&) { return "4"; });
  bytes += "TYPE" + repeated(columns, type_letter);
  bytes += "COUNT" + repeated(columns, [](const auto&) { return "1"; });
  bytes += "WIDTH " + std::to_string(cloud.width) + "\nHEIGHT " + std::to_string(cloud.height);
  bytes += "\nVIEWPOINT";
  for (const float value : cloud.origin) append_number(bytes += ' ', value);
  bytes += " 1 0 0 0\nPOINTS " + points + "\nDATA ";
  bytes += encoding == Encoding::binary ? "binary\n" : "ascii\n";
  append_rows(bytes, columns, cloud.size(), encoding);
  return bytes;
}

}  // namespace cosegraph::io::pcd
