// What every cloud format has in common: columns of numbers with conventional names. Internal to
// io.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/cloud.hpp"
#include "io/cloud_io.hpp"
#include "io/labels.hpp"

namespace cosegraph::io {

// Throws InputError naming the file unless 1 <= count <= kMaxPoints.
void check_point_count(const std::filesystem::path& file, std::uint64_t count);

// `value` as a label number. Throws InputError naming the file and the `kind` ("point", "face") and
// index of its owner if it is not whole.
std::int32_t label_number(const std::filesystem::path& file, const char* kind, std::size_t index,
                          double value);

// Throws InputError naming the file if what is to be written does not fit together.
template <class Value>
void check_before_writing(const std::filesystem::path& file, const Value& value) {
  try {
    check_sizes(value);
  } catch (const InputError& error) {
    throw InputError(file.string() + ": cannot write: " + error.what());
  }
}

// Turns the numbers in cloud.label into indices and sets cloud.label_names.
void finish_labels(const std::filesystem::path& file, LabelNames names, Cloud& cloud);

enum class ColumnType { uint8, int32, uint32, float32 };

struct OutputColumn {
  std::string name;
  ColumnType type;
  std::function<double(std::size_t point)> value;
};

// How a format spells what a cloud holds.
struct Spelling {
  std::array<std::string_view, 3> normal;
  bool packed_colour;  // one "rgba" word instead of "red green blue" bytes
};

// The columns of `cloud`, then `extra`. They refer to both. Throws InputError naming the file if
// lengths do not fit or a column's name is not one word or is taken.
std::vector<OutputColumn> columns_of(const std::filesystem::path& file, const Cloud& cloud,
                                     std::span<const Column> extra, const Spelling& spelling);

// Appends all rows: little endian, or one line of text per row.
void append_rows(std::string& bytes, std::span<const OutputColumn> columns, std::size_t rows,
                 Encoding encoding);

}  // namespace cosegraph::io
