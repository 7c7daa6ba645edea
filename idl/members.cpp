#include "idl/members.hpp"

#include "idl/inspect.hpp"

namespace cosegraph::idl {
namespace {

void add(const Node& node, const std::string& name, std::vector<Member>& result) {
  if (node.kind == Kind::structure) {
    const std::string prefix = name.empty() ? "" : name + ".";
    if (!node.is_list)
      for (const auto& member : node.members)
        add(member, prefix + std::string(member.name), result);
    for (std::size_t i = 0; node.is_list && i < node.size(); ++i)
      add(node.members[i], name + "[" + std::to_string(i) + "]", result);
    return;
  }
  Member& member = result.emplace_back();
  member.name = name;
  member.is_list = node.is_list;
  switch (node.kind) {
    case Kind::float32:
    case Kind::float64:
      member.values = node.all_as<double>();
      break;
    case Kind::int32:
    case Kind::int64:
      member.values = node.all_as<std::int64_t>();
      break;
    case Kind::text:
      member.values = std::vector<std::string>(node.texts.begin(), node.texts.end());
      break;
    default:
      member.values = node.all_as<std::uint64_t>();
  }
}

}  // namespace

std::vector<Member> members_of(std::string_view type, std::span<const std::uint8_t> bytes) {
  std::vector<Member> result;
  add(inspect(type, bytes), "", result);
  return result;
}

}  // namespace cosegraph::idl
