#include "tools/monitor/graph_feed.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include "graph/dds.hpp"
#include "idl/schema.hpp"
#include "tools/monitor/cloud_views.hpp"
#include "tools/monitor/point_cloud.hpp"
#include "tools/monitor/state.hpp"

namespace cosegraph::monitor {
namespace {

using namespace std::chrono_literals;

constexpr auto kStatePeriod = 250ms;
constexpr std::size_t kMaxToDraw = 16;  // messages that wait to be made point clouds

std::uint64_t wall_nanoseconds() {
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(
                                        std::chrono::system_clock::now().time_since_epoch())
                                        .count());
}

Payload to_payload(std::string_view text) {
  return std::make_shared<const idl::Bytes>(text.begin(), text.end());
}

std::vector<std::string> publishers_of(const graph::GraphDescription& graph, const Topic& topic) {
  if (!topic.stage.empty()) return {topic.stage};
  std::vector<std::string> all;
  for (const auto& node : graph.stages) all.push_back(node.name);
  return all;
}

// The topics, the views of them, the state: in this order.
std::vector<Channel> channels_of(const graph::GraphDescription& graph,
                                 const std::vector<Topic>& topics,
                                 const std::vector<CloudView>& views) {
  std::vector<Channel> channels;
  for (const auto& topic : topics)
    channels.push_back({.topic = topic.name,
                        .encoding = std::string(idl::kMessageEncoding),
                        .schema_name = idl::wire_type(topic.type),
                        .schema = std::string(idl::idl_text(topic.type)),
                        .schema_encoding = std::string(idl::kSchemaEncoding),
                        .publishers = publishers_of(graph, topic),
                        .subscribers = readers_of(graph, topic)});
  for (const auto& view : views)
    channels.push_back({.topic = view.topic + "/points",
                        .encoding = std::string(idl::kMessageEncoding),
                        .schema_name = std::string(kPointCloudSchemaName),
                        .schema = std::string(kPointCloudSchema),
                        .schema_encoding = std::string(idl::kSchemaEncoding),
                        .publishers = {"monitor"}});
  channels.push_back({.topic = graph.graph + "/monitor",
                      .encoding = "json",
                      .schema_name = "cosegraph.Monitor",
                      .schema = R"({"type":"object"})",
                      .schema_encoding = "jsonschema",
                      .publishers = {"monitor"}});
  return channels;
}

}  // namespace

class GraphFeed::Impl {
 public:
  Impl(const graph::GraphDescription& graph, const graph::Catalog& catalog)
      : graph_(graph),
        topics_(topics_of(graph, catalog)),
        views_(cloud_views_of(graph, topics_)),
        channels_(channels_of(graph, topics_, views_)),
        state_(graph, topics_),
        subscribed_(channels_.size()),
        newest_(topics_.size()),
        joined_(views_, 2 * static_cast<std::size_t>(graph.window) + 2),
        readers_(topics_.size()),
        participant_(graph, graph.graph + "/monitor") {}

  ~Impl() {
    // Before the members that their callbacks use.
    for (auto& reader : readers_) reader.handle.reset();
    {
      const std::scoped_lock lock(mutex_);
      stop_ = true;
    }
    changed_.notify_all();
    if (worker_.joinable()) worker_.join();
  }

  const graph::GraphDescription& graph() const { return graph_; }
  const std::vector<Channel>& channels() const { return channels_; }

  void open(Deliver deliver) {
    deliver_ = std::move(deliver);
    for (std::size_t t = 0; t < topics_.size(); ++t)
      if (is_of_state(topics_[t])) use(t);
    worker_ = std::thread([this] { work(); });
  }

  std::vector<Message> subscribe(std::size_t channel) {
    std::vector<Message> result;
    {
      const std::scoped_lock lock(mutex_);
      if (channel < topics_.size())
        result.assign(newest_[channel].begin(), newest_[channel].end());
      else if (channel == state_channel())
        result.push_back(state_message());
      if (subscribed_[channel]) return result;
      subscribed_[channel] = true;
    }
    for (const std::size_t topic : needs_of(channel)) use(topic);
    return result;
  }

  void unsubscribe(std::size_t channel) {
    {
      const std::scoped_lock lock(mutex_);
      if (!subscribed_[channel]) return;
      subscribed_[channel] = false;
      if (channel < topics_.size()) newest_[channel].clear();
    }
    for (const std::size_t topic : needs_of(channel)) release(topic);
  }

  void end() {
    const std::scoped_lock lock(mutex_);
    state_.end();
  }

 private:
  struct CountedReader {
    std::unique_ptr<graph::Reader> handle;
    int users = 0;
  };
  struct ToDraw {
    std::size_t topic;
    Payload sample;
  };

  static bool is_of_state(const Topic& topic) {
    return topic.type == "StageStatus" || topic.type == "FrameFailure";
  }
  std::size_t state_channel() const { return channels_.size() - 1; }
  bool is_view(std::size_t channel) const {
    return channel >= topics_.size() && channel < state_channel();
  }

  // The topics that a channel is made of.
  std::vector<std::size_t> needs_of(std::size_t channel) const {
    if (channel < topics_.size()) return {channel};
    std::vector<std::size_t> result;
    if (!is_view(channel)) return result;
    const CloudView& view = views_[channel - topics_.size()];
    for (std::size_t t = 0; t < topics_.size(); ++t)
      if (topics_[t].name == view.topic ||
          std::ranges::find(view.clouds, topics_[t].name) != view.clouds.end())
        result.push_back(t);
    return result;
  }

  void use(std::size_t topic) {
    CountedReader& reader = readers_[topic];
    if (reader.users++ > 0) return;
    reader.handle = participant_.reader(
        topics_[topic].name, topics_[topic].type, qos_of(topics_[topic], graph_),
        [this, topic](graph::Sample sample) { receive(topic, std::move(sample)); });
  }

  void release(std::size_t topic) {
    CountedReader& reader = readers_[topic];
    if (--reader.users == 0) reader.handle.reset();
  }

  void receive(std::size_t topic, Payload sample) {
    const Message message{
        .time = wall_nanoseconds(), .payload = std::move(sample), .keep = topics_[topic].latched};
    bool raw = false;
    {
      const std::scoped_lock lock(mutex_);
      raw = subscribed_[topic];
      if (is_of_state(topics_[topic])) take_state(topic, message);
      if (raw) remember(topic, message);
      if (is_drawn(topic)) {
        to_draw_.push_back({topic, message.payload});
        if (to_draw_.size() > kMaxToDraw) to_draw_.pop_front();
        changed_.notify_all();
      }
    }
    if (raw) deliver_(topic, message);
  }

  void take_state(std::size_t topic, const Message& message) {
    try {
      const idl::FrameHeader header = idl::decode_header(*message.payload);
      if (topics_[topic].type == "StageStatus")
        state_.add_status(header, idl::decode<idl::StageStatus>(*message.payload), message.time);
      else
        state_.add_failure(header, idl::decode<idl::FrameFailure>(*message.payload), message.time);
    } catch (const Error&) {
      return;  // a stranger's message
    }
  }

  // For the next who subscribes: the newest message, of a latched topic the newest two.
  void remember(std::size_t topic, const Message& message) {
    auto& newest = newest_[topic];
    newest.push_back(message);
    if (newest.size() > (topics_[topic].latched ? 2U : 1U)) newest.pop_front();
  }

  bool is_drawn(std::size_t topic) const {
    for (std::size_t v = 0; v < views_.size(); ++v)
      if (subscribed_[topics_.size() + v] &&
          (views_[v].topic == topics_[topic].name ||
           std::ranges::find(views_[v].clouds, topics_[topic].name) != views_[v].clouds.end()))
        return true;
    return false;
  }

  Message state_message() const {
    const std::uint64_t now = wall_nanoseconds();
    return {.time = now, .payload = to_payload(state_.to_json(now))};
  }

  void work() {
    auto told = std::chrono::steady_clock::now();
    std::unique_lock lock(mutex_);
    while (!stop_) {
      changed_.wait_until(lock, told + kStatePeriod, [this] { return stop_ || !to_draw_.empty(); });
      while (!stop_ && !to_draw_.empty()) {
        const ToDraw next = std::move(to_draw_.front());
        to_draw_.pop_front();
        const std::vector<bool> wanted(subscribed_.begin() + static_cast<long>(topics_.size()),
                                       subscribed_.end() - 1);
        lock.unlock();
        draw(next, wanted);
        lock.lock();
      }
      if (std::chrono::steady_clock::now() - told < kStatePeriod) continue;
      told = std::chrono::steady_clock::now();
      if (!subscribed_[state_channel()]) continue;
      const Message message = state_message();
      lock.unlock();
      deliver_(state_channel(), message);
      lock.lock();
    }
  }

  void draw(const ToDraw& next, const std::vector<bool>& wanted) {
    try {
      for (auto& [view, bytes] : joined_.add(topics_[next.topic].name, *next.sample, wanted))
        deliver_(topics_.size() + view,
                 {.time = wall_nanoseconds(),
                  .payload = std::make_shared<const idl::Bytes>(std::move(bytes))});
    } catch (const Error&) {
      return;  // a stranger's message
    }
  }

  const graph::GraphDescription graph_;
  const std::vector<Topic> topics_;
  const std::vector<CloudView> views_;
  const std::vector<Channel> channels_;
  Deliver deliver_;

  std::mutex mutex_;  // guards what follows, up to joined_
  std::condition_variable changed_;
  bool stop_ = false;
  GraphState state_;
  std::deque<ToDraw> to_draw_;
  std::vector<bool> subscribed_;             // per channel
  std::vector<std::deque<Message>> newest_;  // per topic, while it is subscribed

  CloudViews joined_;                   // the worker's own
  std::vector<CountedReader> readers_;  // the caller's own
  graph::Participant participant_;
  std::thread worker_;
};

GraphFeed::GraphFeed(const graph::GraphDescription& graph, const graph::Catalog& catalog)
    : impl_(std::make_unique<Impl>(graph, catalog)) {}

GraphFeed::~GraphFeed() = default;

std::string GraphFeed::name() const {
  return impl_->graph().graph;
}

const std::vector<Channel>& GraphFeed::channels() const {
  return impl_->channels();
}

void GraphFeed::open(Deliver deliver) {
  impl_->open(std::move(deliver));
}

std::vector<Message> GraphFeed::subscribe(std::size_t channel) {
  return impl_->subscribe(channel);
}

void GraphFeed::unsubscribe(std::size_t channel) {
  impl_->unsubscribe(channel);
}

void GraphFeed::end() {
  impl_->end();
}

}  // namespace cosegraph::monitor
