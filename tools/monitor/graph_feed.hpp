// A running graph as a feed: its topics as they are, the same as point clouds for other viewers,
// its state, and the swap of a stage as a service. What nobody watches is not even received.
#pragma once

#include <memory>

#include "graph/description.hpp"
#include "tools/monitor/channel.hpp"

namespace cosegraph::monitor {

class GraphFeed final : public Feed {
 public:
  // `graph` as find_run() gives it; without `orders` it only looks on. Throws Error if DDS cannot
  // be started.
  GraphFeed(const graph::GraphDescription& graph, const graph::Catalog& catalog,
            bool orders = true);
  ~GraphFeed() override;

  std::string name() const override;
  const std::vector<Channel>& channels() const override;
  void open(Deliver deliver) override;
  std::vector<Message> subscribe(std::size_t channel, std::optional<std::size_t> part) override;
  void unsubscribe(std::size_t channel) override;
  const std::vector<Service>& services() const override;
  void call(std::size_t service, const std::string& request, Reply reply) override;

  // The run is over. May be called from any thread, again and again.
  void end();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cosegraph::monitor
