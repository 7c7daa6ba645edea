// Any encoded message as a tree of named members, read by the IDL of its type instead of generated
// code: for printing, JSON, comparing, whatever the type.
//
// Numbers and texts stay where they are in the message, but for lists that travel without zeros:
// these are as they were before. A hostile message is refused before anything is allocated for what
// it merely claims; the tree takes at most some hundred times the bytes of the message, and 128 MB
// of zeros.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace cosegraph::idl {

enum class Kind { boolean, octet, int32, uint32, int64, uint64, float32, float64, text, structure };

using Number = std::variant<bool, std::int64_t, std::uint64_t, float, double>;

// A member of a message, or the message itself. Lives no longer than the bytes it was read from.
struct Node {
  std::string_view name;  // empty: the message, or an element of a list
  Kind kind = Kind::structure;
  bool is_list = false;  // a sequence or an array; else there is one value
  bool is_time = false;  // ns since 1970
  // Of a list of numbers that is a matrix, row by row, as the comments of the IDL tell ("3N",
  // "points x dimension"); 1: it is none.
  std::size_t columns = 1;

  std::span<const std::uint8_t> numbers;  // as they are in the message, or in `unpacked`
  bool swapped = false;                   // they are in the other byte order
  // The numbers of a list that travels without zeros (see sparse.hpp).
  std::shared_ptr<const std::vector<float>> unpacked;
  std::vector<std::string_view> texts;
  // Members of a structure; of a list of structures a nameless node for each.
  std::vector<Node> members;

  bool is_number() const { return kind != Kind::text && kind != Kind::structure; }
  std::size_t size() const;  // values in the list; 1 if it is none
  Number number(std::size_t index) const;
  double as_double(std::size_t index) const;
  // All of a list of numbers, much faster than one by one. Wide: double, float, std::int64_t,
  // std::uint64_t or std::int32_t.
  template <class Wide>
  std::vector<Wide> all_as() const;
};

// Throws InputError for a type that does not travel ("Cloud"), and for a message that is truncated
// or claims an impossible length.
Node inspect(std::string_view type, std::span<const std::uint8_t> bytes);

// Likewise for a type by its name on the wire; throws InputError if it is not one of ours.
Node inspect_wire(std::string_view wire_type, std::span<const std::uint8_t> bytes);

// What "header.stage", "ports[2].bytes" or "xyz[7]" names in the tree. Throws ParameterError that
// names what there is instead.
Node select(const Node& root, std::string_view path);

}  // namespace cosegraph::idl
