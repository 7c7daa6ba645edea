#include "graph/matching.hpp"

#include <fnmatch.h>

#include <algorithm>
#include <cstdio>

template <>
cosegraph::Names<cosegraph::graph::Durability> cosegraph::names<cosegraph::graph::Durability>() {
  using enum graph::Durability;
  static constexpr std::pair<graph::Durability, std::string_view> kTable[] = {
      {volatile_, "volatile"},
      {transient_local, "transient_local"},
      {transient, "transient"},
      {persistent, "persistent"}};
  return kTable;
}

template <>
cosegraph::Names<cosegraph::graph::Liveliness> cosegraph::names<cosegraph::graph::Liveliness>() {
  using enum graph::Liveliness;
  static constexpr std::pair<graph::Liveliness, std::string_view> kTable[] = {
      {automatic, "automatic"},
      {manual_by_participant, "manual_by_participant"},
      {manual_by_topic, "manual_by_topic"}};
  return kTable;
}

namespace cosegraph::graph {
namespace {

std::string seconds(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g s", value);
  return value == kForever ? "no limit" : text;
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "'" : ", '") + name + "'";
  return text.empty() ? "none" : text;
}

bool share_a_partition(const Endpoint& a, const Endpoint& b) {
  const std::vector<std::string> none{""};
  for (const auto& one : a.partitions.empty() ? none : a.partitions)
    for (const auto& other : b.partitions.empty() ? none : b.partitions)
      if (one == other || ::fnmatch(one.c_str(), other.c_str(), 0) == 0 ||
          ::fnmatch(other.c_str(), one.c_str(), 0) == 0)
        return true;
  return false;
}

std::string offered(const std::string& policy, std::string_view by_writer,
                    std::string_view by_reader) {
  return policy + ": the writer offers " + std::string(by_writer) + ", the reader requests " +
         std::string(by_reader);
}

const char* reliability_name(const Offer& qos) {
  return qos.reliable ? "reliable" : "best_effort";
}
const char* ownership_name(const Offer& qos) {
  return qos.exclusive ? "exclusive" : "shared";
}

}  // namespace

std::vector<std::string> mismatches(const Endpoint& writer, const Endpoint& reader) {
  std::vector<std::string> result;
  const Offer& has = writer.qos;
  const Offer& wants = reader.qos;
  if (writer.type != reader.type)
    result.push_back("type: the writer has " + writer.type + ", the reader " + reader.type);
  if (writer.keyed != reader.keyed)
    result.push_back(std::string("keys: the writer's type has ") +
                     (writer.keyed ? "a key" : "none") + ", the reader's " +
                     (reader.keyed ? "one" : "none"));
  if (!share_a_partition(writer, reader))
    result.push_back("partition: the writer is in " + listed(writer.partitions) +
                     ", the reader in " + listed(reader.partitions));
  if (wants.reliable && !has.reliable)
    result.push_back(offered("reliability", reliability_name(has), reliability_name(wants)));
  if (has.durability < wants.durability)
    result.push_back(offered("durability", to_name(has.durability), to_name(wants.durability)));
  if (has.deadline > wants.deadline)
    result.push_back(offered("deadline", seconds(has.deadline), seconds(wants.deadline)));
  if (has.exclusive != wants.exclusive)
    result.push_back(offered("ownership", ownership_name(has), ownership_name(wants)));
  if (has.liveliness < wants.liveliness)
    result.push_back(offered("liveliness", to_name(has.liveliness), to_name(wants.liveliness)));
  if (has.lease > wants.lease)
    result.push_back(offered("lease of liveliness", seconds(has.lease), seconds(wants.lease)));
  return result;
}

std::string to_text(const Offer& qos) {
  std::string text = reliability_name(qos);
  text += ", " + std::string(to_name(qos.durability));
  if (qos.deadline != kForever) text += ", deadline " + seconds(qos.deadline);
  if (qos.liveliness != Liveliness::automatic || qos.lease != kForever)
    text += ", liveliness " + std::string(to_name(qos.liveliness)) + " " + seconds(qos.lease);
  if (qos.exclusive) text += ", exclusive";
  return text;
}

}  // namespace cosegraph::graph
