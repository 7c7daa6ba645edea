#include "tools/monitor/protocol.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/error.hpp"

namespace cosegraph::monitor {
namespace {

using nlohmann::json;

constexpr std::size_t kMaxListed = 1000;  // subscriptions in one message

// Text from elsewhere may hold anything; what is no UTF-8 is replaced.
std::string dump(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

std::uint32_t number_in(const json& value, const char* what) {
  if (!value.is_number_unsigned() || value.get<std::uint64_t>() > UINT32_MAX)
    throw InputError(std::string(what) + " is not a number of 32 bits");
  return value.get<std::uint32_t>();
}

const json& list_in(const json& message, const char* key) {
  const auto found = message.find(key);
  if (found == message.end() || !found->is_array())
    throw InputError(std::string(key) + " is not a list");
  if (found->size() > kMaxListed)
    throw InputError(std::string(key) + " has more than " + std::to_string(kMaxListed) +
                     " elements");
  return *found;
}

Subscribe parse_subscribe(const json& message) {
  Subscribe result;
  for (const auto& one : list_in(message, "subscriptions")) {
    if (!one.is_object() || !one.contains("id") || !one.contains("channelId"))
      throw InputError("a subscription needs id and channelId");
    result.subscriptions.push_back(
        {.id = number_in(one["id"], "id"), .channel = number_in(one["channelId"], "channelId")});
  }
  return result;
}

Unsubscribe parse_unsubscribe(const json& message) {
  Unsubscribe result;
  for (const auto& id : list_in(message, "subscriptionIds"))
    result.subscriptions.push_back(number_in(id, "subscriptionIds"));
  return result;
}

}  // namespace

std::string_view choose_subprotocol(std::string_view offered) {
  while (!offered.empty()) {
    const std::size_t comma = std::min(offered.find(','), offered.size());
    std::string_view word = offered.substr(0, comma);
    offered.remove_prefix(std::min(comma + 1, offered.size()));
    while (word.starts_with(' ') || word.starts_with('\t')) word.remove_prefix(1);
    while (word.ends_with(' ') || word.ends_with('\t')) word.remove_suffix(1);
    const auto found = std::ranges::find(kSubprotocols, word);
    if (found != kSubprotocols.end()) return *found;
  }
  return {};
}

ClientMessage parse_client_message(std::string_view text) {
  const json message = json::parse(text, nullptr, false);
  if (!message.is_object()) throw InputError("a message is not a JSON object");
  const auto found = message.find("op");
  if (found == message.end() || !found->is_string()) throw InputError("a message has no op");
  const auto op = found->get<std::string>();
  if (op == "subscribe") return parse_subscribe(message);
  if (op == "unsubscribe") return parse_unsubscribe(message);
  if (op == "subscribeConnectionGraph") return WatchConnections{true};
  if (op == "unsubscribeConnectionGraph") return WatchConnections{false};
  throw InputError("'" + op.substr(0, 40) + "' is nothing that this server offers");
}

std::string server_info(const std::string& name, const std::string& session) {
  return dump({{"op", "serverInfo"},
               {"name", name},
               {"capabilities", {"connectionGraph"}},
               {"metadata", {{"software", "cosegraph"}}},
               {"sessionId", session}});
}

std::string advertise(std::span<const Channel> channels, std::uint32_t first) {
  json list = json::array();
  for (const auto& channel : channels)
    list.push_back({{"id", first++},
                    {"topic", channel.topic},
                    {"encoding", channel.encoding},
                    {"schemaName", channel.schema_name},
                    {"schema", channel.schema},
                    {"schemaEncoding", channel.schema_encoding}});
  return dump({{"op", "advertise"}, {"channels", std::move(list)}});
}

std::string unadvertise(std::uint32_t first, std::size_t count) {
  json list = json::array();
  for (std::size_t i = 0; i < count; ++i) list.push_back(first + i);
  return dump({{"op", "unadvertise"}, {"channelIds", std::move(list)}});
}

std::string status(Level level, const std::string& message) {
  return dump({{"op", "status"}, {"level", static_cast<int>(level)}, {"message", message}});
}

std::string dropped_status(const std::map<std::string, std::uint64_t>& dropped) {
  std::uint64_t sum = 0;
  for (const auto& [topic, count] : dropped) sum += count;
  return dump({{"op", "status"},
               {"level", static_cast<int>(Level::warning)},
               {"id", "dropped"},
               {"message", std::to_string(sum) +
                               " messages were left out: this client reads slower than they come"},
               {"dropped", dropped}});
}

std::string connection_graph(std::span<const Channel> channels,
                             std::span<const std::string> removed) {
  json published = json::array();
  json subscribed = json::array();
  for (const auto& channel : channels) {
    if (!channel.publishers.empty())
      published.push_back({{"name", channel.topic}, {"publisherIds", channel.publishers}});
    if (!channel.subscribers.empty())
      subscribed.push_back({{"name", channel.topic}, {"subscriberIds", channel.subscribers}});
  }
  return dump({{"op", "connectionGraphUpdate"},
               {"publishedTopics", std::move(published)},
               {"subscribedTopics", std::move(subscribed)},
               {"advertisedServices", json::array()},
               {"removedTopics", std::vector<std::string>(removed.begin(), removed.end())},
               {"removedServices", json::array()}});
}

MessageHead message_head(std::uint32_t subscription, std::uint64_t time) {
  constexpr std::uint8_t kMessageData = 1;
  MessageHead head{kMessageData};
  for (std::size_t i = 0; i < 4; ++i)
    head[1 + i] = static_cast<std::uint8_t>(subscription >> (8 * i));
  for (std::size_t i = 0; i < 8; ++i) head[5 + i] = static_cast<std::uint8_t>(time >> (8 * i));
  return head;
}

}  // namespace cosegraph::monitor
