#include "graph/remote.hpp"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <set>
#include <thread>

#include "graph/control.hpp"
#include "graph/dds.hpp"
#include "graph/figures.hpp"
#include "graph/swap.hpp"

namespace cosegraph::graph {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using idl::ReplyState;

struct Remote::Impl {
  Impl(const GraphDescription& description, const std::string& name)
      : graph(description), observer(description, name) {
    Participant& participant = observer.participant();
    commands = participant.writer(control_topic(graph, "command"), "Command", {.depth = 16});
    replies = participant.reader(control_topic(graph, "reply"), "Reply", {.depth = 16},
                                 [this](const Sample& sample) { keep(sample, heard_replies); });
  }

  template <class Value>
  void keep(const Sample& sample, std::deque<Value>& queue) {
    try {
      auto value = idl::decode<Value>(*sample);
      const std::scoped_lock lock(mutex);
      queue.push_back(std::move(value));
    } catch (const std::exception&) {
      return;  // a stranger's message
    }
    news.notify_all();
  }

  // The next of a queue; none if `until` has passed, or it was given up.
  template <class Value>
  std::optional<Value> next(std::deque<Value>& queue, Clock::time_point until) {
    std::unique_lock lock(mutex);
    news.wait_until(lock, until, [&] { return given_up || !queue.empty(); });
    if (given_up || queue.empty()) return std::nullopt;
    Value value = std::move(queue.front());
    queue.pop_front();
    return value;
  }

  GraphDescription graph;
  std::mutex mutex;
  std::condition_variable news;
  bool given_up = false;
  std::deque<idl::Reply> heard_replies;
  std::deque<idl::LogLines> heard_lines;
  Observer observer;
  std::unique_ptr<Writer> commands;
  std::unique_ptr<Reader> replies;
  std::unique_ptr<Reader> log;
};

Remote::Remote(const GraphDescription& graph, const std::string& name)
    : impl_(std::make_unique<Impl>(graph, name)) {}

Remote::~Remote() = default;

Observer& Remote::observer() {
  return impl_->observer;
}

std::map<std::string, ObservedAgent> Remote::agents(std::chrono::milliseconds patience) {
  const auto until = Clock::now() + patience;
  std::set<std::string> expected;
  for (const auto& stage : impl_->graph.stages)
    for (const auto& host : hosts_of(stage)) expected.insert(host);
  for (;;) {
    auto found = impl_->observer.agents();
    const bool all =
        std::ranges::all_of(expected, [&](const auto& host) { return found.contains(host); });
    if ((all && !found.empty()) || Clock::now() >= until) return found;
    impl_->observer.wait(20ms);
  }
}

std::string Remote::order(idl::Command command, std::chrono::milliseconds patience,
                          const std::function<void(const std::string&)>& on_progress) {
  // Whoever answers must have found the way back.
  const auto patience_to_meet = impl_->graph.dds.security.empty() ? 2s : 10s;
  for (const auto limit = Clock::now() + patience_to_meet;
       impl_->replies->matched() < static_cast<int>(impl_->observer.agents().size()) &&
       Clock::now() < limit;)
    std::this_thread::sleep_for(5ms);
  command.id = random_id();
  impl_->commands->write(idl::encode(
      {.graph = impl_->graph.graph, .stage = "command", .stamp = wall_nanoseconds()}, command));
  auto until = Clock::now() + patience;
  while (const auto reply = impl_->next(impl_->heard_replies, until)) {
    if (reply->id != command.id) continue;
    if (reply->state == ReplyState::done) return reply->text;
    if (reply->state == ReplyState::refused) throw Error(reply->text);
    if (on_progress && !reply->text.empty()) on_progress(reply->text);
    until = Clock::now() + patience;
  }
  throw Error("no answer from the agent" +
              (command.host.empty() ? std::string() : " of host '" + command.host + "'"));
}

void Remote::give_up() {
  {
    const std::scoped_lock lock(impl_->mutex);
    impl_->given_up = true;
  }
  impl_->news.notify_all();
}

void Remote::logs(const std::function<bool(const idl::LogLines&)>& take,
                  std::chrono::milliseconds patience) {
  if (impl_->log == nullptr)
    impl_->log = impl_->observer.participant().reader(
        control_topic(impl_->graph, "log"), "LogLines", {.depth = 64},
        [this](const Sample& sample) { impl_->keep(sample, impl_->heard_lines); });
  const auto until = Clock::now() + patience;
  while (const auto lines = impl_->next(impl_->heard_lines, until))
    if (!take(*lines)) return;
}

std::vector<std::string> hosts_running(const std::map<std::string, ObservedAgent>& agents,
                                       const std::string& stage) {
  std::vector<std::string> result;
  for (const auto& [host, agent] : agents)
    if (std::ranges::any_of(agent.status.processes,
                            [&](const auto& process) { return process.stage == stage; }))
      result.push_back(host);
  return result;
}

std::string order_swap(Remote& remote, const GraphDescription& graph, const std::string& source,
                       const std::string& stage, const Replacement& replacement,
                       const std::function<void(const std::string&)>& on_progress) {
  std::vector<std::string> words;
  if (!replacement.use.empty()) words.push_back("use=" + replacement.use);
  if (!replacement.exec.empty()) words.push_back("exec=" + replacement.exec);
  if (!replacement.host.empty()) words.push_back("host=" + replacement.host);
  for (const auto& param : replacement.params) words.push_back("param=" + param);
  if (replacement.dry_run) words.emplace_back("dry-run");
  const auto leaders = hosts_running(remote.agents(2s), source);
  if (leaders.empty()) throw Error("no agent runs the source, whose agent leads swaps");
  return remote.order({.host = leaders[0],
                       .stage = stage,
                       .verb = std::string(verb::kSwap),
                       .words = std::move(words)},
                      std::chrono::milliseconds(static_cast<long>(1000 * graph.deadline)) + 30s,
                      on_progress);
}

}  // namespace cosegraph::graph
