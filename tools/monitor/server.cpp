#include "tools/monitor/server.hpp"

#include <algorithm>
#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <future>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <thread>

#include "core/error.hpp"
#include "tools/monitor/outbox.hpp"
#include "tools/monitor/protocol.hpp"

namespace cosegraph::monitor {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using namespace std::chrono_literals;

using Request = http::request<http::empty_body>;
using Response = http::response<http::string_body>;

constexpr auto kPatience = 15s;         // for a request to come, and an answer to go
constexpr auto kDroppedPeriod = 500ms;  // between two accounts of what a client missed
constexpr std::size_t kMaxSubscriptions = 256;

std::string_view view_of(beast::string_view text) {
  return {text.data(), text.size()};
}

std::string random_word() {
  std::random_device entropy;
  char text[17];
  std::snprintf(text, sizeof text, "%08x%08x", entropy(), entropy());
  return text;
}

class Client;

// What sessions need of the server. Used in its thread only.
class Hub {
 public:
  explicit Hub(const ServerOptions& options) : options_(options), page_(load_page(options.page)) {}

  const ServerOptions& options() const { return options_; }
  const std::map<std::string, StaticFile, std::less<>>& page() const { return page_; }

  const Feed* feed() const { return feed_.get(); }
  const std::string& session() const { return session_; }
  // Channel ids on the wire: a new feed's channels have new ids.
  std::uint32_t first_id() const { return first_id_; }
  std::uint32_t first_service() const { return first_service_; }
  std::optional<std::size_t> service_at(std::uint32_t id) const {
    if (feed_ == nullptr || id < first_service_ || id - first_service_ >= feed_->services().size())
      return std::nullopt;
    return id - first_service_;
  }
  std::optional<std::size_t> place_of(std::uint32_t id) const {
    if (feed_ == nullptr || id < first_id_ || id - first_id_ >= feed_->channels().size())
      return std::nullopt;
    return id - first_id_;
  }

  bool join(const std::shared_ptr<Client>& client) {
    if (clients_.size() >= options_.max_clients) return false;
    clients_.insert(client);
    return true;
  }
  void leave(const std::shared_ptr<Client>& client) { clients_.erase(client); }

  std::vector<Message> subscribe(std::size_t channel, std::optional<std::size_t> part) {
    ++readers_[channel];
    return feed_->subscribe(channel, part);
  }
  void unsubscribe(std::size_t channel) {
    if (feed_ != nullptr && --readers_[channel] == 0) feed_->unsubscribe(channel);
  }

  void call(std::size_t service, const std::string& request, Reply reply) {
    feed_->call(service, request, std::move(reply));
  }

  void show(std::unique_ptr<Feed> feed, const Deliver& deliver);
  void deliver(std::size_t channel, const Message& message);
  void close();

  std::size_t connections = 0;

 private:
  const ServerOptions options_;
  const std::map<std::string, StaticFile, std::less<>> page_;
  const std::string session_ = random_word();
  std::unique_ptr<Feed> feed_;
  std::uint32_t first_id_ = 1;
  std::uint32_t first_service_ = 1;
  std::vector<int> readers_;  // per channel
  std::set<std::shared_ptr<Client>> clients_;
};

// -- one client of the WebSocket protocol --------------------------------------------------------

class Client : public std::enable_shared_from_this<Client> {
 public:
  Client(Hub& hub, beast::tcp_stream stream)
      : hub_(hub),
        socket_(std::move(stream)),
        timer_(socket_.get_executor()),
        outbox_(hub.options().max_queued) {}

  void accept(const Request& request, std::string_view subprotocol) {
    // From here on the WebSocket has time limits of its own, with pings to idle clients.
    beast::get_lowest_layer(socket_).expires_never();
    socket_.set_option(websocket::stream_base::timeout::suggested(beast::role_type::server));
    socket_.set_option(websocket::stream_base::decorator(
        [word = std::string(subprotocol)](websocket::response_type& response) {
          response.set(http::field::sec_websocket_protocol, word);
          response.set(http::field::server, "cosegraph");
        }));
    socket_.read_message_max(hub_.options().max_request);
    socket_.auto_fragment(false);
    socket_.async_accept(request, [self = shared_from_this()](beast::error_code error) {
      if (!error) self->start();
    });
  }

  // The feed has changed: what was subscribed is gone.
  void announce(const std::vector<std::string>& farewell) {
    for (const auto& [id, channel] : subscriptions_) outbox_.forget(id);
    subscriptions_.clear();
    for (const auto& text : farewell) send(text);
    if (hub_.feed() == nullptr) return;
    send(advertise(hub_.feed()->channels(), hub_.first_id()));
    if (!hub_.feed()->services().empty())
      send(advertise_services(hub_.feed()->services(), hub_.first_service()));
    if (watches_connections_) tell_connections();
  }

  void take(std::size_t channel, const Message& message) {
    for (const auto& [id, subscribed] : subscriptions_)
      if (subscribed == channel) outbox_.push(id, message);
    write();
  }

  void close() {
    beast::error_code ignored;
    beast::get_lowest_layer(socket_).socket().close(ignored);
  }

 private:
  void start() {
    if (!hub_.join(shared_from_this())) {
      socket_.async_close({websocket::close_code::try_again_later, "too many clients"},
                          [self = shared_from_this()](beast::error_code) {});
      return;
    }
    joined_ = true;
    send(server_info(
        "cosegraph monitor" + (hub_.feed() == nullptr ? "" : ": " + hub_.feed()->name()),
        hub_.session()));
    announce({});
    account();
    read();
  }

  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) return self->leave();
      self->answer();
      self->buffer_.clear();
      self->read();
    });
  }

  void answer() {
    try {
      const auto data = buffer_.cdata();
      const std::string_view bytes(static_cast<const char*>(data.data()), data.size());
      if (socket_.got_text())
        std::visit([this](const auto& wish) { fulfil(wish); }, parse_client_message(bytes));
      else
        fulfil(parse_service_call(bytes));
    } catch (const std::exception& error) {
      send(status(Level::error, error.what()));
    }
  }

  void fulfil(const Subscribe& wish) {
    for (const auto& one : wish.subscriptions) {
      const auto channel = hub_.place_of(one.channel);
      if (!channel) {
        send(status(Level::error, "there is no channel " + std::to_string(one.channel)));
      } else if (subscriptions_.contains(one.id) || subscriptions_.size() >= kMaxSubscriptions) {
        send(status(Level::error,
                    "subscription " + std::to_string(one.id) + " is in use, or one too many"));
      } else if (one.part && *one.part >= hub_.feed()->parts()) {
        send(status(Level::error, "there is no part " + std::to_string(*one.part)));
      } else {
        subscriptions_[one.id] = *channel;
        for (const auto& message : hub_.subscribe(*channel, one.part))
          outbox_.push(one.id, message);
      }
    }
    write();
  }

  void fulfil(const Unsubscribe& wish) {
    for (const auto id : wish.subscriptions) {
      const auto found = subscriptions_.find(id);
      if (found == subscriptions_.end()) continue;
      hub_.unsubscribe(found->second);
      subscriptions_.erase(found);
      outbox_.forget(id);
    }
  }

  void fulfil(const WatchConnections& wish) {
    watches_connections_ = wish.wanted;
    if (wish.wanted && hub_.feed() != nullptr) tell_connections();
  }

  void fulfil(const ServiceCall& call) {
    const auto service = hub_.service_at(call.service);
    if (!service)
      return send(service_failure(call, "there is no service " + std::to_string(call.service)));
    hub_.call(*service, call.request,
              [call, client = weak_from_this(), executor = socket_.get_executor()](Answer answer) {
                asio::post(executor, [call, client, answer = std::move(answer)] {
                  if (const auto self = client.lock()) self->finish(call, answer);
                });
              });
  }

  void finish(const ServiceCall& call, const Answer& answer) {
    if (!answer.done) return send(service_failure(call, answer.text));
    outbox_.push(service_response(call, answer.text), true);
    write();
  }

  void tell_connections() {
    send(connection_graph(hub_.feed()->channels(), hub_.feed()->services()));
  }

  void send(std::string text) {
    outbox_.push(std::move(text));
    write();
  }

  void write() {
    if (outbox_.is_hopeless()) return close();
    if (writing_ || !joined_) return;
    auto next = outbox_.pop();
    if (!next) return;
    writing_ = std::move(*next);
    const auto done = [self = shared_from_this()](beast::error_code error, std::size_t) {
      self->writing_.reset();
      if (!error) self->write();
    };
    socket_.text(writing_->payload == nullptr && !writing_->is_binary);
    if (writing_->payload == nullptr)
      socket_.async_write(asio::buffer(writing_->text), done);
    else
      socket_.async_write(std::array<asio::const_buffer, 2>{asio::buffer(writing_->head),
                                                            asio::buffer(*writing_->payload)},
                          done);
  }

  // Tells the client, now and then, what it has missed.
  void account() {
    timer_.expires_after(kDroppedPeriod);
    timer_.async_wait([self = shared_from_this()](beast::error_code error) {
      if (error || !self->joined_) return;
      self->tell_dropped();
      self->account();
    });
  }

  void tell_dropped() {
    if (outbox_.dropped() == told_ || hub_.feed() == nullptr) return;
    for (const auto& [id, count] : outbox_.dropped()) {
      const auto found = subscriptions_.find(id);
      if (found != subscriptions_.end())
        missed_[hub_.feed()->channels()[found->second].topic] +=
            count - (told_.contains(id) ? told_[id] : 0);
    }
    told_ = outbox_.dropped();
    send(dropped_status(missed_));
  }

  void leave() {
    if (!joined_) return;
    joined_ = false;
    timer_.cancel();
    for (const auto& [id, channel] : subscriptions_) hub_.unsubscribe(channel);
    subscriptions_.clear();
    hub_.leave(shared_from_this());
  }

  Hub& hub_;
  websocket::stream<beast::tcp_stream> socket_;
  asio::steady_timer timer_;
  beast::flat_buffer buffer_;
  Outbox outbox_;
  std::optional<Outbox::Item> writing_;
  std::map<std::uint32_t, std::size_t> subscriptions_;  // channel by the client's id
  bool joined_ = false;
  bool watches_connections_ = false;
  std::map<std::uint32_t, std::uint64_t> told_;
  std::map<std::string, std::uint64_t> missed_;
};

void Hub::show(std::unique_ptr<Feed> feed, const Deliver& deliver) {
  std::vector<std::string> farewell;
  if (feed_ != nullptr) {
    farewell.push_back(unadvertise(first_id_, feed_->channels().size()));
    if (const std::size_t count = feed_->services().size(); count > 0) {
      farewell.push_back(unadvertise_services(first_service_, count));
      first_service_ += static_cast<std::uint32_t>(count);
    }
    first_id_ += static_cast<std::uint32_t>(feed_->channels().size());
  }
  feed_ = std::move(feed);
  readers_.assign(feed_ == nullptr ? 0 : feed_->channels().size(), 0);
  if (feed_ != nullptr) feed_->open(deliver);
  for (const auto& client : clients_) client->announce(farewell);
}

void Hub::deliver(std::size_t channel, const Message& message) {
  for (const auto& client : clients_) client->take(channel, message);
}

void Hub::close() {
  for (const auto& client : clients_) client->close();
  clients_.clear();
  feed_.reset();
}

// -- one connection ------------------------------------------------------------------------------

class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Hub& hub, tcp::socket socket) : hub_(hub), stream_(std::move(socket)) {
    ++hub_.connections;
  }
  ~Connection() { --hub_.connections; }

  void read() {
    parser_.emplace();
    parser_->header_limit(8U << 10U);
    parser_->body_limit(0);
    stream_.expires_after(kPatience);
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](beast::error_code error, std::size_t) {
                       if (error) return self->close();
                       self->answer(self->parser_->release());
                     });
  }

 private:
  void answer(const Request& request) {
    const std::string_view target = view_of(request.target());
    const std::string_view host = view_of(request[http::field::host]);
    const std::string_view origin = view_of(request[http::field::origin]);
    const bool upgrade = websocket::is_upgrade(request);
    // The page's files are no secret, but a stranger's page shall not even learn that they are
    // here.
    const Access& access = hub_.options().access;
    const std::string refused = upgrade || access.token.empty()
                                    ? refusal(access, host, origin, query_value(target, "token"))
                                    : "";
    if (!refused.empty()) return send(text(request, http::status::forbidden, refused));
    if (upgrade) return switch_protocol(request);
    if (request.method() != http::verb::get && request.method() != http::verb::head)
      return send(text(request, http::status::method_not_allowed, "only GET is served"));
    send(file(request, target.substr(0, target.find('?'))));
  }

  void switch_protocol(const Request& request) {
    const std::string_view word =
        choose_subprotocol(view_of(request[http::field::sec_websocket_protocol]));
    if (word.empty())
      return send(text(request, http::status::bad_request,
                       "this server speaks the subprotocol foxglove.websocket.v1"));
    std::make_shared<Client>(hub_, std::move(stream_))->accept(request, word);
  }

  Response file(const Request& request, std::string_view path) const {
    const auto found = hub_.page().find(path);
    if (found != hub_.page().end())
      return respond(request, http::status::ok, found->second.type, found->second.bytes);
    if (path == "/" && hub_.page().empty())
      return text(request, http::status::service_unavailable,
                  "The monitor's page was not built (it needs npm when cosegraph is built).\n"
                  "Foxglove and other viewers can connect here all the same: Foxglove WebSocket, "
                  "ws://" +
                      std::string(view_of(request[http::field::host])) + "\n");
    return text(request, http::status::not_found, "there is no such file");
  }

  static Response text(const Request& request, http::status status, const std::string& message) {
    return respond(request, status, "text/plain; charset=utf-8", message);
  }

  static Response respond(const Request& request, http::status status, const std::string& type,
                          const std::string& body) {
    Response response(status, request.version());
    response.set(http::field::server, "cosegraph");
    response.set(http::field::content_type, type);
    response.set(http::field::cache_control, "no-cache");
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Referrer-Policy", "no-referrer");
    response.set("Content-Security-Policy",
                 "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
                 "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'");
    response.keep_alive(request.keep_alive());
    response.body() = body;
    response.prepare_payload();
    if (request.method() == http::verb::head) response.body().clear();
    return response;
  }

  void send(Response response) {
    response_ = std::move(response);
    stream_.expires_after(kPatience);
    http::async_write(stream_, *response_,
                      [self = shared_from_this()](beast::error_code error, std::size_t) {
                        if (error || !self->response_->keep_alive()) return self->close();
                        self->read();
                      });
  }

  void close() {
    beast::error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
  }

  Hub& hub_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{16U << 10U};
  std::optional<http::request_parser<http::empty_body>> parser_;
  std::optional<Response> response_;
};

}  // namespace

// -- the server ----------------------------------------------------------------------------------

class Server::Impl {
 public:
  explicit Impl(const ServerOptions& options)
      : hub_(options), acceptor_(context_), max_arriving_(options.max_arriving) {
    listen(options);
    accept();
    thread_ = std::thread([this] { context_.run(); });
  }

  ~Impl() {
    run([this] {
      beast::error_code ignored;
      acceptor_.close(ignored);
      hub_.close();
    });
    context_.stop();
    thread_.join();
  }

  std::uint16_t port() const { return port_; }
  bool has_page() const { return hub_.page().contains("/"); }

  void show(std::unique_ptr<Feed> feed) {
    run([this, &feed] {
      const std::uint64_t number = ++feed_number_;
      hub_.show(std::move(feed), [this, number](std::size_t channel, Message message) {
        arrive(number, channel, std::move(message));
      });
    });
  }

 private:
  void listen(const ServerOptions& options) {
    try {
      tcp::resolver resolver(context_);
      const auto found = resolver.resolve(options.host, std::to_string(options.port),
                                          tcp::resolver::passive | tcp::resolver::numeric_service);
      const tcp::endpoint endpoint = *found.begin();
      acceptor_.open(endpoint.protocol());
      acceptor_.set_option(asio::socket_base::reuse_address(true));
      acceptor_.bind(endpoint);
      acceptor_.listen();
      port_ = acceptor_.local_endpoint().port();
    } catch (const boost::system::system_error& error) {
      throw InputError("cannot listen at " + options.host + ":" + std::to_string(options.port) +
                       ": " + error.code().message());
    }
  }

  void accept() {
    acceptor_.async_accept([this](beast::error_code error, tcp::socket socket) {
      if (error == asio::error::operation_aborted) return;
      if (!error && hub_.connections < hub_.options().max_connections)
        std::make_shared<Connection>(hub_, std::move(socket))->read();
      accept();
    });
  }

  // In the server's thread, to the end.
  template <class Work>
  void run(Work work) {
    std::packaged_task<void()> task(std::move(work));
    auto done = task.get_future();
    asio::post(context_, [&task] { task(); });
    done.get();
  }

  // From the feed's threads. What a stalled server cannot take is lost, not piled up.
  void arrive(std::uint64_t feed, std::size_t channel, Message message) {
    const std::size_t size = message.payload->size();
    if (arriving_.fetch_add(size) + size > max_arriving_ && !message.keep) {
      arriving_ -= size;
      return;
    }
    asio::post(context_, [this, feed, channel, size, message = std::move(message)] {
      arriving_ -= size;
      if (feed == feed_number_) hub_.deliver(channel, message);
    });
  }

  Hub hub_;  // outlives the connections, of which the context holds the last
  asio::io_context context_{1};
  tcp::acceptor acceptor_;
  std::uint16_t port_ = 0;
  const std::size_t max_arriving_;
  std::atomic<std::size_t> arriving_ = 0;
  std::uint64_t feed_number_ = 0;
  std::thread thread_;
};

Server::Server(const ServerOptions& options) : impl_(std::make_unique<Impl>(options)) {}

Server::~Server() = default;

std::uint16_t Server::port() const {
  return impl_->port();
}

bool Server::has_page() const {
  return impl_->has_page();
}

void Server::show(std::unique_ptr<Feed> feed) {
  impl_->show(std::move(feed));
}

}  // namespace cosegraph::monitor
