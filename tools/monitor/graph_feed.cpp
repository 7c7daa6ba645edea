#include "tools/monitor/graph_feed.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "graph/dds.hpp"
#include "graph/figures.hpp"
#include "graph/remote.hpp"
#include "graph/runs.hpp"
#include "tools/monitor/channels.hpp"
#include "tools/monitor/state.hpp"

namespace cosegraph::monitor {
namespace {

using namespace std::chrono_literals;

constexpr auto kStatePeriod = 250ms;
constexpr auto kReloadPeriod = 2s;      // of the graph as its keepers publish it
constexpr std::size_t kMaxToDraw = 16;  // messages that wait to be made point clouds

std::uint64_t wall_nanoseconds() {
  return static_cast<std::uint64_t>(graph::wall_nanoseconds());
}

constexpr const char* kSwapRequest = R"({
  "type": "object",
  "required": ["stage"],
  "additionalProperties": false,
  "properties": {
    "stage": {"type": "string"},
    "use": {"type": "string", "description": "another kind with the same ports"},
    "host": {"type": "string"},
    "params": {"type": "object", "additionalProperties": {"type": "string"}},
    "dry_run": {"type": "boolean", "description": "only try whether the newcomer gets ready"}
  }
})";
constexpr const char* kSwapResponse = R"({
  "type": "object",
  "properties": {
    "stage": {"type": "string"},
    "from_generation": {"type": "number"}, "to_generation": {"type": "number"},
    "dry_run": {"type": "boolean"}, "took_ms": {"type": "number"},
    "admitted": {"type": "number"}, "done": {"type": "number"}, "failed": {"type": "number"},
    "lost": {"type": "number"}, "doubled": {"type": "number"},
    "pause_ms": {"type": "number"}, "usual_ms": {"type": "number"}
  }
})";

struct SwapWish {
  std::string stage;
  graph::Replacement replacement;
};

// A program of somebody's own is nothing that a page may start: there is no "exec". Throws
// InputError.
SwapWish parse_swap(const std::string& request) {
  using nlohmann::json;
  const json wish = json::parse(request, nullptr, false);
  if (!wish.is_object()) throw InputError("the request is not a JSON object");
  SwapWish result;
  try {
    for (const auto& [key, value] : wish.items()) {
      if (key == "stage")
        result.stage = value.get<std::string>();
      else if (key == "use")
        result.replacement.use = value.get<std::string>();
      else if (key == "host")
        result.replacement.host = value.get<std::string>();
      else if (key == "dry_run")
        result.replacement.dry_run = value.get<bool>();
      else if (key == "params")
        for (const auto& [name, text] : value.items())
          result.replacement.params.push_back(name + "=" + text.get<std::string>());
      else
        throw InputError("the request has the unknown key '" + key.substr(0, 40) + "'");
    }
  } catch (const json::exception&) {
    throw InputError("the request does not fit its schema");
  }
  if (result.stage.empty()) throw InputError("the request names no stage");
  return result;
}

}  // namespace

class GraphFeed::Impl {
 public:
  Impl(const graph::GraphDescription& graph, const graph::Catalog& catalog, bool orders)
      : graph_(graph),
        catalog_(catalog),
        topics_(recording::topics_of(graph, catalog)),
        views_(cloud_views_of(graph, topics_)),
        channels_(channels_of(graph, topics_, views_)),
        services_(orders ? std::vector<Service>{{.name = graph.graph + "/swap",
                                                 .request_schema = kSwapRequest,
                                                 .response_schema = kSwapResponse}}
                         : std::vector<Service>{}),
        state_(graph, topics_, graph::infos_of(graph, catalog)),
        subscribed_(channels_.size()),
        newest_(topics_.size()),
        joined_(views_, 2 * static_cast<std::size_t>(graph.window) + 2),
        readers_(topics_.size()),
        remote_(graph, "monitor") {}

  ~Impl() {
    // Before the members that their callbacks use.
    for (auto& reader : readers_) reader.handle.reset();
    {
      const std::scoped_lock lock(mutex_);
      stop_ = true;
    }
    changed_.notify_all();
    remote_.give_up();
    if (worker_.joinable()) worker_.join();
    if (orderer_.joinable()) orderer_.join();
  }

  const graph::GraphDescription& graph() const { return graph_; }
  const std::vector<Channel>& channels() const { return channels_; }
  const std::vector<Service>& services() const { return services_; }

  void open(Deliver deliver) {
    deliver_ = std::move(deliver);
    worker_ = std::thread([this] { work(); });
  }

  std::vector<Message> subscribe(std::size_t channel) {
    std::vector<Message> result;
    {
      const std::scoped_lock lock(mutex_);
      if (channel < topics_.size())
        result.assign(newest_[channel].begin(), newest_[channel].end());
      else if (channel == state_channel())
        result.push_back(state_message());  // of what is known by now
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

  // One order at a time, as agents take one at a time.
  void swap(const std::string& request, Reply reply) {
    SwapWish wish;
    try {
      wish = parse_swap(request);
      if (graph_.stage(wish.stage) == nullptr)
        throw InputError("there is no stage '" + wish.stage + "'");
    } catch (const Error& error) {
      return reply({.text = error.what()});
    }
    {
      const std::scoped_lock lock(mutex_);
      if (ordering_) return reply({.text = "busy: another swap goes on"});
      ordering_ = true;
      state_.set_note(wish.stage + " is being swapped");
    }
    if (orderer_.joinable()) orderer_.join();
    orderer_ = std::thread([this, wish = std::move(wish), reply = std::move(reply)] {
      const Answer answer = carry_out(wish);
      {
        const std::scoped_lock lock(mutex_);
        ordering_ = false;
        state_.set_note("");
      }
      reply(answer);
    });
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

  Answer carry_out(const SwapWish& wish) {
    try {
      return {.done = true,
              .text = graph::order_swap(
                  remote_, graph_, graph::source_of(graph_, catalog_).name, wish.stage,
                  wish.replacement, [this, &wish](const std::string& progress) {
                    const std::scoped_lock lock(mutex_);
                    state_.set_note(wish.stage + " is being swapped: " + progress);
                  })};
    } catch (const std::exception& error) {
      return {.text = error.what()};
    }
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
    reader.handle = remote_.observer().participant().reader(
        topics_[topic].name, topics_[topic].type, onlooker_qos(topics_[topic], graph_),
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
      if (raw) remember(topic, message);
      if (is_drawn(topic)) {
        to_draw_.push_back({topic, message.payload});
        if (to_draw_.size() > kMaxToDraw) to_draw_.pop_front();
        changed_.notify_all();
      }
    }
    if (raw) deliver_(topic, message);
  }

  // With the lock.
  void look_around() {
    graph::Observer& observer = remote_.observer();
    state_.hear(observer.stages(), observer.failures(state_.failure_count()));
    state_.set_agents(!observer.agents().empty());
  }

  // Stages may have been swapped, by whomever.
  void reload() {
    try {
      graph::GraphDescription graph =
          graph::find_run({.graph = graph_.graph, .instance = graph_.instance});
      auto infos = graph::infos_of(graph, catalog_);
      const std::scoped_lock lock(mutex_);
      state_.change(std::move(graph), std::move(infos));
    } catch (const Error&) {
      return;  // it has ended, or is run on other hosts
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
    return {.time = now,
            .payload = to_payload(state_.to_json(std::chrono::steady_clock::now(), now))};
  }

  void work() {
    auto told = std::chrono::steady_clock::now();
    auto reloaded = told;
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
      look_around();
      if (told - reloaded > kReloadPeriod) {
        reloaded = told;
        lock.unlock();
        reload();
        lock.lock();
      }
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
  const graph::Catalog catalog_;
  const std::vector<Topic> topics_;
  const std::vector<CloudView> views_;
  const std::vector<Channel> channels_;
  const std::vector<Service> services_;
  Deliver deliver_;

  std::mutex mutex_;  // guards what follows, up to joined_
  std::condition_variable changed_;
  bool stop_ = false;
  GraphState state_;
  bool ordering_ = false;
  std::deque<ToDraw> to_draw_;
  std::vector<bool> subscribed_;             // per channel
  std::vector<std::deque<Message>> newest_;  // per topic, while it is subscribed

  CloudViews joined_;                   // the worker's own
  std::vector<CountedReader> readers_;  // the caller's own
  graph::Remote remote_;
  std::thread worker_;
  std::thread orderer_;
};

GraphFeed::GraphFeed(const graph::GraphDescription& graph, const graph::Catalog& catalog,
                     bool orders)
    : impl_(std::make_unique<Impl>(graph, catalog, orders)) {}

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

std::vector<Message> GraphFeed::subscribe(std::size_t channel, std::optional<std::size_t>) {
  return impl_->subscribe(channel);
}

void GraphFeed::unsubscribe(std::size_t channel) {
  impl_->unsubscribe(channel);
}

const std::vector<Service>& GraphFeed::services() const {
  return impl_->services();
}

void GraphFeed::call(std::size_t, const std::string& request, Reply reply) {
  impl_->swap(request, std::move(reply));
}

void GraphFeed::end() {
  impl_->end();
}

}  // namespace cosegraph::monitor
