#include "graph/swap.hpp"

#include <algorithm>
#include <set>

namespace cosegraph::graph {

using namespace std::chrono_literals;
using idl::ProcessState;
using idl::State;

namespace {

constexpr auto kReadyPatience = 20s;
constexpr auto kActivePatience = 5s;
constexpr auto kSettlePatience = 10s;
constexpr auto kUsualSpan = 5s;  // before a swap, for the usual interval

double milliseconds(std::chrono::steady_clock::duration time) {
  return std::chrono::duration<double, std::milli>(time).count();
}

// Where admission stands; the epoch is 0 if nothing is known.
StreamPosition admission(const GraphView& view) {
  StreamPosition newest;
  for (const auto& [key, known] : view.statuses) {
    const auto& [header, status] = known;
    if (std::get<0>(key) != view.source || status.candidate || header.epoch < newest.epoch)
      continue;
    const auto& account = status.account;
    const std::uint64_t in_flight =
        account.admitted - account.labelled - account.consumed - account.failed;
    newest = {header.epoch, status.settled + in_flight};
  }
  return newest;
}

StreamPosition settled(const GraphView& view) {
  StreamPosition newest;
  for (const auto& [key, known] : view.statuses)
    if (std::get<0>(key) == view.source && !known.second.candidate &&
        known.first.epoch >= newest.epoch)
      newest = {known.first.epoch, known.second.settled};
  return newest;
}

using Known = std::pair<idl::FrameHeader, idl::StageStatus>;

const Known* known(const GraphView& view, const ProcessKey& key) {
  const auto found = view.statuses.find(key);
  return found == view.statuses.end() ? nullptr : &found->second;
}

// The process that the newcomer follows; none if it has ended.
std::optional<ProcessKey> predecessor(const GraphView& view, const ProcessKey& newcomer) {
  const auto& [stage, replica, generation] = newcomer;
  std::optional<ProcessKey> newest;
  for (const auto& [key, process] : view.processes)
    if (std::get<0>(key) == stage && std::get<1>(key) == replica && key < newcomer &&
        process.state == ProcessState::running)
      newest = key;
  return newest;
}

}  // namespace

Swap::Swap(SwapRequest request, Clock::time_point now)
    : request_(std::move(request)), began_(now), entered_(now) {
  // A process that is started again might bear the generation of the newcomer.
  order_agents(request_.old_hosts, verb::kRetire);
  const std::string yaml = to_yaml(request_.graph);
  const auto& hosts = request_.new_hosts;
  for (const auto& host : std::set<std::string>(hosts.begin(), hosts.end())) {
    std::vector<std::string> words{yaml};
    for (std::size_t r = 0; r < hosts.size(); ++r)
      if (hosts[r] == host) words.push_back(std::to_string(r));
    order(verb::kLaunch, std::move(words), host);
  }
}

std::string Swap::activity() const {
  switch (phase_) {
    case Phase::launching:
      return "the newcomer gets ready";
    case Phase::draining:
      return "the old one finishes its frame";
    case Phase::activating:
      return "the newcomer takes its place";
    case Phase::settling:
      return "frames of the old one are finished";
    case Phase::done:
      return "done";
    case Phase::failed:
      return why_;
  }
  return "";
}

// To the agent of `host`, or to stages.
void Swap::order(std::string_view verb, std::vector<std::string> words, const std::string& host) {
  orders_.push_back({.id = random_id(),
                     .host = host,
                     .stage = request_.stage,
                     .generation = request_.new_generation,
                     .verb = std::string(verb),
                     .words = std::move(words)});
}

void Swap::order_agents(const std::vector<std::string>& hosts, std::string_view verb) {
  for (const auto& host : std::set<std::string>(hosts.begin(), hosts.end())) order(verb, {}, host);
}

ProcessKey Swap::newcomer(std::uint32_t replica) const {
  return {request_.stage, replica, request_.new_generation};
}

// Why the newcomer will not do, or nothing.
std::string Swap::newcomer_fault(const GraphView& view) const {
  for (std::uint32_t r = 0; r < replicas(); ++r) {
    const auto process = view.processes.find(newcomer(r));
    if (process != view.processes.end() && (process->second.state == ProcessState::failed ||
                                            process->second.state == ProcessState::stopped))
      return "the newcomer " + (process->second.text.empty() ? "ended" : process->second.text);
    const Known* seen = known(view, newcomer(r));
    if (seen == nullptr) continue;
    if (seen->second.state == State::failed) return "the newcomer failed: " + seen->second.activity;
    const auto old_key = predecessor(view, newcomer(r));
    const Known* old = old_key ? known(view, *old_key) : nullptr;
    if (old != nullptr && !old->second.recipe.empty() && !seen->second.recipe.empty() &&
        seen->second.recipe != old->second.recipe)
      return "what " + request_.stage + " gives would be made as [" + seen->second.recipe +
             "] instead of [" + old->second.recipe +
             "], which the running model and the other stages do not fit: train a model for it, "
             "and start the graph with that";
  }
  return "";
}

void Swap::enter(Phase phase, Clock::time_point now) {
  phase_ = phase;
  entered_ = now;
  if (finished()) ended_ = now;
}

void Swap::give_up(const std::string& why, Clock::time_point now) {
  why_ = why;
  if (phase_ != Phase::launching) order(verb::kRelease);
  order_agents(request_.new_hosts, verb::kDismiss);
  order_agents(request_.old_hosts, verb::kKeep);
  enter(Phase::failed, now);
}

void Swap::await_readiness(const GraphView& view) {
  if (const std::string fault = newcomer_fault(view); !fault.empty())
    return give_up(fault, view.now);
  std::string lacks;
  bool ready = true;
  for (std::uint32_t r = 0; r < replicas(); ++r) {
    const Known* seen = known(view, newcomer(r));
    if (seen != nullptr && seen->second.state == State::standby) continue;
    ready = false;
    lacks = seen == nullptr ? "its agent has not started it" : seen->second.activity;
  }
  if (!ready && view.now - entered_ > kReadyPatience)
    return give_up("the newcomer did not get ready: " + lacks, view.now);
  if (!ready) return;
  if (request_.dry_run) {
    order_agents(request_.new_hosts, verb::kDismiss);
    order_agents(request_.old_hosts, verb::kKeep);
    return enter(Phase::done, view.now);
  }
  for (std::uint32_t r = 0; r < replicas(); ++r)
    if (const auto old = predecessor(view, newcomer(r));
        old && known(view, *old) != nullptr && known(view, *old)->second.state == State::finished)
      return give_up("the stream is over", view.now);
  first_ = admission(view);
  drained_at_ = view.now;
  order(verb::kDrain);
  enter(Phase::draining, view.now);
}

void Swap::await_drain(const GraphView& view) {
  if (const std::string fault = newcomer_fault(view); !fault.empty())
    return give_up(fault, view.now);
  std::vector<std::string> handovers;
  std::string busy;
  for (std::uint32_t r = 0; r < replicas(); ++r) {
    Handover handover{.replica = r};
    if (const auto old = predecessor(view, newcomer(r))) {
      const Known* seen = known(view, *old);
      if (seen == nullptr || seen->second.state != State::drained) {
        busy = seen == nullptr || seen->first.name.empty() ? "a frame" : seen->first.name;
        continue;
      }
      handover.next = {seen->first.epoch, seen->second.next};
      handover.taken = seen->second.next;
      handover.account = seen->second.account;
    } else if (request_.stage == view.source) {
      // How far it had come, only the one that is started again after it can tell.
      return give_up("the old one ended", view.now);
    }
    handovers.push_back(handover.to_word());
  }
  if (handovers.size() < replicas()) {
    if (view.now - entered_ > std::chrono::duration<double>(request_.graph.deadline))
      give_up("the old one is still busy with " + busy, view.now);
    return;
  }
  order(verb::kActivate, std::move(handovers));
  enter(Phase::activating, view.now);
}

void Swap::await_activation(const GraphView& view) {
  if (const std::string fault = newcomer_fault(view); !fault.empty())
    return give_up(fault, view.now);
  for (std::uint32_t r = 0; r < replicas(); ++r) {
    const Known* seen = known(view, newcomer(r));
    if (seen != nullptr && !seen->second.candidate) continue;
    if (view.now - entered_ > kActivePatience)
      give_up("the newcomer does not take its place", view.now);
    return;
  }
  last_ = admission(view);
  enter(Phase::settling, view.now);
}

// Until what the old one has given out is over, and a little is seen of the newcomer's.
void Swap::await_settlement(const GraphView& view) {
  if (const std::string fault = newcomer_fault(view); !fault.empty())
    return give_up(fault + " right after it had taken over", view.now);
  const StreamPosition over = settled(view);
  const bool settled =
      over.epoch > last_.epoch || (over.epoch == last_.epoch && over.sequence >= last_.sequence);
  if (!settled && view.now - entered_ < kSettlePatience) return;
  std::vector<std::string> hosts = request_.new_hosts;
  hosts.insert(hosts.end(), request_.old_hosts.begin(), request_.old_hosts.end());
  order_agents(hosts, verb::kReplace);
  enter(Phase::done, view.now);
}

std::vector<idl::Command> Swap::step(const GraphView& view) {
  // Several phases may pass at once where everything is known already.
  for (bool moved = true; moved && !finished();) {
    const Phase before = phase_;
    if (phase_ == Phase::launching) await_readiness(view);
    if (phase_ == Phase::draining) await_drain(view);
    if (phase_ == Phase::activating) await_activation(view);
    if (phase_ == Phase::settling) await_settlement(view);
    moved = phase_ != before;
  }
  return std::exchange(orders_, {});
}

SwapReport Swap::report(const std::deque<FrameReport>& frames) const {
  SwapReport report{
      .done = phase_ == Phase::done, .text = why_, .took_ms = milliseconds(ended_ - began_)};
  if (!report.done || request_.dry_run) return report;

  // Frames admitted from the drain on until the newcomer was at work.
  std::set<std::string> leaves;
  std::map<std::uint64_t, std::map<std::string, int>> reports;
  std::set<std::uint64_t> failed;
  for (const auto& frame : frames) {
    leaves.insert(frame.leaf);
    if (frame.epoch != first_.epoch || frame.sequence < first_.sequence) continue;
    if (last_.epoch == first_.epoch && frame.sequence >= last_.sequence) continue;
    ++reports[frame.sequence][frame.leaf];
    if (frame.failed) failed.insert(frame.sequence);
  }
  std::uint64_t end = last_.epoch == first_.epoch ? last_.sequence : first_.sequence;
  if (last_.epoch != first_.epoch && !reports.empty()) end = reports.rbegin()->first + 1;
  report.admitted = end > first_.sequence ? end - first_.sequence : 0;
  report.failed = failed.size();
  for (const auto& [sequence, by_leaf] : reports) {
    if (by_leaf.size() == leaves.size()) ++report.finished;
    for (const auto& [leaf, count] : by_leaf)
      report.doubled += static_cast<std::uint64_t>(count - 1);
  }
  report.lost = report.admitted - std::min(report.admitted, report.finished);

  // Intervals at the leaf that is worst off.
  for (const auto& leaf : leaves) {
    std::vector<double> before;
    Clock::time_point last{};
    double longest = 0.0;
    for (const auto& frame : frames) {
      if (frame.leaf != leaf) continue;
      if (last != Clock::time_point{}) {
        const double interval = milliseconds(frame.time - last);
        if (frame.time > drained_at_ && last < ended_) longest = std::max(longest, interval);
        if (frame.time <= drained_at_ && frame.time > drained_at_ - kUsualSpan)
          before.push_back(interval);
      }
      last = frame.time;
    }
    report.pause_ms = std::max(report.pause_ms, longest);
    if (before.empty()) continue;
    const auto middle = before.begin() + static_cast<std::ptrdiff_t>(before.size() / 2);
    std::ranges::nth_element(before, middle);
    report.usual_ms = std::max(report.usual_ms, *middle);
  }
  return report;
}

std::vector<idl::Command> end_leftover_swap(const GraphView& view, const std::string& stage,
                                            const std::string& host) {
  // By replica and generation; of two of a replica, or of one that stands by, the newest is the
  // newcomer's.
  std::map<ProcessKey, bool> running;  // whether it stands by
  std::uint32_t newcomer = 0;
  for (const auto& [key, process] : view.processes) {
    const auto& [name, replica, generation] = key;
    if (name != stage || process.state != ProcessState::running) continue;
    const Known* seen = known(view, key);
    const bool stands_by = seen != nullptr && seen->second.candidate;
    const bool is_second = !running.empty() && std::get<1>(running.rbegin()->first) == replica;
    if (is_second || stands_by) newcomer = std::max(newcomer, generation);
    running[key] = stands_by;
  }
  std::vector<idl::Command> orders;
  const auto order = [&](std::string_view verb, std::uint32_t generation) {
    orders.push_back({.id = random_id(),
                      .host = verb::is_for_stage(verb) ? "" : host,
                      .stage = stage,
                      .generation = generation,
                      .verb = std::string(verb)});
  };
  if (newcomer == 0) {
    // The old ones are alone: they may still hold, or not be started again.
    for (const auto& [key, stands_by] : running)
      if (const auto found = view.hosts.find(key);
          found != view.hosts.end() && found->second == host) {
        order(verb::kRelease, std::get<2>(key) + 1);
        order(verb::kKeep, std::get<2>(key) + 1);
      }
    return orders;
  }
  const bool has_taken_over = std::ranges::any_of(running, [&](const auto& process) {
    const Known* seen = known(view, process.first);
    return std::get<2>(process.first) == newcomer && seen != nullptr && !process.second;
  });
  const bool is_alone = std::ranges::all_of(
      running, [&](const auto& process) { return std::get<2>(process.first) >= newcomer; });
  if (has_taken_over || is_alone) {
    order(verb::kActivate, newcomer);
    order(verb::kReplace, newcomer);
  } else {
    order(verb::kRelease, newcomer);
    order(verb::kDismiss, newcomer);
    order(verb::kKeep, newcomer);
  }
  return orders;
}

}  // namespace cosegraph::graph
