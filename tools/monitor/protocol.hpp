// The Foxglove WebSocket protocol, version 1: what the server says, and what clients may say to it.
// Text only; knows neither sockets nor queues.
//
// https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "tools/monitor/channel.hpp"

namespace cosegraph::monitor {

// Both names stand for the same protocol.
constexpr std::array<std::string_view, 2> kSubprotocols = {"foxglove.websocket.v1",
                                                           "foxglove.sdk.v1"};

// The first of the subprotocols in a Sec-WebSocket-Protocol field ("a, b") that is ours; empty:
// none.
std::string_view choose_subprotocol(std::string_view offered);

// -- from clients --------------------------------------------------------------------------------

struct Subscribe {
  struct One {
    std::uint32_t id;  // chosen by the client, unique among its subscriptions
    std::uint32_t channel;
    std::optional<std::uint32_t> part;  // our extension: of the frames of a file
  };
  std::vector<One> subscriptions;
};

struct Unsubscribe {
  std::vector<std::uint32_t> subscriptions;
};

struct WatchConnections {
  bool wanted;
};

// A binary message.
struct ServiceCall {
  std::uint32_t service;
  std::uint32_t call;  // chosen by the client
  std::string encoding;
  std::string request;
};

using ClientMessage = std::variant<Subscribe, Unsubscribe, WatchConnections>;

// Throws InputError for what is not understood, and for what the server has not offered.
ClientMessage parse_client_message(std::string_view text);
// The only binary message that is understood. Throws InputError.
ServiceCall parse_service_call(std::string_view bytes);

// -- to clients ----------------------------------------------------------------------------------

enum class Level { info = 0, warning = 1, error = 2 };

std::string server_info(const std::string& name, const std::string& session);
// Channel number `first` + i is channels[i].
std::string advertise(std::span<const Channel> channels, std::uint32_t first);
std::string unadvertise(std::uint32_t first, std::size_t count);
// The same for services; requests and responses are JSON.
std::string advertise_services(std::span<const Service> services, std::uint32_t first);
std::string unadvertise_services(std::uint32_t first, std::size_t count);
// The end of a call: a binary message.
std::string service_response(const ServiceCall& call, const std::string& response);
std::string service_failure(const ServiceCall& call, const std::string& why);
std::string status(Level level, const std::string& message);
// How many messages of which topics this client has missed. A status that replaces the one before;
// our page reads the counts from the extra field "dropped".
std::string dropped_status(const std::map<std::string, std::uint64_t>& dropped);
// The whole graph of publishers and subscribers; `removed`: topics that are gone.
std::string connection_graph(std::span<const Channel> channels, std::span<const Service> services,
                             std::span<const std::string> removed = {});

// What comes before the payload in a binary message.
using MessageHead = std::array<std::uint8_t, 13>;
MessageHead message_head(std::uint32_t subscription, std::uint64_t time);

}  // namespace cosegraph::monitor
