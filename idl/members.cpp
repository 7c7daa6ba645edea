#include "idl/members.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cstring>
#include <map>

#include "core/error.hpp"
#include "idl/codec.hpp"
#include "idl/schema.hpp"

namespace cosegraph::idl {
namespace {

// How a member of an IDL struct is declared.
struct Declaration {
  std::string name;
  std::string type;  // "unsigned long", "string", or a struct's name
  bool is_sequence = false;
  std::size_t array = 0;  // length; 0: no array
};

using Structs = std::map<std::string, std::vector<Declaration>, std::less<>>;

// The words and signs of an IDL file, without comments.
std::vector<std::string> tokens_of(std::string_view text) {
  std::vector<std::string> tokens;
  for (std::size_t i = 0; i < text.size();) {
    const auto is_word = [&](std::size_t at) {
      return at < text.size() &&
             (std::isalnum(static_cast<unsigned char>(text[at])) != 0 || text[at] == '_');
    };
    if (text.substr(i, 2) == "//") {
      i = std::min(text.find('\n', i), text.size());
    } else if (is_word(i)) {
      std::size_t end = i;
      while (is_word(end)) ++end;
      tokens.emplace_back(text.substr(i, end - i));
      i = end;
    } else {
      if (std::isspace(static_cast<unsigned char>(text[i])) == 0) tokens.emplace_back(1, text[i]);
      ++i;
    }
  }
  return tokens;
}

// "sequence < long > label", "float origin [ 3 ]", "unsigned long width".
Declaration declaration_of(std::vector<std::string> words) {
  Declaration result;
  if (words.back() == "]") {
    result.array = std::stoul(words[words.size() - 2]);
    words.resize(words.size() - 3);
  }
  result.name = words.back();
  words.pop_back();
  if (words.front() == "sequence") {
    result.is_sequence = true;
    words.erase(words.begin(), words.begin() + 2);
    words.pop_back();
  }
  for (const auto& word : words) result.type += (result.type.empty() ? "" : " ") + word;
  return result;
}

// Our own files; whatever else IDL can say does not occur in them.
void add_structs(std::string_view text, Structs& structs) {
  const std::vector<std::string> tokens = tokens_of(text);
  for (std::size_t i = 0; i + 1 < tokens.size(); ++i) {
    if (tokens[i] != "struct") continue;
    std::vector<Declaration> members;
    std::vector<std::string> words;
    std::size_t at = i + 3;
    for (; tokens[at] != "}"; ++at) {
      if (tokens[at] != ";") {
        words.push_back(tokens[at]);
        continue;
      }
      members.push_back(declaration_of(std::move(words)));
      words.clear();
    }
    structs[tokens[i + 1]] = std::move(members);
    i = at;
  }
}

const Structs& all_structs() {
  static const Structs structs = [] {
    Structs result;
    for (const auto type : type_names()) add_structs(idl_text(type), result);
    return result;
  }();
  return structs;
}

class Reader {
 public:
  Reader(std::string_view type, std::span<const std::uint8_t> bytes) : type_(type) {
    constexpr std::size_t kEncapsulation = 4;
    if (bytes.size() < kEncapsulation || bytes[0] != 0 || bytes[1] > 1) fail();
    swap_ = (bytes[1] == 1) != (std::endian::native == std::endian::little);
    body_ = bytes.subspan(kEncapsulation);
  }

  std::vector<Member> all() {
    const auto found = all_structs().find(type_);
    if (found == all_structs().end())
      throw InputError("there is no message type '" + std::string(type_) + "'");
    members(found->second, "");
    return std::move(result_);
  }

 private:
  [[noreturn]] void fail() const {
    throw InputError(std::string(type_) + " message is truncated or claims an impossible length");
  }

  void members(const std::vector<Declaration>& declarations, const std::string& prefix) {
    for (const auto& declaration : declarations) member(declaration, prefix);
  }

  void member(const Declaration& declaration, const std::string& prefix) {
    const std::string name = prefix + declaration.name;
    const std::size_t count = declaration.is_sequence ? number<std::uint32_t>()
                              : declaration.array > 0 ? declaration.array
                                                      : 1;
    const bool is_list = declaration.is_sequence || declaration.array > 0;
    if (const auto nested = all_structs().find(declaration.type); nested != all_structs().end()) {
      if (count > body_.size() - at_) fail();
      for (std::size_t i = 0; i < count; ++i)
        members(nested->second, is_list ? name + "[" + std::to_string(i) + "]." : name + ".");
      return;
    }
    Member member{.name = name, .is_list = is_list};
    read(declaration.type, count, member);
    result_.push_back(std::move(member));
  }

  void read(const std::string& type, std::size_t count, Member& member) {
    if (type == "string")
      member.values = strings(count);
    else if (type == "float")
      member.values = numbers<float, double>(count);
    else if (type == "double")
      member.values = numbers<double, double>(count);
    else if (type == "long")
      member.values = numbers<std::int32_t, std::int64_t>(count);
    else if (type == "long long")
      member.values = numbers<std::int64_t, std::int64_t>(count);
    else if (type == "unsigned long")
      member.values = numbers<std::uint32_t, std::uint64_t>(count);
    else if (type == "unsigned long long")
      member.values = numbers<std::uint64_t, std::uint64_t>(count);
    else if (type == "octet" || type == "boolean")
      member.values = numbers<std::uint8_t, std::uint64_t>(count);
    else
      throw Error("IDL type '" + type + "' is not known here");
  }

  template <class Number>
  Number number() {
    at_ = (at_ + sizeof(Number) - 1) / sizeof(Number) * sizeof(Number);
    if (at_ > body_.size() || sizeof(Number) > body_.size() - at_) fail();
    std::array<std::uint8_t, sizeof(Number)> raw{};
    std::memcpy(raw.data(), body_.data() + at_, raw.size());
    if (swap_) std::reverse(raw.begin(), raw.end());
    at_ += sizeof(Number);
    return std::bit_cast<Number>(raw);
  }

  template <class Number, class Wide>
  std::vector<Wide> numbers(std::size_t count) {
    if (count > (body_.size() - at_) / sizeof(Number)) fail();
    std::vector<Wide> values(count);
    for (auto& value : values) value = static_cast<Wide>(number<Number>());
    return values;
  }

  std::vector<std::string> strings(std::size_t count) {
    std::vector<std::string> values;
    for (std::size_t i = 0; i < count; ++i) {
      const auto length = number<std::uint32_t>();  // with the final zero
      if (length > body_.size() - at_) fail();
      const auto* begin = reinterpret_cast<const char*>(body_.data() + at_);
      values.emplace_back(begin, length > 0 ? length - 1 : 0);
      at_ += length;
    }
    return values;
  }

  std::string_view type_;
  bool swap_ = false;
  std::span<const std::uint8_t> body_;
  std::size_t at_ = 0;
  std::vector<Member> result_;
};

}  // namespace

std::vector<Member> members_of(std::string_view type, std::span<const std::uint8_t> bytes) {
  return Reader(type, bytes).all();
}

}  // namespace cosegraph::idl
