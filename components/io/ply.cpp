#include "io/ply.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "core/error.hpp"
#include "io/text.hpp"

namespace cosegraph::io::ply {
namespace {

struct TypeName {
  std::string_view name;
  Type type;
};
constexpr std::array kTypeNames{
    TypeName{"char", Type::int8},       TypeName{"uchar", Type::uint8},
    TypeName{"short", Type::int16},     TypeName{"ushort", Type::uint16},
    TypeName{"int", Type::int32},       TypeName{"uint", Type::uint32},
    TypeName{"float", Type::float32},   TypeName{"double", Type::float64},
    TypeName{"int8", Type::int8},       TypeName{"uint8", Type::uint8},
    TypeName{"int16", Type::int16},     TypeName{"uint16", Type::uint16},
    TypeName{"int32", Type::int32},     TypeName{"uint32", Type::uint32},
    TypeName{"float32", Type::float32}, TypeName{"float64", Type::float64},
};

bool is_integer(Type type) {
  return type != Type::float32 && type != Type::float64;
}

Type parse_type(const Lines& lines, std::string_view word) {
  for (const auto& [name, type] : kTypeNames)
    if (name == word) return type;
  lines.fail(in_quotes(word) + " is not a PLY type");
}

Format parse_format(const Lines& lines, std::string_view text) {
  const auto words = words_of(text);
  if (words.size() != 2 || words[1] != "1.0") lines.fail("expected 'format ENCODING 1.0'");
  if (words[0] == "ascii") return Format::ascii;
  if (words[0] == "binary_little_endian") return Format::little_endian;
  if (words[0] == "binary_big_endian") return Format::big_endian;
  lines.fail(in_quotes(words[0]) + " is not a PLY encoding");
}

Element parse_element(const Lines& lines, const Header& header, std::string_view text) {
  const auto words = words_of(text);
  const auto count = words.size() == 2 ? parse_number<std::size_t>(words[1]) : std::nullopt;
  if (!count) lines.fail("expected 'element NAME COUNT'");
  if (header.find(words[0]) != nullptr) lines.fail("a second element " + in_quotes(words[0]));
  return {.name = std::string(words[0]), .count = *count};
}

Property parse_property(const Lines& lines, const Element& element, std::string_view text) {
  const auto words = words_of(text);
  Property property;
  if (words.size() == 2) {
    property = {.name = std::string(words[1]), .type = parse_type(lines, words[0])};
  } else if (words.size() == 4 && words[0] == "list") {
    property = {.name = std::string(words[3]),
                .type = parse_type(lines, words[2]),
                .count_type = parse_type(lines, words[1])};
    if (!is_integer(*property.count_type)) lines.fail("a list's count must be of an integer type");
  } else {
    lines.fail("expected 'property TYPE NAME' or 'property list TYPE TYPE NAME'");
  }
  if (element.find({property.name})) lines.fail("a second property " + in_quotes(property.name));
  return property;
}

double ascii_value(const Lines& lines, Type type, std::string_view& text) {
  const std::string_view word = take_word(text);
  if (word.empty()) lines.fail("the line has too few values");
  if (is_integer(type)) {
    if (const auto value = parse_number<std::int64_t>(word)) return static_cast<double>(*value);
    lines.fail(in_quotes(word) + " is not a whole number");
  }
  if (const auto value = parse_number<double>(word)) return *value;
  lines.fail(in_quotes(word) + " is not a number");
}

void read_ascii(const std::filesystem::path& file, std::string_view body, const Header& header,
                const Visitor& visit) {
  Lines lines(file, body, header.lines);
  Row row;
  for (const Element& element : header.elements) {
    if (element.properties.empty()) continue;
    row.assign(element.properties.size(), {});
    for (std::size_t i = 0; i < element.count; ++i) {
      auto line = lines.next_filled();
      if (!line)
        lines.fail("the file ends at " + element.name + " " + std::to_string(i) + " of " +
                   std::to_string(element.count));
      for (std::size_t p = 0; p < row.size(); ++p) {
        const Property& property = element.properties[p];
        double count = 1.0;
        if (property.count_type) count = ascii_value(lines, *property.count_type, *line);
        // Each value takes at least a digit and a blank.
        if (count < 0.0 || count > static_cast<double>(line->size()) / 2.0 + 1.0)
          lines.fail("the line is too short for its list");
        row[p].resize(static_cast<std::size_t>(count));
        for (double& value : row[p]) value = ascii_value(lines, property.type, *line);
      }
      if (!trimmed(*line).empty()) lines.fail("the line has too many values");
      visit(element, i, row);
    }
  }
}

// The bytes of a binary body, front to back.
class Bytes {
 public:
  Bytes(std::string_view rest, bool swap) : rest_(rest), swap_(swap) {}

  std::size_t left() const { return rest_.size(); }

  // left() must be at least size_of(type).
  double take(Type type) {
    switch (type) {
      case Type::int8:
        return take_as<std::int8_t>();
      case Type::uint8:
        return take_as<std::uint8_t>();
      case Type::int16:
        return take_as<std::int16_t>();
      case Type::uint16:
        return take_as<std::uint16_t>();
      case Type::int32:
        return take_as<std::int32_t>();
      case Type::uint32:
        return take_as<std::uint32_t>();
      case Type::float32:
        return take_as<float>();
      case Type::float64:
        return take_as<double>();
    }
    return 0.0;
  }

 private:
  template <class T>
  double take_as() {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), rest_.data(), sizeof(T));
    rest_.remove_prefix(sizeof(T));
    if (swap_) std::reverse(raw.begin(), raw.end());
    return static_cast<double>(std::bit_cast<T>(raw));
  }

  std::string_view rest_;
  bool swap_;
};

void read_binary(const std::filesystem::path& file, std::string_view body, const Header& header,
                 const Visitor& visit) {
  constexpr bool kLittleHost = std::endian::native == std::endian::little;
  Bytes bytes(body, (header.format == Format::little_endian) != kLittleHost);
  Row row;
  for (const Element& element : header.elements) {
    if (element.properties.empty()) continue;
    row.assign(element.properties.size(), {});
    for (std::size_t i = 0; i < element.count; ++i) {
      const auto need = [&](double count, Type type) {
        const std::size_t possible = bytes.left() / size_of(type);
        if (count < 0.0 || count > static_cast<double>(possible))
          throw InputError(file.string() + ": the file ends inside " + element.name + " " +
                           std::to_string(i) + " of " + std::to_string(element.count));
      };
      for (std::size_t p = 0; p < row.size(); ++p) {
        const Property& property = element.properties[p];
        double count = 1.0;
        if (property.count_type) {
          need(1.0, *property.count_type);
          count = bytes.take(*property.count_type);
        }
        need(count, property.type);
        row[p].resize(static_cast<std::size_t>(count));
        for (double& value : row[p]) value = bytes.take(property.type);
      }
      visit(element, i, row);
    }
  }
}

// The fewest bytes that a row of `element` can take.
std::size_t smallest_row(const Element& element, Format format) {
  std::size_t size = 0;
  for (const Property& property : element.properties)
    size += format == Format::ascii ? 2 : size_of(property.count_type.value_or(property.type));
  return size;
}

void check_counts(const std::filesystem::path& file, std::size_t body, const Header& header) {
  // The last line of an ascii file may lack its end.
  std::size_t left = header.format == Format::ascii ? body + 1 : body;
  for (const Element& element : header.elements) {
    const std::size_t row = smallest_row(element, header.format);
    if (row == 0) continue;
    if (element.count > left / row)
      throw InputError(file.string() + ": the header promises " + std::to_string(element.count) +
                       " of '" + element.name + "', but the file ends before that");
    left -= element.count * row;
  }
}

}  // namespace

std::size_t size_of(Type type) {
  switch (type) {
    case Type::int8:
    case Type::uint8:
      return 1;
    case Type::int16:
    case Type::uint16:
      return 2;
    case Type::int32:
    case Type::uint32:
    case Type::float32:
      return 4;
    case Type::float64:
      return 8;
  }
  return 0;
}

std::optional<std::size_t> Element::find(std::initializer_list<std::string_view> names) const {
  for (std::size_t i = 0; i < properties.size(); ++i)
    if (std::find(names.begin(), names.end(), properties[i].name) != names.end()) return i;
  return std::nullopt;
}

const Element* Header::find(std::string_view name) const {
  for (const Element& element : elements)
    if (element.name == name) return &element;
  return nullptr;
}

bool has_magic(std::string_view bytes) {
  return bytes.starts_with("ply\n") || bytes.starts_with("ply\r\n");
}

Header parse_header(const std::filesystem::path& file, std::string_view bytes) {
  if (!has_magic(bytes)) throw InputError(file.string() + ": is not a PLY file");
  Lines lines(file, bytes);
  lines.next();
  Header header;
  bool has_format = false;
  while (const auto line = lines.next()) {
    std::string_view text = trimmed(*line);
    const std::string_view key = take_word(text);
    if (key == "end_header") {
      if (!has_format) lines.fail("the header has no 'format' line");
      header.size = bytes.size() - lines.rest().size();
      header.lines = lines.number();
      return header;
    }
    if (key == "format") {
      header.format = parse_format(lines, text);
      has_format = true;
    } else if (key == "comment") {
      header.comments.emplace_back(trimmed(text));
    } else if (key == "element") {
      header.elements.push_back(parse_element(lines, header, text));
    } else if (key == "property") {
      if (header.elements.empty()) lines.fail("a property before the first element");
      Element& element = header.elements.back();
      element.properties.push_back(parse_property(lines, element, text));
    } else if (!key.empty() && key != "obj_info") {
      lines.fail("unknown header line " + in_quotes(key));
    }
  }
  lines.fail("the header has no end");
}

void read_rows(const std::filesystem::path& file, std::string_view bytes, const Header& header,
               const Visitor& visit) {
  const std::string_view body = bytes.substr(header.size);
  check_counts(file, body.size(), header);
  if (header.format == Format::ascii)
    read_ascii(file, body, header, visit);
  else
    read_binary(file, body, header, visit);
}

}  // namespace cosegraph::io::ply
