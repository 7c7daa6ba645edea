// A message taken apart by its IDL, without generated code: for comparing, printing and exporting
// messages of any type.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace cosegraph::idl {

struct Member {
  std::string name;                         // "header.epoch", "xyz", "channels[1].values"
  bool is_list = false;                     // a sequence or an array; else there is one value
  std::variant<std::vector<double>,         // float, double
               std::vector<std::int64_t>,   // signed integers
               std::vector<std::uint64_t>,  // unsigned integers, octets, booleans
               std::vector<std::string>>
      values;

  std::size_t size() const {
    return std::visit([](const auto& all) { return all.size(); }, values);
  }
};

// Every member in the order of the IDL, nested ones by their path; sequences of structs give the
// members of each struct. Throws InputError if the type is unknown, or the message is truncated or
// claims an impossible length; takes no more memory than a few times the message.
std::vector<Member> members_of(std::string_view type, std::span<const std::uint8_t> bytes);

}  // namespace cosegraph::idl
