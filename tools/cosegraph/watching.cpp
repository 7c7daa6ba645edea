#include "tools/cosegraph/watching.hpp"

#include <algorithm>
#include <cstdio>
#include <set>
#include <thread>

#include "graph/figures.hpp"
#include "graph/runs.hpp"
#include "graph/swap.hpp"
#include "graph/topics.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/durations.hpp"

namespace cosegraph::tools {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

graph::GraphDescription Watched::find() const {
  const bool both = words.size() > 1;
  if (both && !graph.empty())
    throw ParameterError("the graph is named twice: '" + words[0] + "' and --graph " + graph);
  return graph::find_run({both ? words[0] : graph, instance});
}

void add_watched(CLI::App& command, Watched& watched, const std::string& what) {
  if (!what.empty())
    command.add_option("name", watched.words, "[GRAPH] " + what)
        ->required()
        ->expected(1, 2)
        ->option_text("[GRAPH] NAME REQUIRED");
  command.add_option(what.empty() ? "-g,--graph,graph" : "-g,--graph", watched.graph,
                     "graph file, or name of a running graph; the only one that runs here if it "
                     "is left out");
  command.add_option("--instance", watched.instance, "which of several runs of it");
  command.add_flag("--json", watched.json, "as JSON");
}

void add_once(CLI::App& command, Watched& watched, const std::string& doc) {
  command.add_flag("--once", watched.once, doc);
}

void add_timeout(CLI::App& command, Watched& watched, double value, const std::string& doc) {
  watched.timeout = value;
  takes_seconds(command.add_option("--timeout", watched.timeout, doc), 0.0, 1e6)
      ->option_text("SECONDS [" + std::to_string(static_cast<int>(value)) + "]");
}

std::vector<Topic> topics_of(const graph::GraphDescription& graph) {
  std::vector<Topic> result;
  const auto infos = graph::infos_of(graph, graph::catalog_of(stage_table()));
  for (std::size_t i = 0; i < infos.size(); ++i)
    for (const auto& port : infos[i].outputs)
      result.push_back({.name = graph::topic_name(graph, graph.stages[i].name, port.name),
                        .type = port.type,
                        .latched = port.latched});
  for (auto& topic : graph::control_topics(graph))
    result.push_back(
        {.name = std::move(topic.name), .type = std::move(topic.type), .is_control = true});
  return result;
}

std::optional<Topic> find_topic(const graph::GraphDescription& graph, const std::string& name) {
  for (const auto& topic : topics_of(graph))
    if (topic.name == name || topic.name == graph.graph + "/" + name) return topic;
  return std::nullopt;
}

Topic require_topic(const graph::GraphDescription& graph, const std::string& name,
                    const graph::Domain& domain) {
  if (const auto topic = find_topic(graph, name)) return *topic;
  for (const auto& endpoint : domain.endpoints)
    if (endpoint.topic == name) return {.name = name};
  std::vector<std::string> names;
  for (const auto& topic : topics_of(graph)) {
    names.push_back(topic.name.substr(graph.graph.size() + 1));
    if (name.starts_with(graph.graph + "/")) names.back() = topic.name;
  }
  throw ParameterError("graph '" + graph.graph + "' has no topic '" + name + "'" +
                       did_you_mean(name, names) + "; see 'cosegraph topic list'");
}

const graph::StageNode& require_stage(const graph::GraphDescription& graph,
                                      const std::string& stage) {
  if (const graph::StageNode* node = graph.stage(stage)) return *node;
  std::vector<std::string> names;
  for (const auto& node : graph.stages) names.push_back(node.name);
  throw ParameterError("graph '" + graph.graph + "' has no stage '" + stage + "'" +
                       did_you_mean(stage, names));
}

Looks look_twice(graph::Observer& observer, const graph::GraphDescription& graph,
                 std::chrono::milliseconds patience) {
  std::set<std::string> expected;
  for (const auto& stage : graph.stages)
    for (std::uint32_t i = 0; i < graph::hosts_of(stage).size(); ++i)
      expected.insert(graph::process_name(stage, i));
  constexpr std::int64_t kSpan = 400'000'000;  // ns between the two statuses of a process
  const auto until = Clock::now() + patience;
  Looks looks;
  for (;;) {
    looks.now = observer.stages();
    std::size_t settled = 0;
    for (const auto& [name, seen] : looks.now) {
      const auto first = looks.before.try_emplace(name, seen).first;
      if (first->second.status.pid != seen.status.pid) first->second = seen;
      if (seen.header.stamp - first->second.header.stamp > kSpan) ++settled;
    }
    const bool all = std::ranges::all_of(
        expected, [&](const std::string& name) { return looks.now.contains(name); });
    if ((all && settled == looks.now.size()) || Clock::now() >= until) return looks;
    observer.wait(20ms);
  }
}

namespace {

constexpr auto kSilentAfter = 1s;  // statuses come several times a second

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[160];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

// A stage's processes as one box of a drawing.
void add_process(graph::LiveStage& stage, const graph::Observed& seen, const graph::Load& load,
                 const std::string& prefix) {
  using Mood = graph::LiveStage::Mood;
  const idl::StageStatus& status = seen.status;
  if (status.state == idl::State::failed || is_silent(seen))
    stage.mood = Mood::wrong;
  else if (status.state == idl::State::working && stage.mood == Mood::idle)
    stage.mood = Mood::busy;
  stage.state += (stage.state.empty() ? "" : ", ") + prefix + state_text(seen);
  if (!status.activity.empty()) stage.figures.push_back(prefix + status.activity);
  stage.figures.push_back(prefix + format("%llu frames, %.1f Hz, %llu waiting",
                                          static_cast<unsigned long long>(status.frames_out),
                                          load.rate,
                                          static_cast<unsigned long long>(status.queue)));
  if (status.frames_failed > 0)
    stage.figures.push_back(
        prefix + format("%llu failed", static_cast<unsigned long long>(status.frames_failed)));
  stage.figures.push_back(
      prefix + format("%.1f ms, p99 %.1f ms", status.latency_median, status.latency_p99));
}

}  // namespace

bool is_silent(const graph::Observed& seen) {
  const idl::State state = seen.status.state;
  const bool over = state == idl::State::failed || state == idl::State::stopped;
  return !over && Clock::now() - seen.heard > kSilentAfter;
}

std::string state_text(const graph::Observed& seen) {
  std::string text(to_name(seen.status.state));
  if (is_silent(seen))
    text +=
        format(", silent %.1f s", std::chrono::duration<double>(Clock::now() - seen.heard).count());
  return text;
}

graph::Overlay overlay_of(const graph::GraphDescription& graph, const Looks& looks) {
  graph::Overlay overlay;
  const auto loads = graph::loads_of(looks.before, looks.now);
  for (const auto& stage : graph.stages)
    for (std::uint32_t i = 0; i < graph::hosts_of(stage).size(); ++i) {
      const std::string process = graph::process_name(stage, i);
      const auto seen = looks.now.find(process);
      if (seen == looks.now.end()) continue;
      add_process(overlay.stages[stage.name], seen->second, loads.at(process),
                  stage.replicas.empty() ? "" : std::to_string(i) + ": ");
      const idl::Account& account = seen->second.status.account;
      if (account.admitted > 0)
        overlay.title = format(": %llu admitted, %llu done, %llu failed, %llu dropped",
                               static_cast<unsigned long long>(account.admitted),
                               static_cast<unsigned long long>(account.labelled + account.consumed),
                               static_cast<unsigned long long>(account.failed),
                               static_cast<unsigned long long>(account.dropped));
    }
  for (const auto& [topic, traffic] : graph::traffic_of(looks.before, looks.now))
    overlay.topics[topic] = std::to_string(traffic.messages) +
                            (traffic.span > 0.0 ? format(", %.1f Hz, ", traffic.rate) +
                                                      bytes_text(traffic.byte_rate) + "/s"
                                                : "");
  return overlay;
}

bool pause(const StopSignals& signals, std::chrono::milliseconds time) {
  const auto until = Clock::now() + time;
  while (!signals.asked() && Clock::now() < until)
    std::this_thread::sleep_for(std::min<Clock::duration>(20ms, until - Clock::now()));
  return !signals.asked();
}

ClockOffset ask_clock(graph::Remote& remote, const std::string& host) {
  ClockOffset best{.host = host, .how = "no agent answers for it"};
  for (int i = 0; i < 8; ++i) {
    const auto asked = Clock::now();
    const std::int64_t asked_at = graph::wall_nanoseconds();
    std::string answer;
    try {
      answer = remote.order({.host = host, .verb = std::string(graph::verb::kClock)}, 1s);
    } catch (const Error&) {
      break;
    }
    const double trip = std::chrono::duration<double>(Clock::now() - asked).count();
    const double theirs = 1e-9 * static_cast<double>(std::stoll(answer) - asked_at);
    if (best.known && trip / 2.0 >= best.uncertainty) continue;
    best = {.host = host,
            .known = true,
            .seconds = theirs - trip / 2.0,
            .uncertainty = trip / 2.0,
            .how = "round trip with its agent"};
  }
  return best;
}

std::string bytes_text(double bytes) {
  static constexpr const char* kUnits[] = {"B", "kB", "MB", "GB"};
  std::size_t unit = 0;
  for (; bytes >= 1000.0 && unit + 1 < std::size(kUnits); ++unit) bytes /= 1000.0;
  char text[32];
  std::snprintf(text, sizeof text, unit == 0 ? "%.0f %s" : "%.1f %s", bytes, kUnits[unit]);
  return text;
}

}  // namespace cosegraph::tools
