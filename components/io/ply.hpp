// The PLY format (G. Turk, Stanford, 1994): any elements, any scalar types, lists, in ascii and
// both binary encodings. Internal to io: says nothing about what the elements mean.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cosegraph::io::ply {

enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

std::size_t size_of(Type type);

struct Property {
  std::string name;
  Type type = Type::float32;
  std::optional<Type> count_type;  // of a list; none: a scalar
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;

  // Position of the property named by any of `names`.
  std::optional<std::size_t> find(std::initializer_list<std::string_view> names) const;
};

enum class Format { ascii, little_endian, big_endian };

struct Header {
  Format format = Format::ascii;
  std::vector<Element> elements;
  std::vector<std::string> comments;
  std::size_t size = 0;  // bytes, "end_header" and its line end included
  std::size_t lines = 0;

  const Element* find(std::string_view name) const;
};

// True if `bytes` begins like a PLY file.
bool has_magic(std::string_view bytes);

// Throws InputError "FILE:LINE: ..." on anything that is not a PLY header.
Header parse_header(const std::filesystem::path& file, std::string_view bytes);

// One row of an element: for each property its values; a scalar has exactly one. Integers of all
// PLY types are exact in double.
using Row = std::vector<std::vector<double>>;
using Visitor = std::function<void(const Element&, std::size_t index, const Row&)>;

// Calls `visit` for every row of every element, in the file's order. Before that, refuses a file
// that is too short for the counts in its header, so that the caller may allocate by them. Throws
// InputError that names file and line or element and row.
void read_rows(const std::filesystem::path& file, std::string_view bytes, const Header& header,
               const Visitor& visit);

}  // namespace cosegraph::io::ply
