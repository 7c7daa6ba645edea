#include "tools/monitor/protocol.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/error.hpp"

namespace cosegraph::monitor {
namespace {

using nlohmann::json;

constexpr const char* kServiceEncoding = "json";
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
    Subscribe::One wish{.id = number_in(one["id"], "id"),
                        .channel = number_in(one["channelId"], "channelId")};
    if (one.contains("part")) wish.part = number_in(one["part"], "part");
    result.subscriptions.push_back(wish);
  }
  return result;
}

Unsubscribe parse_unsubscribe(const json& message) {
  Unsubscribe result;
  for (const auto& id : list_in(message, "subscriptionIds"))
    result.subscriptions.push_back(number_in(id, "subscriptionIds"));
  return result;
}

void append(std::string& bytes, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i));
}

std::uint32_t take_number(std::string_view& bytes) {
  if (bytes.size() < 4) throw InputError("a binary message is too short");
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value |= static_cast<std::uint32_t>(static_cast<std::uint8_t>(bytes[i])) << (8 * i);
  bytes.remove_prefix(4);
  return value;
}

json ids_from(std::uint32_t first, std::size_t count) {
  json list = json::array();
  for (std::size_t i = 0; i < count; ++i) list.push_back(first + i);
  return list;
}

json half_of_service(const Service& service, const char* half, const std::string& schema) {
  return {{"encoding", kServiceEncoding},
          {"schemaName", service.name + " " + half},
          {"schemaEncoding", "jsonschema"},
          {"schema", schema}};
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

ServiceCall parse_service_call(std::string_view bytes) {
  constexpr char kOpcode = 2;
  if (!bytes.starts_with(kOpcode))
    throw InputError("this server takes no messages of clients but calls of its services");
  bytes.remove_prefix(1);
  ServiceCall call{};
  call.service = take_number(bytes);
  call.call = take_number(bytes);
  const std::uint32_t size = take_number(bytes);
  if (size > bytes.size()) throw InputError("a call is too short for its encoding's name");
  call.encoding = bytes.substr(0, size);
  call.request = bytes.substr(size);
  if (call.encoding != kServiceEncoding)
    throw InputError("services are called with JSON, not '" + call.encoding.substr(0, 40) + "'");
  return call;
}

std::string server_info(const std::string& name, const std::string& session) {
  return dump({{"op", "serverInfo"},
               {"name", name},
               {"capabilities", {"connectionGraph", "services"}},
               {"supportedEncodings", {kServiceEncoding}},
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
  return dump({{"op", "unadvertise"}, {"channelIds", ids_from(first, count)}});
}

std::string advertise_services(std::span<const Service> services, std::uint32_t first) {
  json list = json::array();
  for (const auto& service : services)
    list.push_back({{"id", first++},
                    {"name", service.name},
                    {"type", service.name},
                    {"request", half_of_service(service, "request", service.request_schema)},
                    {"response", half_of_service(service, "response", service.response_schema)}});
  return dump({{"op", "advertiseServices"}, {"services", std::move(list)}});
}

std::string unadvertise_services(std::uint32_t first, std::size_t count) {
  return dump({{"op", "unadvertiseServices"}, {"serviceIds", ids_from(first, count)}});
}

std::string service_response(const ServiceCall& call, const std::string& response) {
  std::string bytes(1, '\3');
  append(bytes, call.service);
  append(bytes, call.call);
  append(bytes, static_cast<std::uint32_t>(call.encoding.size()));
  return bytes + call.encoding + response;
}

std::string service_failure(const ServiceCall& call, const std::string& why) {
  return dump({{"op", "serviceCallFailure"},
               {"serviceId", call.service},
               {"callId", call.call},
               {"message", why}});
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

std::string connection_graph(std::span<const Channel> channels, std::span<const Service> services,
                             std::span<const std::string> removed) {
  json published = json::array();
  json subscribed = json::array();
  for (const auto& channel : channels) {
    if (!channel.publishers.empty())
      published.push_back({{"name", channel.topic}, {"publisherIds", channel.publishers}});
    if (!channel.subscribers.empty())
      subscribed.push_back({{"name", channel.topic}, {"subscriberIds", channel.subscribers}});
  }
  json provided = json::array();
  for (const auto& service : services)
    provided.push_back({{"name", service.name}, {"providerIds", {"monitor"}}});
  return dump({{"op", "connectionGraphUpdate"},
               {"publishedTopics", std::move(published)},
               {"subscribedTopics", std::move(subscribed)},
               {"advertisedServices", std::move(provided)},
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
