// The server as clients meet it, over real sockets.
#include "tools/monitor/server.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/error.hpp"
#include "io/file.hpp"

namespace cosegraph::monitor {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using nlohmann::json;
using testing::HasSubstr;
using namespace std::chrono_literals;

// Two channels; says what was subscribed.
class FakeFeed final : public Feed {
 public:
  explicit FakeFeed(std::string name = "fake") : name_(std::move(name)) {}

  std::string name() const override { return name_; }
  const std::vector<Channel>& channels() const override { return channels_; }
  void open(Deliver deliver) override {
    deliver_ = std::move(deliver);
    opened = true;
  }
  std::vector<Message> subscribe(std::size_t channel, std::optional<std::size_t> part) override {
    ++subscribed[channel];
    const auto third = static_cast<std::uint8_t>(part.value_or(3));
    return {{.time = 5, .payload = std::make_shared<const idl::Bytes>(idl::Bytes{1, 2, third})}};
  }
  void unsubscribe(std::size_t channel) override { --subscribed[channel]; }
  std::size_t parts() const override { return 2; }

  void give(std::size_t channel, std::size_t size) const {
    deliver_(channel, {.time = 6, .payload = std::make_shared<const idl::Bytes>(size)});
  }

  // Answers with the request, or refuses it if it is empty.
  const std::vector<Service>& services() const override { return services_; }
  void call(std::size_t, const std::string& request, Reply reply) override {
    reply({.done = !request.empty(), .text = request.empty() ? "nothing is asked" : request});
  }

  std::atomic<bool> opened = false;
  std::array<std::atomic<int>, 2> subscribed{};

 private:
  std::string name_;
  std::vector<Channel> channels_ = {
      {.topic = "f/a/x", .encoding = "cdr", .publishers = {"a"}, .subscribers = {"b"}},
      {.topic = "f/monitor", .encoding = "json"}};
  std::vector<Service> services_ = {{.name = "f/swap"}};
  Deliver deliver_;
};

class Client {
 public:
  explicit Client(std::uint16_t port) : socket_(context_) {
    beast::get_lowest_layer(socket_).connect(
        tcp::endpoint(asio::ip::make_address("127.0.0.1"), port));
    beast::get_lowest_layer(socket_).expires_after(20s);
  }

  void open(const std::string& target = "/", const std::string& protocol = "foxglove.sdk.v1",
            const std::string& origin = "") {
    socket_.set_option(
        beast::websocket::stream_base::decorator([=](beast::websocket::request_type& request) {
          request.set(http::field::sec_websocket_protocol, protocol);
          if (!origin.empty()) request.set(http::field::origin, origin);
        }));
    socket_.handshake(response_, "localhost", target);
  }
  std::string protocol() const {
    return std::string(response_[http::field::sec_websocket_protocol]);
  }

  void say(const json& message) {
    socket_.text(true);
    socket_.write(asio::buffer(message.dump()));
  }
  void say(const std::string& text, bool is_text) {
    socket_.text(is_text);
    socket_.write(asio::buffer(text));
  }
  // The next message that is `op`, or binary if that is empty.
  json hear(const std::string& op) {
    for (;;) {
      const std::string bytes = read();
      if (socket_.got_text() == op.empty()) continue;
      if (op.empty()) return json::binary({bytes.begin(), bytes.end()});
      json message = json::parse(bytes);
      if (message["op"] == op) return message;
    }
  }
  std::string read() {
    beast::flat_buffer buffer;
    socket_.read(buffer);
    return beast::buffers_to_string(buffer.data());
  }

 private:
  asio::io_context context_;
  beast::websocket::stream<beast::tcp_stream> socket_;
  beast::websocket::response_type response_;
};

class ServerTest : public testing::Test {
 protected:
  ServerTest() {
    io::write_file(page_ / "index.html", "<title>page</title>");
    options_.page = page_.path();
  }

  FakeFeed& start() {
    server_ = std::make_unique<Server>(options_);
    auto feed = std::make_unique<FakeFeed>();
    FakeFeed& result = *feed;
    server_->show(std::move(feed));
    return result;
  }

  http::response<http::string_body> get(const std::string& target,
                                        const std::string& host = "localhost",
                                        http::verb verb = http::verb::get) const {
    http::request<http::empty_body> request(verb, target, 11);
    request.set(http::field::host, host);
    return answer_to(request);
  }

  // The status of the answer to a handshake.
  unsigned handshake(const std::string& target, const std::string& protocol,
                     const std::string& origin = "") const {
    http::request<http::empty_body> request(http::verb::get, target, 11);
    request.set(http::field::host, "localhost");
    request.set(http::field::connection, "Upgrade");
    request.set(http::field::upgrade, "websocket");
    request.set(http::field::sec_websocket_version, "13");
    request.set(http::field::sec_websocket_key, "dGhlIHNhbXBsZSBub25jZQ==");
    request.set(http::field::sec_websocket_protocol, protocol);
    if (!origin.empty()) request.set(http::field::origin, origin);
    return answer_to(request).result_int();
  }

  http::response<http::string_body> answer_to(
      const http::request<http::empty_body>& request) const {
    asio::io_context context;
    beast::tcp_stream stream(context);
    stream.connect(tcp::endpoint(asio::ip::make_address("127.0.0.1"), server_->port()));
    http::write(stream, request);
    beast::flat_buffer buffer;
    http::response<http::string_body> response;
    http::read(stream, buffer, response);
    return response;
  }

  static void wait(const std::atomic<int>& value, int wanted) {
    for (int i = 0; i < 1000 && value != wanted; ++i) std::this_thread::sleep_for(10ms);
    EXPECT_EQ(value, wanted);
  }

  const io::TemporaryFolder page_;
  ServerOptions options_;
  std::unique_ptr<Server> server_;
};

TEST_F(ServerTest, ServesThePage) {
  start();
  const auto response = get("/?x=1");
  EXPECT_EQ(response.result_int(), 200U);
  EXPECT_EQ(response.body(), "<title>page</title>");
  EXPECT_EQ(response[http::field::content_type], "text/html; charset=utf-8");
  EXPECT_EQ(response["X-Content-Type-Options"], "nosniff");
  EXPECT_EQ(get("/none.js").result_int(), 404U);
  EXPECT_EQ(get("/../index.html").result_int(), 404U);
  EXPECT_EQ(get("/", "localhost", http::verb::delete_).result_int(), 405U);
}

TEST_F(ServerTest, StrangersNamesAreRefused) {
  start();
  EXPECT_EQ(get("/", "evil.example").result_int(), 403U);
}

TEST_F(ServerTest, SaysThatThereIsNoPage) {
  options_.page = "/nowhere/at/all";
  start();
  const auto response = get("/");
  EXPECT_EQ(response.result_int(), 503U);
  EXPECT_THAT(response.body(), HasSubstr("Foxglove"));
}

TEST_F(ServerTest, SpeaksTheProtocol) {
  FakeFeed& feed = start();
  Client client(server_->port());
  client.open();
  EXPECT_EQ(client.protocol(), "foxglove.sdk.v1");
  EXPECT_EQ(client.hear("serverInfo")["name"], "cosegraph monitor: fake");
  const json channels = client.hear("advertise")["channels"];
  ASSERT_EQ(channels.size(), 2U);
  EXPECT_EQ(channels[0]["topic"], "f/a/x");
  client.say({{"op", "subscribeConnectionGraph"}});
  EXPECT_EQ(client.hear("connectionGraphUpdate")["subscribedTopics"][0]["name"], "f/a/x");
  client.say(
      {{"op", "subscribe"}, {"subscriptions", {{{"id", 9}, {"channelId", channels[0]["id"]}}}}});
  const json::binary_t late = client.hear("").get_binary();
  EXPECT_EQ(std::vector<std::uint8_t>(late),
            (std::vector<std::uint8_t>{1, 9, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3}));
  feed.give(0, 1000);
  EXPECT_EQ(client.hear("").get_binary().size(), 1013U);
  client.say({{"op", "unsubscribe"}, {"subscriptionIds", {9}}});
  wait(feed.subscribed[0], 0);
}

TEST_F(ServerTest, AFeedServesOnlyWhileSomebodyReads) {
  FakeFeed& feed = start();
  const json subscribe{{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", 1}}}}};
  {
    Client one(server_->port());
    Client two(server_->port());
    one.open();
    two.open();
    one.say(subscribe);
    two.say(subscribe);
    wait(feed.subscribed[0], 2);
  }
  // Told once, when the last has gone.
  wait(feed.subscribed[0], 1);
}

TEST_F(ServerTest, MisuseIsAnsweredAndSurvived) {
  start();
  Client client(server_->port());
  client.open();
  client.say("no json", true);
  EXPECT_EQ(client.hear("status")["level"], 2);
  client.say("binary", false);
  EXPECT_EQ(client.hear("status")["level"], 2);
  client.say({{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", 77}}}}});
  EXPECT_THAT(client.hear("status")["message"], HasSubstr("77"));
  const json twice{
      {"op", "subscribe"},
      {"subscriptions", {{{"id", 1}, {"channelId", 1}}, {{"id", 1}, {"channelId", 1}}}}};
  client.say(twice);
  EXPECT_THAT(client.hear("status")["message"], HasSubstr("in use"));
  client.say(
      {{"op", "subscribe"}, {"subscriptions", {{{"id", 2}, {"channelId", 1}, {"part", 2}}}}});
  EXPECT_THAT(client.hear("status")["message"], HasSubstr("no part 2"));
}

TEST_F(ServerTest, HugeMessagesEndTheConnection) {
  start();
  Client client(server_->port());
  client.open();
  client.say(std::string(options_.max_request + 1, 'x'), true);
  EXPECT_THROW(client.hear("status"), boost::system::system_error);
}

TEST_F(ServerTest, HandshakesAreChecked) {
  start();
  EXPECT_EQ(handshake("/", "foxglove.sdk.v1"), 101U);
  EXPECT_EQ(handshake("/", "chat"), 400U);
  EXPECT_EQ(handshake("/", "foxglove.sdk.v1", "http://evil.example"), 403U);
  server_.reset();
  options_.access.token = "word";
  start();
  EXPECT_EQ(handshake("/", "foxglove.sdk.v1"), 403U);
  EXPECT_EQ(handshake("/?token=worm", "foxglove.sdk.v1"), 403U);
  Client client(server_->port());
  client.open("/?token=word", "foxglove.websocket.v1", "https://app.example");
  EXPECT_EQ(client.hear("serverInfo")["op"], "serverInfo");
}

TEST_F(ServerTest, OneClientTooManyIsSentAway) {
  options_.max_clients = 1;
  start();
  Client first(server_->port());
  first.open();
  first.hear("serverInfo");
  Client second(server_->port());
  second.open();
  EXPECT_THROW(second.hear("serverInfo"), boost::system::system_error);
}

TEST_F(ServerTest, ASlowClientLosesTheOldestAndHearsOfIt) {
  options_.max_queued = 3'000'000;
  FakeFeed& feed = start();
  Client client(server_->port());
  client.open();
  client.say({{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", 1}}}}});
  client.hear("");
  // Nobody reads: far more than sockets and queue hold. The feed is never held up.
  constexpr int kGiven = 100;
  for (int i = 0; i < kGiven; ++i) feed.give(0, 1'000'000);
  std::uint64_t dropped = 0;
  std::uint64_t came = 0;
  while (came + dropped < kGiven) {
    const std::string bytes = client.read();
    const json message = json::parse(bytes, nullptr, false);
    if (message.is_object() && message["op"] == "status")
      dropped = message["dropped"]["f/a/x"];
    else if (!message.is_object())
      ++came;
  }
  EXPECT_EQ(came + dropped, kGiven);
  EXPECT_GT(dropped, 0U);
}

TEST_F(ServerTest, AnotherFeedTakesTheChannelsAway) {
  start();
  Client client(server_->port());
  client.open();
  const json before = client.hear("advertise")["channels"];
  client.say(
      {{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", before[0]["id"]}}}}});
  client.hear("");
  auto next = std::make_unique<FakeFeed>("next");
  FakeFeed& feed = *next;
  server_->show(std::move(next));
  EXPECT_EQ(client.hear("unadvertise")["channelIds"], (json{before[0]["id"], before[1]["id"]}));
  const json after = client.hear("advertise")["channels"];
  EXPECT_NE(after[0]["id"], before[0]["id"]);
  EXPECT_TRUE(feed.opened);
  // The old subscription is over, so its id is free again.
  client.say(
      {{"op", "subscribe"}, {"subscriptions", {{{"id", 1}, {"channelId", after[0]["id"]}}}}});
  client.hear("");
  EXPECT_EQ(feed.subscribed[0], 1);
}

TEST_F(ServerTest, AnAddressInUseIsToldByName) {
  start();
  options_.port = server_->port();
  try {
    const Server second(options_);
    FAIL() << "two servers at one port";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("127.0.0.1:" + std::to_string(options_.port)));
  }
}

TEST_F(ServerTest, ServicesAreCalled) {
  start();
  Client client(server_->port());
  client.open();
  const json offered = client.hear("advertiseServices");
  const std::uint8_t id = offered["services"][0]["id"];
  const auto call = [&](std::uint8_t service, const std::string& request) {
    std::string bytes{2, static_cast<char>(service), 0, 0, 0, 5, 0, 0, 0, 4, 0, 0, 0};
    client.say(bytes + "json" + request, false);
  };
  call(id, "{}");
  const json::binary_t answer = client.hear("").get_binary();
  EXPECT_EQ(std::string(answer.begin() + 13, answer.end()), "json{}");
  EXPECT_EQ(answer[0], 3);
  EXPECT_EQ(answer[5], 5);
  call(id, "");
  EXPECT_EQ(client.hear("serviceCallFailure")["message"], "nothing is asked");
  call(99, "{}");
  EXPECT_EQ(client.hear("serviceCallFailure")["callId"], 5);
  client.say("\1nonsense", false);
  EXPECT_EQ(client.hear("status")["level"], 2);
  // With the feed its services change.
  server_->show(std::make_unique<FakeFeed>("other"));
  EXPECT_EQ(client.hear("unadvertiseServices")["serviceIds"][0], id);
  EXPECT_NE(client.hear("advertiseServices")["services"][0]["id"], id);
}

}  // namespace
}  // namespace cosegraph::monitor
