// Looking at the topics of a running graph.
#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <deque>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>

#include "graph/figures.hpp"
#include "graph/process.hpp"
#include "idl/inspect.hpp"
#include "idl/present.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/durations.hpp"
#include "tools/cosegraph/watching.hpp"

namespace cosegraph::tools {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

// Everybody whom the graph file promises, or who is there when patience ends.
graph::Domain domain_of(graph::DomainWatch& watch, const graph::GraphDescription& graph,
                        std::chrono::milliseconds patience) {
  constexpr auto kQuiet = std::chrono::milliseconds(400);
  const auto until = std::chrono::steady_clock::now() + patience;
  graph::Domain domain = watch.wait(
      patience, [&](const graph::Domain& now) { return graph::is_complete(now, graph); });
  // Others are found in any order, and somebody's endpoints after it.
  for (bool news = true; news && std::chrono::steady_clock::now() < until;) {
    const auto is_new = [&](const graph::Domain& now) {
      return now.peers.size() + now.endpoints.size() !=
             domain.peers.size() + domain.endpoints.size();
    };
    graph::Domain later = watch.wait(kQuiet, is_new);
    news = is_new(later);
    domain = std::move(later);
  }
  return domain;
}

bool is_in_run(const graph::Endpoint& endpoint, const graph::GraphDescription& graph) {
  return endpoint.partitions == std::vector<std::string>{graph::partition_of(graph)};
}

std::string short_type(const std::string& wire) {
  for (const auto name : idl::type_names())
    if (idl::wire_type(name) == wire) return std::string(name);
  return wire;
}

// -- list ----------------------------------------------------------------------------------------

struct Listed {
  std::string topic;
  std::string type;
  std::size_t writers = 0;
  std::size_t readers = 0;
  std::optional<graph::TopicTraffic> traffic;
};

std::vector<Listed> listed(const graph::GraphDescription& graph, const graph::Domain& domain,
                           const std::map<std::string, graph::TopicTraffic>& traffic,
                           bool with_control, bool with_strangers) {
  std::vector<Listed> rows;
  for (const auto& topic : topics_of(graph))
    if (with_control || !topic.is_control) rows.push_back({topic.name, topic.type, 0, 0, {}});
  for (const auto& endpoint : domain.endpoints) {
    if (!is_in_run(endpoint, graph) && !with_strangers) continue;
    auto row = std::ranges::find(rows, endpoint.topic, &Listed::topic);
    if (row == rows.end()) {
      const bool is_ours = find_topic(graph, endpoint.topic).has_value();
      if (is_ours && !with_control) continue;
      row = rows.insert(rows.end(), {endpoint.topic, short_type(endpoint.type), 0, 0, {}});
    }
    ++(endpoint.is_writer ? row->writers : row->readers);
  }
  for (auto& row : rows)
    if (const auto found = traffic.find(row.topic); found != traffic.end())
      row.traffic = found->second;
  return rows;
}

int list_topics(const Watched& watched, bool control, bool strangers) {
  const graph::GraphDescription graph = watched.find();
  graph::DomainWatch watch(graph);
  graph::Observer observer(graph);
  const graph::Domain domain = domain_of(watch, graph, watched.patience());
  const Looks looks = look_twice(observer, graph, watched.patience());
  const auto rows =
      listed(graph, domain, graph::traffic_of(looks.before, looks.now), control, strangers);
  if (watched.json) {
    Json json = Json::array();
    for (const auto& row : rows) {
      json.push_back({{"topic", row.topic},
                      {"type", row.type},
                      {"writers", row.writers},
                      {"readers", row.readers}});
      if (row.traffic) {
        json.back()["messages"] = row.traffic->messages;
        json.back()["bytes"] = row.traffic->bytes;
        if (row.traffic->span > 0.0) json.back()["hz"] = row.traffic->rate;
      }
    }
    std::cout << json.dump(2) << '\n';
    return 0;
  }
  std::printf("%-36s %-16s %7s %7s %9s %8s %9s\n", "TOPIC", "TYPE", "WRITERS", "READERS",
              "MESSAGES", "HZ", "MEAN SIZE");
  for (const auto& row : rows) {
    std::printf("%-36s %-16s %7zu %7zu", row.topic.c_str(), row.type.c_str(), row.writers,
                row.readers);
    if (row.traffic) {
      const auto count = static_cast<double>(row.traffic->messages);
      std::printf(" %9.0f", count);
      char rate[32];
      std::snprintf(rate, sizeof rate, "%.2f", row.traffic->rate);
      std::printf(" %8s", row.traffic->span > 0.0 ? rate : "");
      if (count > 0.0)
        std::printf(" %9s", bytes_text(static_cast<double>(row.traffic->bytes) / count).c_str());
    }
    std::printf("\n");
  }
  return 0;
}

// -- info ----------------------------------------------------------------------------------------

std::string joined(const std::vector<std::string>& words, const char* between) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

// Who an endpoint belongs to: "source" of this graph, or the name of a stranger.
std::string owner_name(const graph::Endpoint& endpoint, const graph::Domain& domain,
                       const graph::GraphDescription& graph) {
  const auto peer = domain.peers.find(endpoint.participant);
  if (peer == domain.peers.end()) return endpoint.participant;
  const std::string prefix = graph.graph + "/";
  const bool ours = peer->second.name.starts_with(prefix) && is_in_run(endpoint, graph);
  return ours ? peer->second.name.substr(prefix.size()) : peer->second.name;
}

std::string where(const graph::Endpoint& endpoint, const graph::Domain& domain) {
  const auto found = domain.peers.find(endpoint.participant);
  if (found == domain.peers.end()) return "unknown place";
  const graph::Peer& peer = found->second;
  std::string text = peer.on_this_machine ? "this machine" : joined(peer.addresses, ", ");
  if (!peer.host.empty()) text += " (" + peer.host + ")";
  if (!peer.process.empty()) text += ", process " + peer.process;
  return text;
}

Json endpoint_json(const graph::Endpoint& endpoint, const graph::Domain& domain,
                   const graph::GraphDescription& graph) {
  Json json{{"name", owner_name(endpoint, domain, graph)},
            {"guid", endpoint.guid},
            {"type", endpoint.type},
            {"keyed", endpoint.keyed},
            {"partitions", endpoint.partitions},
            {"qos",
             {{"reliability", endpoint.qos.reliable ? "reliable" : "best_effort"},
              {"durability", to_name(endpoint.qos.durability)},
              {"deadline_s", nullptr},
              {"liveliness", to_name(endpoint.qos.liveliness)},
              {"lease_s", nullptr},
              {"ownership", endpoint.qos.exclusive ? "exclusive" : "shared"}}}};
  if (endpoint.qos.deadline != graph::kForever) json["qos"]["deadline_s"] = endpoint.qos.deadline;
  if (endpoint.qos.lease != graph::kForever) json["qos"]["lease_s"] = endpoint.qos.lease;
  if (const auto peer = domain.peers.find(endpoint.participant); peer != domain.peers.end()) {
    json["host"] = peer->second.host;
    json["process"] = peer->second.process;
    json["addresses"] = peer->second.addresses;
    json["this_machine"] = peer->second.on_this_machine;
  }
  return json;
}

struct Mismatch {
  std::string writer;
  std::string reader;
  std::vector<std::string> reasons;
};

std::vector<Mismatch> mismatches_on(const std::string& topic, const graph::Domain& domain,
                                    const graph::GraphDescription& graph) {
  std::vector<Mismatch> result;
  for (const auto* writer : domain.writers(topic))
    for (const auto* reader : domain.readers(topic))
      if (auto reasons = graph::mismatches(*writer, *reader); !reasons.empty())
        result.push_back({owner_name(*writer, domain, graph), owner_name(*reader, domain, graph),
                          std::move(reasons)});
  return result;
}

void print_endpoints(const char* role, const std::vector<const graph::Endpoint*>& endpoints,
                     const graph::Domain& domain, const graph::GraphDescription& graph) {
  std::printf("%ss: %zu\n", role, endpoints.size());
  for (const auto* endpoint : endpoints) {
    std::printf("  %s on %s\n    %s\n", owner_name(*endpoint, domain, graph).c_str(),
                where(*endpoint, domain).c_str(), graph::to_text(endpoint->qos).c_str());
    if (!is_in_run(*endpoint, graph))
      std::printf("    partition: %s\n", endpoint->partitions.empty()
                                             ? "none"
                                             : joined(endpoint->partitions, ", ").c_str());
  }
}

int topic_info(const Watched& watched) {
  const graph::GraphDescription graph = watched.find();
  graph::DomainWatch watch(graph);
  const graph::Domain domain = domain_of(watch, graph, watched.patience());
  const Topic topic = require_topic(graph, watched.name(), domain);
  const auto writers = domain.writers(topic.name);
  const auto readers = domain.readers(topic.name);
  std::string type = topic.type.empty() ? "" : idl::wire_type(topic.type);
  if (type.empty() && !writers.empty()) type = writers[0]->type;
  if (type.empty() && !readers.empty()) type = readers[0]->type;
  const auto faults = mismatches_on(topic.name, domain, graph);
  if (watched.json) {
    Json json{{"topic", topic.name},        {"type", type},
              {"latched", topic.latched},   {"partition", graph::partition_of(graph)},
              {"writers", Json::array()},   {"readers", Json::array()},
              {"mismatches", Json::array()}};
    for (const auto* one : writers) json["writers"].push_back(endpoint_json(*one, domain, graph));
    for (const auto* one : readers) json["readers"].push_back(endpoint_json(*one, domain, graph));
    for (const auto& fault : faults)
      json["mismatches"].push_back(
          {{"writer", fault.writer}, {"reader", fault.reader}, {"reasons", fault.reasons}});
    std::cout << json.dump(2) << '\n';
    return 0;
  }
  std::printf("%s\ntype: %s%s\npartition: %s\n", topic.name.c_str(), type.c_str(),
              topic.latched ? ", latched" : "", graph::partition_of(graph).c_str());
  print_endpoints("writer", writers, domain, graph);
  print_endpoints("reader", readers, domain, graph);
  for (const auto& fault : faults) {
    std::printf("no match: %s -> %s\n", fault.writer.c_str(), fault.reader.c_str());
    for (const auto& reason : fault.reasons) std::printf("  %s\n", reason.c_str());
  }
  return 0;
}

// -- messages ------------------------------------------------------------------------------------

struct Arrival {
  graph::Sample sample;
  std::int64_t time = 0;  // wall clock, ns
};

// Messages of one topic as they arrive; if they come faster than they are taken, the newest.
class Listening {
 public:
  // Waits for a writer, so that its type and what it offers are known. Throws Error if none is
  // there in time; a topic that the graph has is also listened to without one.
  Listening(const graph::GraphDescription& graph, const std::string& name,
            std::chrono::milliseconds patience)
      : watch_(graph) {
    auto topic = find_topic(graph, name);
    const graph::Domain domain = watch_.wait(patience, [&](const graph::Domain& now) {
      return !now.writers(topic ? topic->name : name).empty();
    });
    if (!topic) topic = require_topic(graph, name, domain);
    topic_ = *topic;
    const auto writers = domain.writers(topic_.name);
    if (writers.empty() && topic_.type.empty()) throw Error(name + ": nobody writes it");
    type_ = topic_.type.empty() ? writers[0]->type : idl::wire_type(topic_.type);
    reader_ = watch_.participant().reader(topic_.name, type_, qos(writers),
                                          [this](const graph::Sample& sample) { keep(sample); });
  }

  const std::string& type() const { return type_; }
  const Topic& topic() const { return topic_; }
  // Of the participant that bears this name in the run; none if it is not found.
  std::optional<graph::Peer> peer(const std::string& name, std::chrono::milliseconds patience) {
    const auto is_it = [&](const auto& entry) { return entry.second.name == name; };
    const graph::Domain domain = watch_.wait(
        patience, [&](const graph::Domain& now) { return std::ranges::any_of(now.peers, is_it); });
    const auto found = std::ranges::find_if(domain.peers, is_it);
    if (found == domain.peers.end()) return std::nullopt;
    return found->second;
  }
  int writers() const { return reader_->matched(); }

  std::optional<Arrival> next(std::chrono::milliseconds patience) {
    std::unique_lock lock(mutex_);
    if (!news_.wait_for(lock, patience, [this] { return !arrived_.empty(); })) return std::nullopt;
    Arrival arrival = std::move(arrived_.front());
    arrived_.pop_front();
    return arrival;
  }

 private:
  // Frames are only overheard: a reliable reader could make their writer send again. What is
  // latched or rare is asked for with what was written before.
  graph::EndpointQos qos(const std::vector<const graph::Endpoint*>& writers) const {
    const bool lax =
        std::ranges::any_of(writers, [](const auto* writer) { return !writer->qos.reliable; });
    const bool volatile_writer = std::ranges::any_of(writers, [](const auto* writer) {
      return writer->qos.durability == graph::Durability::volatile_;
    });
    const bool kept = !topic_.type.empty() && (topic_.latched || topic_.is_control);
    return {.depth = 16, .keep_for_late = kept && !volatile_writer, .reliable = kept && !lax};
  }

  void keep(const graph::Sample& sample) {
    constexpr std::size_t kKept = 16;
    {
      const std::scoped_lock lock(mutex_);
      arrived_.push_back({sample, graph::wall_nanoseconds()});
      if (arrived_.size() > kKept) arrived_.pop_front();
    }
    news_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable news_;
  std::deque<Arrival> arrived_;
  Topic topic_;
  std::string type_;
  graph::DomainWatch watch_;
  std::unique_ptr<graph::Reader> reader_;
};

// Why nothing has come.
Error silence(const Listening& listening) {
  const std::string& name = listening.topic().name;
  if (listening.writers() > 0) return Error(name + ": its writers have written nothing meanwhile");
  return Error(name + ": no writer matches; see 'cosegraph topic info' and 'cosegraph why'");
}

// -- echo ----------------------------------------------------------------------------------------

struct EchoArguments {
  Watched watched;
  std::string field;
  bool full = false;
  std::uint64_t count = 0;  // 0: no end
};

std::string hex(const idl::Bytes& bytes, bool full) {
  constexpr std::size_t kShown = 64;
  const std::size_t end = full ? bytes.size() : std::min(bytes.size(), kShown);
  std::string text;
  for (std::size_t i = 0; i < end; ++i) {
    char digits[4];
    std::snprintf(digits, sizeof digits, "%02x%s", bytes[i], i % 16 == 15 ? "\n" : " ");
    text += digits;
  }
  if (!text.empty() && text.back() == ' ') text.back() = '\n';
  return text + (end < bytes.size() ? "...\n" : "");
}

void print_message(const Arrival& arrival, const std::string& type,
                   const EchoArguments& arguments) {
  const idl::Bytes& bytes = *arrival.sample;
  const bool json = arguments.watched.json;
  if (!type.starts_with(idl::wire_type(""))) {
    if (json)
      std::cout << Json{{"type", type}, {"size", bytes.size()}, {"hex", hex(bytes, arguments.full)}}
                       .dump()
                << std::endl;
    else
      std::cout << type << ", " << bytes.size() << " bytes\n"
                << hex(bytes, arguments.full) << "---" << std::endl;
    return;
  }
  const idl::Node message = idl::inspect_wire(type, bytes);
  const idl::Node chosen = idl::select(message, arguments.field);
  const idl::Presentation how{.whole = arguments.full};
  if (json)
    std::cout << idl::to_json(chosen, how).dump() << std::endl;
  else
    std::cout << idl::to_text(chosen, how) << (chosen.members.empty() ? "" : "---\n") << std::flush;
}

int echo_topic(const EchoArguments& arguments) {
  const Watched& watched = arguments.watched;
  graph::give_way();
  const graph::GraphDescription graph = watched.find();
  const StopSignals signals;
  Listening listening(graph, watched.name(), watched.timeout > 0.0 ? watched.patience() : 3s);
  const std::uint64_t wanted = watched.once ? 1 : arguments.count;
  auto heard = Clock::now();
  for (std::uint64_t shown = 0; !signals.asked() && (wanted == 0 || shown < wanted);) {
    if (const auto arrival = listening.next(50ms)) {
      heard = Clock::now();
      ++shown;
      try {
        print_message(*arrival, listening.type(), arguments);
      } catch (const InputError& error) {
        std::cerr << "cosegraph: " << error.what() << '\n';
      }
    } else if (watched.timeout > 0.0 && Clock::now() - heard > watched.patience()) {
      throw silence(listening);
    }
  }
  return 0;
}

// -- hz, bw --------------------------------------------------------------------------------------

enum class Measure { messages, bytes };

Json traffic_json(const std::string& topic, const graph::TopicTraffic& traffic) {
  return {{"topic", topic},
          {"hz", traffic.rate},
          {"bytes_per_second", traffic.byte_rate},
          {"seconds", traffic.span},
          {"messages", traffic.messages},
          {"bytes", traffic.bytes}};
}

void print_traffic(const std::string& topic, const graph::TopicTraffic& traffic, Measure measure,
                   bool json) {
  if (json) {
    std::cout << traffic_json(topic, traffic).dump() << std::endl;
    return;
  }
  const double mean = traffic.rate > 0.0 ? traffic.byte_rate / traffic.rate : 0.0;
  if (measure == Measure::messages)
    std::printf("%.2f Hz over %.2f s; %llu messages so far\n", traffic.rate, traffic.span,
                static_cast<unsigned long long>(traffic.messages));
  else
    std::printf("%s/s over %.2f s, %s per message; %s so far\n",
                bytes_text(traffic.byte_rate).c_str(), traffic.span, bytes_text(mean).c_str(),
                bytes_text(static_cast<double>(traffic.bytes)).c_str());
  std::fflush(stdout);
}

// Every second the rate over the newest `window` seconds.
int measure_traffic(const Watched& watched, double window, Measure measure) {
  graph::give_way();
  const graph::GraphDescription graph = watched.find();
  const Topic topic = require_topic(graph, watched.name(), {});
  if (topic.is_control)
    throw ParameterError("'" + watched.name() +
                         "': stages count what they write on their outputs only; see "
                         "'cosegraph topic list'");
  const StopSignals signals;
  graph::Observer observer(graph);
  std::deque<graph::Look> looks;
  auto heard = Clock::now();
  const std::size_t kept = static_cast<std::size_t>(std::ceil(window)) + 1;
  while (!signals.asked()) {
    if (looks.size() >= kept) looks.pop_front();
    looks.push_back(observer.stages());
    const auto traffic = graph::traffic_of(looks.front(), looks.back());
    const auto found = traffic.find(topic.name);
    const bool measured = found != traffic.end() && found->second.span > 0.0;
    if (measured) {
      heard = Clock::now();
      // Statuses come several times a second, so that the window is full a little early.
      const bool full = found->second.span >= window - 0.6;
      if (full || !watched.once) print_traffic(topic.name, found->second, measure, watched.json);
      if (full && watched.once) return 0;
    } else if (Clock::now() - heard > watched.patience()) {
      throw Error(topic.name + ": no news from the stage that writes it; see 'cosegraph ps'");
    }
    // Until a first look there is nothing to measure from.
    const bool empty = found == traffic.end();
    if (empty) looks.clear();
    if (!pause(signals, empty ? 50ms : 1000ms)) break;
  }
  return 0;
}

// -- delay ---------------------------------------------------------------------------------------

// The host of the graph file whose clock stamps the frames: the source's.
ClockOffset clock_of_source(const graph::GraphDescription& graph, Listening& listening) {
  const graph::StageNode& source = graph::source_of(graph, graph::catalog_of(stage_table()));
  const auto peer = listening.peer(graph.graph + "/" + source.name, 2s);
  if (peer && peer->on_this_machine)
    return {.host = source.host, .known = true, .how = "it runs on this machine"};
  graph::Remote remote(graph);
  remote.agents(2s);
  return ask_clock(remote, source.host);
}

std::string offset_text(const ClockOffset& offset) {
  const std::string host = offset.host.empty() ? "the source" : "host " + offset.host;
  if (!offset.known) return "clock of " + host + ": offset unknown (" + offset.how + ")";
  char text[96];
  std::snprintf(text, sizeof text, ": %+.3f ms +- %.3f ms (", 1e3 * offset.seconds,
                1e3 * offset.uncertainty);
  return "clock of " + host + text + offset.how + ")";
}

struct Delays {
  std::vector<double> milliseconds;

  double quantile(double q) {
    std::ranges::sort(milliseconds);
    return milliseconds[static_cast<std::size_t>(q * static_cast<double>(milliseconds.size() - 1) +
                                                 0.5)];
  }
};

void print_delays(Delays& delays, const ClockOffset& offset, const std::string& topic, bool json) {
  if (json) {
    Json line{{"topic", topic},
              {"messages", delays.milliseconds.size()},
              {"ms_min", delays.quantile(0.0)},
              {"ms_median", delays.quantile(0.5)},
              {"ms_p99", delays.quantile(0.99)},
              {"ms_max", delays.quantile(1.0)},
              {"clock_offset_ms", nullptr},
              {"clock_offset_uncertainty_ms", nullptr}};
    if (offset.known) {
      line["clock_offset_ms"] = 1e3 * offset.seconds;
      line["clock_offset_uncertainty_ms"] = 1e3 * offset.uncertainty;
    }
    std::cout << line.dump() << std::endl;
    return;
  }
  std::printf("%zu messages: min %.1f, median %.1f, p99 %.1f, max %.1f ms since admission%s\n",
              delays.milliseconds.size(), delays.quantile(0.0), delays.quantile(0.5),
              delays.quantile(0.99), delays.quantile(1.0),
              offset.known ? "" : ", clocks not compared");
  std::fflush(stdout);
}

// How old frames are when they are on this topic: now minus their admission, which the source
// stamps by its clock.
int measure_delay(const Watched& watched) {
  const graph::GraphDescription graph = watched.find();
  const StopSignals signals;
  Listening listening(graph, watched.name(), watched.timeout > 0.0 ? watched.patience() : 3s);
  if (listening.topic().is_control || listening.topic().latched || listening.topic().type.empty())
    throw ParameterError("'" + watched.name() + "' carries no frames");
  const ClockOffset offset = clock_of_source(graph, listening);
  if (!watched.json) std::cout << offset_text(offset) << std::endl;
  Delays delays;
  auto told = Clock::now();
  auto heard = told;
  while (!signals.asked()) {
    if (const auto arrival = listening.next(50ms)) {
      heard = Clock::now();
      try {
        const idl::FrameHeader header = idl::decode_header(*arrival->sample);
        delays.milliseconds.push_back(1e-6 * static_cast<double>(arrival->time - header.stamp) +
                                      1e3 * offset.seconds);
      } catch (const InputError&) {
        continue;  // a stranger's message
      }
    } else if (watched.timeout > 0.0 && Clock::now() - heard > watched.patience()) {
      throw silence(listening);
    }
    if (Clock::now() - told < 1s || delays.milliseconds.empty()) continue;
    print_delays(delays, offset, listening.topic().name, watched.json);
    if (watched.once) return 0;
    delays.milliseconds.clear();
    told = Clock::now();
  }
  return 0;
}

}  // namespace

void add_topic_commands(CLI::App& app, const Choose& choose) {
  auto* topic = app.add_subcommand("topic", "Looks at the topics of a running graph");
  topic->require_subcommand(1);
  topic->footer(
      "Topics are named STAGE/PORT, or by their full name.\n"
      "Example:\n  cosegraph topic list\n  cosegraph topic echo segment.yaml source/dense --once");
  const std::string what = "topic, as STAGE/PORT";

  auto* list = topic->add_subcommand("list", "Lists topics with their writers and readers");
  auto listed = std::make_shared<Watched>();
  auto control = std::make_shared<bool>(false);
  auto strangers = std::make_shared<bool>(false);
  add_watched(*list, *listed, "");
  add_timeout(*list, *listed, 3.0, "how long to wait for all stages to be heard");
  list->add_flag("--control", *control, "also the topics that carry no frames");
  list->add_flag("--all", *strangers, "also what others in the same DDS domain write and read");
  list->footer("Example:\n  cosegraph topic list segment.yaml");
  list->callback([=] { choose([=] { return list_topics(*listed, *control, *strangers); }); });

  auto* info = topic->add_subcommand(
      "info", "Shows who writes and reads a topic, with which QoS, and who does not match");
  auto informed = std::make_shared<Watched>();
  add_watched(*info, *informed, what);
  add_timeout(*info, *informed, 3.0, "how long to wait for all stages to be heard");
  info->footer("Example:\n  cosegraph topic info cpc/segments");
  info->callback([=] { choose([=] { return topic_info(*informed); }); });

  auto* echo = topic->add_subcommand("echo", "Prints the messages of a topic");
  auto echoed = std::make_shared<EchoArguments>();
  add_watched(*echo, echoed->watched, what);
  add_once(*echo, echoed->watched, "only one message");
  add_timeout(*echo, echoed->watched, 0.0, "give up after so long without a message; 0: never");
  echo->add_option("--field", echoed->field, "only this member, as header.stage or ports[0].bytes");
  echo->add_option("--count", echoed->count, "only so many messages");
  echo->add_flag("--full", echoed->full, "long arrays as they are, not summarised");
  echo->footer(
      "Frames are only overheard: on a busy network some may be missed, none is delayed.\n"
      "Example:\n  cosegraph topic echo source/dense --once\n"
      "  cosegraph topic echo svm/scores --field probability --full --json");
  echo->callback([=] { choose([=] { return echo_topic(*echoed); }); });

  const auto add_measure = [&](const char* name, const char* doc, Measure measure) {
    auto* command = topic->add_subcommand(name, doc);
    auto measured = std::make_shared<Watched>();
    auto window = std::make_shared<double>(2.0);
    add_watched(*command, *measured, what);
    add_once(*command, *measured, "one line, when the window is full");
    add_timeout(*command, *measured, 5.0, "give up after so long without news of the stage");
    takes_seconds(command->add_option("--window", *window, "that is averaged over"), 1.0, 600.0)
        ->option_text("SECONDS [2]");
    command->footer(std::string("From the writers' own counters: nothing is missed.\n"
                                "Example:\n  cosegraph topic ") +
                    name + " source/dense --once");
    command->callback(
        [=] { choose([=] { return measure_traffic(*measured, *window, measure); }); });
  };
  add_measure("hz", "Tells how many messages per second a topic carries", Measure::messages);
  add_measure("bw", "Tells how many bytes per second a topic carries", Measure::bytes);

  auto* delay = topic->add_subcommand("delay", "Tells how old the frames of a topic are");
  auto delayed = std::make_shared<Watched>();
  add_watched(*delay, *delayed, what);
  add_once(*delay, *delayed, "one line, after a second");
  add_timeout(*delay, *delayed, 0.0, "give up after so long without a message; 0: never");
  delay->footer(
      "The age is counted from admission by the source's clock. How far that is ahead of this\n"
      "machine's is asked from its agent and taken off.\n"
      "Example:\n  cosegraph topic delay astar/labelling");
  delay->callback([=] { choose([=] { return measure_delay(*delayed); }); });
}

}  // namespace cosegraph::tools
