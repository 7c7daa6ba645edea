// Endpoints as discovery tells of them, and whether DDS lets them talk to each other. Knows no DDS.
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "core/names.hpp"

namespace cosegraph::graph {

enum class Durability { volatile_, transient_local, transient, persistent };
enum class Liveliness { automatic, manual_by_participant, manual_by_topic };

constexpr double kForever = std::numeric_limits<double>::infinity();

// What a writer offers or a reader requests. Depths of histories are not told.
struct Offer {
  bool reliable = true;
  Durability durability = Durability::volatile_;
  Liveliness liveliness = Liveliness::automatic;
  double lease = kForever;     // s
  double deadline = kForever;  // s
  bool exclusive = false;      // ownership
};

struct Endpoint {
  std::string guid;
  std::string participant;  // its guid
  bool is_writer = false;
  std::string topic;
  std::string type;    // on the wire
  bool keyed = false;  // the topic has instances
  std::vector<std::string> partitions;
  Offer qos;
};

// Why the reader does not hear the writer on their topic: each reason as a sentence with both
// values, in the order in which they are told to people: type, keys, partition, QoS policies.
// Empty: they match.
std::vector<std::string> mismatches(const Endpoint& writer, const Endpoint& reader);

// One line: "reliable, transient_local"; what is not the default is added.
std::string to_text(const Offer& qos);

}  // namespace cosegraph::graph

template <>
cosegraph::Names<cosegraph::graph::Durability> cosegraph::names<cosegraph::graph::Durability>();
template <>
cosegraph::Names<cosegraph::graph::Liveliness> cosegraph::names<cosegraph::graph::Liveliness>();
