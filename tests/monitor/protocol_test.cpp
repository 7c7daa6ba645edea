#include "tools/monitor/protocol.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "core/error.hpp"

namespace cosegraph::monitor {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(Subprotocol, BothNamesAreTaken) {
  EXPECT_EQ(choose_subprotocol("foxglove.websocket.v1"), "foxglove.websocket.v1");
  EXPECT_EQ(choose_subprotocol("foxglove.sdk.v1"), "foxglove.sdk.v1");
  EXPECT_EQ(choose_subprotocol("chat, \tfoxglove.sdk.v1 , foxglove.websocket.v1"),
            "foxglove.sdk.v1");
}

TEST(Subprotocol, OthersAreNot) {
  for (const auto offered :
       {"", "chat", "foxglove.websocket.v2", "foxglove.websocket.v1x", ",,, ,"})
    EXPECT_THAT(choose_subprotocol(offered), IsEmpty()) << offered;
}

TEST(ClientMessage, Subscribe) {
  const auto message = parse_client_message(
      R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":3},{"id":4294967295,"channelId":5,"part":2}]})");
  const auto& subscriptions = std::get<Subscribe>(message).subscriptions;
  ASSERT_EQ(subscriptions.size(), 2U);
  EXPECT_EQ(subscriptions[0].id, 0U);
  EXPECT_EQ(subscriptions[0].channel, 3U);
  EXPECT_EQ(subscriptions[1].id, 4294967295U);
  EXPECT_EQ(subscriptions[1].channel, 5U);
  EXPECT_EQ(subscriptions[0].part, std::nullopt);
  EXPECT_EQ(subscriptions[1].part, 2U);
}

TEST(ClientMessage, Unsubscribe) {
  const auto message = parse_client_message(R"({"op":"unsubscribe","subscriptionIds":[7,8]})");
  EXPECT_THAT(std::get<Unsubscribe>(message).subscriptions, ElementsAre(7, 8));
}

TEST(ClientMessage, ConnectionGraph) {
  EXPECT_TRUE(
      std::get<WatchConnections>(parse_client_message(R"({"op":"subscribeConnectionGraph"})"))
          .wanted);
  EXPECT_FALSE(
      std::get<WatchConnections>(parse_client_message(R"({"op":"unsubscribeConnectionGraph"})"))
          .wanted);
}

TEST(ClientMessage, HostileOnesAreRefused) {
  for (const auto text :
       {"", "[]", "7", "{", "{}", R"({"op":7})", R"({"op":"subscribe"})",
        R"({"op":"subscribe","subscriptions":{}})", R"({"op":"subscribe","subscriptions":[7]})",
        R"({"op":"subscribe","subscriptions":[{"id":1}]})",
        R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]})",
        R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":1.5}]})",
        R"({"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":1}]})",
        R"({"op":"subscribe","subscriptions":[{"id":"1","channelId":1}]})",
        R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":1,"part":-1}]})",
        R"({"op":"unsubscribe","subscriptionIds":[null]})", R"({"op":"getParameters"})",
        R"({"op":"advertise","channels":[]})"})
    EXPECT_THROW(parse_client_message(text), InputError) << text;
}

TEST(ClientMessage, EndlessListsAreRefused) {
  json list = json::array();
  for (int i = 0; i < 1001; ++i) list.push_back(i);
  EXPECT_THROW(parse_client_message(json{{"op", "unsubscribe"}, {"subscriptionIds", list}}.dump()),
               InputError);
}

TEST(ServerMessage, SaysWhatItOffers) {
  const json info = json::parse(server_info("name", "session"));
  EXPECT_EQ(info["op"], "serverInfo");
  EXPECT_EQ(info["name"], "name");
  EXPECT_EQ(info["sessionId"], "session");
  EXPECT_EQ(info["capabilities"], (json{"connectionGraph", "services"}));
}

TEST(ServerMessage, AdvertisesWithIdsInOrder) {
  const std::vector<Channel> channels = {{.topic = "g/a/x",
                                          .encoding = "cdr",
                                          .schema_name = "cosegraph::msg::Cloud",
                                          .schema = "module cosegraph {};",
                                          .schema_encoding = "omgidl"},
                                         {.topic = "g/monitor", .encoding = "json"}};
  const json message = json::parse(advertise(channels, 5));
  EXPECT_EQ(message["op"], "advertise");
  ASSERT_EQ(message["channels"].size(), 2U);
  EXPECT_EQ(message["channels"][0], (json{{"id", 5},
                                          {"topic", "g/a/x"},
                                          {"encoding", "cdr"},
                                          {"schemaName", "cosegraph::msg::Cloud"},
                                          {"schema", "module cosegraph {};"},
                                          {"schemaEncoding", "omgidl"}}));
  EXPECT_EQ(message["channels"][1]["id"], 6);
  EXPECT_EQ(json::parse(unadvertise(5, 2))["channelIds"], (json{5, 6}));
}

TEST(ServerMessage, ConnectionGraphHasPublishersAndSubscribers) {
  const std::vector<Channel> channels = {
      {.topic = "g/a/x", .publishers = {"a"}, .subscribers = {"b", "c"}},
      {.topic = "g/b/y", .publishers = {"b"}}};
  const std::vector<std::string> removed = {"g/old"};
  const json message = json::parse(connection_graph(channels, {}, removed));
  EXPECT_EQ(message["publishedTopics"], (json{{{"name", "g/a/x"}, {"publisherIds", {"a"}}},
                                              {{"name", "g/b/y"}, {"publisherIds", {"b"}}}}));
  EXPECT_EQ(message["subscribedTopics"],
            json::array({{{"name", "g/a/x"}, {"subscriberIds", {"b", "c"}}}}));
  EXPECT_EQ(message["removedTopics"], (json::array({"g/old"})));
}

TEST(ServerMessage, DroppedOnesAreCounted) {
  const json message = json::parse(dropped_status({{"g/a/x", 3}, {"g/b/y", 4}}));
  EXPECT_EQ(message["level"], 1);
  EXPECT_EQ(message["id"], "dropped");
  EXPECT_THAT(message["message"].get<std::string>(), HasSubstr("7 messages"));
  EXPECT_EQ(message["dropped"]["g/b/y"], 4);
}

std::string call_bytes(const std::string& encoding, const std::string& request) {
  std::string bytes("\2\7\0\0\0\11\1\0\0", 9);
  bytes += static_cast<char>(encoding.size());
  return bytes + std::string(3, '\0') + encoding + request;
}

TEST(ServiceCall, IsParsed) {
  const ServiceCall call = parse_service_call(call_bytes("json", "{}"));
  EXPECT_EQ(call.service, 7U);
  EXPECT_EQ(call.call, 256U + 9U);
  EXPECT_EQ(call.encoding, "json");
  EXPECT_EQ(call.request, "{}");
}

TEST(ServiceCall, OthersAreRefused) {
  const std::string whole = call_bytes("json", "");
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_THROW(parse_service_call(whole.substr(0, size)), InputError) << size;
  EXPECT_THROW(parse_service_call(call_bytes("cdr", "")), InputError);
  EXPECT_THROW(parse_service_call("\1" + whole.substr(1)), InputError);
}

TEST(ServiceCall, IsAnsweredInItsEncoding) {
  const ServiceCall call = parse_service_call(call_bytes("json", "{}"));
  EXPECT_EQ(service_response(call, "[1]"), "\3" + call_bytes("json", "[1]").substr(1));
  const json failure = json::parse(service_failure(call, "busy"));
  EXPECT_EQ(
      failure,
      (json{{"op", "serviceCallFailure"}, {"serviceId", 7}, {"callId", 265}, {"message", "busy"}}));
}

TEST(ServerMessage, AdvertisesServices) {
  const std::vector<Service> services{
      {.name = "g/swap", .request_schema = "{}", .response_schema = "[]"}};
  const json message = json::parse(advertise_services(services, 3));
  EXPECT_EQ(message["op"], "advertiseServices");
  const json& one = message["services"][0];
  EXPECT_EQ(one["id"], 3);
  EXPECT_EQ(one["name"], "g/swap");
  EXPECT_EQ(one["request"]["encoding"], "json");
  EXPECT_EQ(one["response"]["schema"], "[]");
  EXPECT_EQ(json::parse(unadvertise_services(3, 2))["serviceIds"], (json{3, 4}));
  EXPECT_EQ(json::parse(connection_graph({}, services))["advertisedServices"][0]["name"], "g/swap");
}

TEST(ServerMessage, TextThatIsNoUtf8IsStillJson) {
  const json message = json::parse(status(Level::error, "bad \xff name"));
  EXPECT_EQ(message["level"], 2);
}

TEST(MessageHead, LittleEndian) {
  EXPECT_THAT(message_head(0x01020304, 0x1112131415161718),
              ElementsAre(1, 4, 3, 2, 1, 0x18, 0x17, 0x16, 0x15, 0x14, 0x13, 0x12, 0x11));
}

}  // namespace
}  // namespace cosegraph::monitor
