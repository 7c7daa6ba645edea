#include "idl/inspect.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <map>
#include <optional>
#include <type_traits>

#include "core/error.hpp"
#include "core/fields.hpp"
#include "idl/codec.hpp"
#include "idl/schema.hpp"
#include "idl/sparse.hpp"

namespace cosegraph::idl {
namespace {

// -- the IDL -------------------------------------------------------------------------------------

struct Declaration {
  std::string name;
  std::string type;  // "unsigned long", "string", or a structure's name
  bool is_sequence = false;
  std::size_t array = 0;  // length; 0: no array
  std::string comment;
};

using Declarations = std::vector<Declaration>;
using Structures = std::map<std::string, Declarations, std::less<>>;

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

// "sequence<long> label", "float origin[3]", "unsigned long width".
Declaration declaration_of(std::string_view code, std::string_view comment) {
  Declaration result{.comment = std::string(comment)};
  if (code.ends_with(']')) {
    const std::size_t bracket = code.find('[');
    result.array = std::stoul(std::string(code.substr(bracket + 1)));
    code = code.substr(0, bracket);
  }
  const std::size_t space = code.rfind(' ');
  result.name = code.substr(space + 1);
  std::string_view type = trimmed(code.substr(0, space));
  constexpr std::string_view kSequence = "sequence<";
  if (type.starts_with(kSequence)) {
    result.is_sequence = true;
    type = type.substr(kSequence.size(), type.size() - kSequence.size() - 1);
  }
  result.type = type;
  return result;
}

// Reads what our own files consist of: structures, one member per line.
void add_structures(std::string_view text, Structures& structures) {
  Declarations* open = nullptr;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::size_t slashes = line.find("//");
    const std::string_view code = trimmed(line.substr(0, slashes));
    const std::string_view comment =
        slashes == std::string_view::npos ? "" : trimmed(line.substr(slashes + 2));
    constexpr std::string_view kStruct = "struct ";
    if (code.starts_with(kStruct)) {
      open = &structures[std::string(code.substr(kStruct.size()))];
      open->clear();
    } else if (code.starts_with('}')) {
      open = nullptr;
    } else if (open != nullptr && code.ends_with(';')) {
      open->push_back(declaration_of(trimmed(code.substr(0, code.size() - 1)), comment));
    }
  }
}

const Structures& all_structures() {
  static const Structures structures = [] {
    Structures result;
    for (const auto type : type_names()) add_structures(idl_text(type), result);
    return result;
  }();
  return structures;
}

std::optional<Kind> kind_of(std::string_view type) {
  static const std::map<std::string_view, Kind> kKinds = {
      {"boolean", Kind::boolean}, {"octet", Kind::octet},
      {"long", Kind::int32},      {"unsigned long", Kind::uint32},
      {"long long", Kind::int64}, {"unsigned long long", Kind::uint64},
      {"float", Kind::float32},   {"double", Kind::float64},
      {"string", Kind::text}};
  const auto found = kKinds.find(type);
  if (found == kKinds.end()) return std::nullopt;
  return found->second;
}

std::size_t bytes_of(Kind kind) {
  switch (kind) {
    case Kind::boolean:
    case Kind::octet:
      return 1;
    case Kind::int32:
    case Kind::uint32:
    case Kind::float32:
      return 4;
    case Kind::int64:
    case Kind::uint64:
    case Kind::float64:
      return 8;
    case Kind::text:
    case Kind::structure:
      break;
  }
  return 0;
}

// -- matrices ------------------------------------------------------------------------------------

bool is_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

std::string_view first_word(std::string_view text) {
  std::size_t end = 0;
  while (end < text.size() && is_word(text[end])) ++end;
  return text.substr(0, end);
}

// How many `symbol` stands for among the members of a structure: a count by its name, or what the
// comment of a count or of a list calls it.
std::size_t meaning_of(std::string_view symbol, const std::vector<Node>& members,
                       const Declarations& declarations) {
  for (std::size_t i = 0; i < members.size(); ++i) {
    const Node& member = members[i];
    if (member.name != symbol && first_word(declarations[i].comment) != symbol) continue;
    if (member.is_list) return std::max(member.size(), std::size_t{1});
    const bool is_count = member.kind == Kind::int32 || member.kind == Kind::uint32;
    const double value = is_count ? member.as_double(0) : 0.0;
    return value >= 1.0 ? static_cast<std::size_t>(value) : 1;
  }
  return 1;
}

// The columns that a list's comment gives it: "3N, ...", "M x E", "rbf: L x V".
std::size_t columns_of(const Node& list, std::string_view comment, const std::vector<Node>& members,
                       const Declarations& declarations) {
  if (const std::size_t colon = comment.find(": "); colon != std::string_view::npos)
    comment.remove_prefix(colon + 2);
  const std::string_view rows = first_word(comment);
  std::size_t columns = 1;
  if (rows.size() == 2 && rows[0] >= '2' && rows[0] <= '9') {
    columns = static_cast<std::size_t>(rows[0] - '0');
  } else if (comment.substr(rows.size()).starts_with(" x ")) {
    columns = meaning_of(first_word(comment.substr(rows.size() + 3)), members, declarations);
  }
  return list.size() > 0 && list.size() % columns == 0 ? columns : 1;
}

// -- messages ------------------------------------------------------------------------------------

class Reader {
 public:
  Reader(std::string_view type, std::span<const std::uint8_t> bytes) : type_(type) {
    constexpr std::size_t kEncapsulation = 4;
    if (bytes.size() < kEncapsulation || bytes[0] != 0 || bytes[1] > 1) fail();
    swapped_ = (bytes[1] == 1) != (std::endian::native == std::endian::little);
    body_ = bytes.subspan(kEncapsulation);
  }

  Node message() {
    Node root;
    root.members = members(all_structures().find(type_)->second);
    return root;
  }

 private:
  [[noreturn]] void fail() const {
    throw InputError(std::string(type_) + " message is truncated or claims an impossible length");
  }

  std::vector<Node> members(const Declarations& declarations) {
    std::vector<Node> result;
    result.reserve(declarations.size());
    for (const auto& declaration : declarations) result.push_back(member(declaration));
    const auto present = unpack(result);
    for (std::size_t i = 0; i < result.size(); ++i)
      if (result[i].is_list && result[i].is_number())
        result[i].columns = columns_of(result[i], declarations[i].comment, result, declarations);
    if (present != result.end()) result.erase(present);  // told by where the zeros are
    return result;
  }

  // Puts zeros back where `present` says; returns it, or the end if there is none.
  std::vector<Node>::iterator unpack(std::vector<Node>& members) {
    const auto values = std::ranges::find(members, "values", &Node::name);
    if (values == members.begin() || values == members.end()) return members.end();
    const auto present = std::prev(values);
    if (present->name != "present") return members.end();
    values->unpacked = std::make_shared<const std::vector<float>>(
        unpacker_.unpack(present->all_as<std::uint32_t>(), values->all_as<float>()));
    values->numbers = {reinterpret_cast<const std::uint8_t*>(values->unpacked->data()),
                       values->unpacked->size() * sizeof(float)};
    values->swapped = false;
    return present;
  }

  Node member(const Declaration& declaration) {
    Node node{.name = declaration.name,
              .is_list = declaration.is_sequence || declaration.array > 0};
    const std::size_t count = declaration.is_sequence ? length()
                              : node.is_list          ? declaration.array
                                                      : 1;
    if (const auto kind = kind_of(declaration.type)) {
      node.kind = *kind;
      node.is_time = declaration.comment.find("ns since 1970") != std::string::npos;
      if (*kind == Kind::text)
        node.texts = texts(count);
      else
        node.numbers = numbers(count, bytes_of(*kind));
      node.swapped = swapped_;
      return node;
    }
    const Declarations& inner = all_structures().at(declaration.type);
    if (!node.is_list) {
      node.members = members(inner);
      return node;
    }
    // Every structure takes at least a byte, so a hostile count ends with the bytes.
    if (count > body_.size() - at_) fail();
    for (std::size_t i = 0; i < count; ++i) node.members.push_back({.members = members(inner)});
    return node;
  }

  // Nothing is aligned for no elements.
  std::span<const std::uint8_t> numbers(std::size_t count, std::size_t size) {
    if (count == 0) return {};
    const std::size_t begin = (at_ + size - 1) / size * size;
    if (begin > body_.size() || count > (body_.size() - begin) / size) fail();
    at_ = begin + count * size;
    return body_.subspan(begin, count * size);
  }

  std::size_t length() {
    const Node count{.kind = Kind::uint32, .numbers = numbers(1, 4), .swapped = swapped_};
    return std::get<std::uint64_t>(count.number(0));
  }

  std::vector<std::string_view> texts(std::size_t count) {
    if (count > (body_.size() - at_) / 4 + 1) fail();
    std::vector<std::string_view> result;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t size = length();  // with the final zero
      const auto text = numbers(size, 1);
      result.emplace_back(reinterpret_cast<const char*>(text.data()), size > 0 ? size - 1 : 0);
    }
    return result;
  }

  std::string_view type_;
  bool swapped_ = false;
  std::span<const std::uint8_t> body_;
  std::size_t at_ = 0;
  Unpacker unpacker_;
};

template <class T>
T read(const Node& node, std::size_t index) {
  if constexpr (std::is_same_v<T, bool>) {
    return read<std::uint8_t>(node, index) != 0;
  } else {
    std::array<std::uint8_t, sizeof(T)> raw{};
    std::memcpy(raw.data(), node.numbers.data() + index * sizeof(T), sizeof(T));
    if (node.swapped) std::ranges::reverse(raw);
    return std::bit_cast<T>(raw);
  }
}

// Calls `use` with the std::type_identity of the type in which the node's numbers travel.
template <class Use>
auto with_type_of(const Node& node, Use use) {
  switch (node.kind) {
    case Kind::boolean:
      return use(std::type_identity<bool>{});
    case Kind::octet:
      return use(std::type_identity<std::uint8_t>{});
    case Kind::int32:
      return use(std::type_identity<std::int32_t>{});
    case Kind::uint32:
      return use(std::type_identity<std::uint32_t>{});
    case Kind::int64:
      return use(std::type_identity<std::int64_t>{});
    case Kind::uint64:
      return use(std::type_identity<std::uint64_t>{});
    case Kind::float32:
      return use(std::type_identity<float>{});
    case Kind::float64:
      return use(std::type_identity<double>{});
    case Kind::text:
    case Kind::structure:
      break;
  }
  throw Error("'" + std::string(node.name) + "' is not a number");
}

// -- paths ---------------------------------------------------------------------------------------

Node element(const Node& list, std::size_t index) {
  Node node = list;
  node.is_list = false;
  node.columns = 1;
  if (list.kind == Kind::structure)
    node.members = std::vector<Node>(list.members[index].members);
  else if (list.kind == Kind::text)
    node.texts = {list.texts[index]};
  else
    node.numbers = list.numbers.subspan(index * bytes_of(list.kind), bytes_of(list.kind));
  return node;
}

const Node& member_named(const Node& node, std::string_view name, std::string_view path) {
  std::vector<std::string> names;
  if (node.kind == Kind::structure && !node.is_list)
    for (const auto& member : node.members) names.emplace_back(member.name);
  for (const auto& member : node.members)
    if (!node.is_list && member.name == name) return member;
  if (names.empty())
    throw ParameterError(
        "field '" + std::string(path) +
        "': " + (node.is_list ? "say which one of the list, as '" : "nothing is inside '") +
        std::string(node.name) + (node.is_list ? "[0]'" : "'"));
  std::string all;
  for (const auto& one : names) all += (all.empty() ? "" : ", ") + one;
  throw ParameterError("field '" + std::string(path) + "': there is no '" + std::string(name) +
                       "'" + did_you_mean(name, names) + " (there are: " + all + ")");
}

}  // namespace

std::size_t Node::size() const {
  if (!is_list) return 1;
  if (kind == Kind::structure) return members.size();
  return kind == Kind::text ? texts.size() : numbers.size() / bytes_of(kind);
}

Number Node::number(std::size_t index) const {
  return with_type_of(*this, [&]<class T>(std::type_identity<T>) -> Number {
    const T value = read<T>(*this, index);
    if constexpr (std::is_same_v<T, bool> || std::is_floating_point_v<T>)
      return value;
    else if constexpr (std::is_signed_v<T>)
      return std::int64_t{value};
    else
      return std::uint64_t{value};
  });
}

double Node::as_double(std::size_t index) const {
  return std::visit([](auto value) { return static_cast<double>(value); }, number(index));
}

template <class Wide>
std::vector<Wide> Node::all_as() const {
  return with_type_of(*this, [&]<class T>(std::type_identity<T>) {
    std::vector<Wide> values(size());
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = static_cast<Wide>(read<T>(*this, i));
    return values;
  });
}

template std::vector<double> Node::all_as() const;
template std::vector<float> Node::all_as() const;
template std::vector<std::int32_t> Node::all_as() const;
template std::vector<std::uint32_t> Node::all_as() const;
template std::vector<std::int64_t> Node::all_as() const;
template std::vector<std::uint64_t> Node::all_as() const;

Node inspect(std::string_view type, std::span<const std::uint8_t> bytes) {
  if (std::ranges::find(type_names(), type) == type_names().end())
    throw InputError("there is no message type '" + std::string(type) + "'");
  return Reader(type, bytes).message();
}

Node inspect_wire(std::string_view type, std::span<const std::uint8_t> bytes) {
  for (const auto name : type_names())
    if (wire_type(name) == type) return inspect(name, bytes);
  throw InputError("the type '" + std::string(type) + "' is not one of this program's");
}

Node select(const Node& root, std::string_view path) {
  Node node = root;
  std::string_view rest = path;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('.'), rest.size());
    std::string_view step = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    std::string_view index_text;
    const std::size_t bracket = step.find('[');
    if (bracket != std::string_view::npos && step.ends_with(']')) {
      index_text = step.substr(bracket + 1, step.size() - bracket - 2);
      step = step.substr(0, bracket);
    }
    node = Node(member_named(node, step, path));
    if (bracket == std::string_view::npos) continue;
    std::size_t index = 0;
    const auto [last, error] =
        std::from_chars(index_text.data(), index_text.data() + index_text.size(), index);
    if (!node.is_list || error != std::errc() || last != index_text.data() + index_text.size() ||
        index >= node.size())
      throw ParameterError("field '" + std::string(path) + "': '" + std::string(step) + "' has " +
                           (node.is_list ? std::to_string(node.size()) + " values, from [0] on"
                                         : "one value and no index"));
    node = element(node, index);
  }
  return node;
}

}  // namespace cosegraph::idl
