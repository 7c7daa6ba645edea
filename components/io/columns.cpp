#include "io/columns.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "io/text.hpp"

namespace cosegraph::io {
namespace {

double byte_of(float intensity) {
  return intensity > 0.0F ? std::round(255.0 * std::min(intensity, 1.0F)) : 0.0;  // NaN: 0
}

OutputColumn float_column(std::string_view name, const std::vector<float>& values, int axis) {
  return {std::string(name), ColumnType::float32,
          [&values, axis](std::size_t i) { return static_cast<double>(values[3 * i + axis]); }};
}

void add_colours(std::vector<OutputColumn>& columns, const Cloud& cloud, bool packed) {
  const auto channel = [&cloud](std::size_t i, int c) { return byte_of(cloud.rgb[3 * i + c]); };
  if (packed) {
    constexpr double kOpaque = 255.0;
    columns.push_back({"rgba", ColumnType::uint32, [channel](std::size_t i) {
                         return ((kOpaque * 256.0 + channel(i, 0)) * 256.0 + channel(i, 1)) *
                                    256.0 +
                                channel(i, 2);
                       }});
    return;
  }
  constexpr std::array<std::string_view, 3> kNames{"red", "green", "blue"};
  for (int c = 0; c < 3; ++c)
    columns.push_back({std::string(kNames[c]), ColumnType::uint8,
                       [channel, c](std::size_t i) { return channel(i, c); }});
}

void check_names(const std::filesystem::path& file, std::span<const OutputColumn> columns) {
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const std::string& name = columns[i].name;
    const auto visible = [](char c) { return c > ' ' && c <= '~'; };
    if (name.empty() || !std::all_of(name.begin(), name.end(), visible))
      throw InputError(file.string() + ": cannot write: " + in_quotes(name) + " is no column name");
    for (std::size_t j = 0; j < i; ++j)
      if (columns[j].name == name)
        throw InputError(file.string() + ": cannot write: two columns are named " +
                         in_quotes(name));
  }
}

void append_word(std::string& bytes, std::uint32_t word, int size) {
  for (int b = 0; b < size; ++b) bytes += static_cast<char>((word >> (8 * b)) & 0xFFU);
}

void append_binary(std::string& bytes, ColumnType type, double value) {
  switch (type) {
    case ColumnType::uint8:
      return append_word(bytes, static_cast<std::uint32_t>(value), 1);
    case ColumnType::int32:
      return append_word(bytes, static_cast<std::uint32_t>(static_cast<std::int32_t>(value)), 4);
    case ColumnType::uint32:
      return append_word(bytes, static_cast<std::uint32_t>(value), 4);
    case ColumnType::float32:
      return append_word(bytes, std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
  }
}

void append_text(std::string& bytes, ColumnType type, double value) {
  if (type != ColumnType::float32)
    append_number(bytes, static_cast<std::int64_t>(value));
  else if (std::isnan(value))
    bytes += "nan";
  else
    append_number(bytes, static_cast<float>(value));
}

std::size_t size_of(ColumnType type) {
  return type == ColumnType::uint8 ? 1 : 4;
}

}  // namespace

void check_point_count(const std::filesystem::path& file, std::uint64_t count) {
  if (count == 0) throw InputError(file.string() + ": holds no points");
  if (count > kMaxPoints)
    throw InputError(file.string() + ": " + std::to_string(count) + " points; at most " +
                     std::to_string(kMaxPoints) + " are read");
}

std::int32_t label_number(const std::filesystem::path& file, const char* kind, std::size_t index,
                          double value) {
  constexpr double kLargest = 2147483647.0;
  if (!(std::abs(value) <= kLargest) || value != std::floor(value))
    throw InputError(file.string() + ": the label of " + kind + " " + std::to_string(index) +
                     " is not a whole number in range");
  return static_cast<std::int32_t>(value);
}

void finish_labels(const std::filesystem::path& file, LabelNames names, Cloud& cloud) {
  if (!cloud.label.empty()) cloud.label_names = to_indices(file, std::move(names), cloud.label);
}

std::vector<OutputColumn> columns_of(const std::filesystem::path& file, const Cloud& cloud,
                                     std::span<const Column> extra, const Spelling& spelling) {
  constexpr std::array<std::string_view, 3> kPosition{"x", "y", "z"};
  std::vector<OutputColumn> columns;
  for (int axis = 0; axis < 3; ++axis)
    columns.push_back(float_column(kPosition[axis], cloud.xyz, axis));
  if (!cloud.normal.empty())
    for (int axis = 0; axis < 3; ++axis)
      columns.push_back(float_column(spelling.normal[axis], cloud.normal, axis));
  if (!cloud.rgb.empty()) add_colours(columns, cloud, spelling.packed_colour);
  if (!cloud.label.empty())
    columns.push_back({"label", ColumnType::int32,
                       [&cloud](std::size_t i) { return static_cast<double>(cloud.label[i]); }});
  for (const Column& column : extra) {
    if (column.value.size() != cloud.size())
      throw InputError(file.string() + ": cannot write: column " + in_quotes(column.name) +
                       " has " + std::to_string(column.value.size()) + " values for " +
                       std::to_string(cloud.size()) + " points");
    columns.push_back({column.name, ColumnType::float32, [value = column.value](std::size_t i) {
                         return static_cast<double>(value[i]);
                       }});
  }
  check_names(file, columns);
  return columns;
}

void append_rows(std::string& bytes, std::span<const OutputColumn> columns, std::size_t rows,
                 Encoding encoding) {
  std::size_t row_size = 0;
  for (const OutputColumn& column : columns) row_size += size_of(column.type);
  bytes.reserve(bytes.size() + rows * row_size);
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const double value = columns[c].value(i);
      if (encoding == Encoding::binary) {
        append_binary(bytes, columns[c].type, value);
      } else {
        append_text(bytes, columns[c].type, value);
        bytes += c + 1 < columns.size() ? ' ' : '\n';
      }
    }
  }
}

}  // namespace cosegraph::io
