// The monitor's server: HTTP for the page and the Foxglove WebSocket protocol for whoever wants to
// look, on one port. One thread of its own.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "tools/monitor/access.hpp"
#include "tools/monitor/channel.hpp"

namespace cosegraph::monitor {

struct ServerOptions {
  std::string host = "127.0.0.1";  // address or name to listen at
  std::uint16_t port = 0;          // 0: any that is free
  Access access;
  std::filesystem::path page;  // folder of the page's files

  std::size_t max_clients = 16;            // that read channels
  std::size_t max_connections = 64;        // of any kind
  std::size_t max_request = 64U << 10U;    // bytes of what a client says
  std::size_t max_queued = 64U << 20U;     // bytes that wait for one client
  std::size_t max_arriving = 256U << 20U;  // bytes that the feed has given and nobody queued yet
};

class Server {
 public:
  // Listens and serves from now on. Throws InputError if the address cannot be used.
  explicit Server(const ServerOptions& options);
  // Closes all connections.
  ~Server();

  std::uint16_t port() const;
  bool has_page() const;

  // What clients see from now on, instead of the feed before.
  void show(std::unique_ptr<Feed> feed);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cosegraph::monitor
