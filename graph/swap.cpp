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

}  // namespace

Swap::Swap(SwapRequest request, Clock::time_point now)
    : request_(std::move(request)), began_(now), entered_(now) {
  // A process that is started again would bear the generation of the newcomer.
  to_agents(request_.old_hosts, verb::kRetire, request_.old_generation);
  const std::string yaml = to_yaml(request_.graph);
  const auto& hosts = request_.new_hosts;
  for (const auto& host : std::set<std::string>(hosts.begin(), hosts.end())) {
    std::vector<std::string> words{yaml};
    for (std::size_t r = 0; r < hosts.size(); ++r)
      if (hosts[r] == host) words.push_back(std::to_string(r));
    orders_.push_back(to_agent(host, verb::kLaunch, request_.new_generation, std::move(words)));
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

idl::Command Swap::to_agent(const std::string& host, std::string_view verb,
                            std::uint32_t generation, std::vector<std::string> words) const {
  // An agent is meant: the name of its host is given even where it is empty.
  return {.id = random_id(),
          .host = host,
          .stage = request_.stage,
          .generation = generation,
          .verb = std::string(verb),
          .words = std::move(words)};
}

idl::Command Swap::to_stage(std::string_view verb, std::uint32_t generation,
                            std::vector<std::string> words) const {
  return to_agent("", verb, generation, std::move(words));
}

void Swap::to_agents(const std::vector<std::string>& hosts, std::string_view verb,
                     std::uint32_t generation) {
  for (const auto& host : std::set<std::string>(hosts.begin(), hosts.end()))
    orders_.push_back(to_agent(host, verb, generation));
}

const idl::StageStatus* Swap::status(const GraphView& view, std::uint32_t generation,
                                     std::uint32_t replica) const {
  const auto found = view.statuses.find({request_.stage, replica, generation});
  return found == view.statuses.end() ? nullptr : &found->second.second;
}

// Why the newcomer will not do, or nothing.
std::string Swap::newcomer_fault(const GraphView& view) const {
  for (std::uint32_t r = 0; r < replicas(); ++r) {
    const auto process = view.processes.find({request_.stage, r, request_.new_generation});
    if (process != view.processes.end() && (process->second.state == ProcessState::failed ||
                                            process->second.state == ProcessState::stopped))
      return "the newcomer " + (process->second.text.empty() ? "ended" : process->second.text);
    const auto* seen = status(view, request_.new_generation, r);
    if (seen != nullptr && seen->state == State::failed)
      return "the newcomer failed: " + seen->activity;
    const auto* old = status(view, request_.old_generation, r);
    if (seen != nullptr && old != nullptr && !old->recipe.empty() && !seen->recipe.empty() &&
        seen->recipe != old->recipe)
      return "what " + request_.stage + " gives would be made as [" + seen->recipe +
             "] instead of [" + old->recipe +
             "], which the running model and the other stages do not fit: train a model for it, "
             "and start the graph with that";
  }
  return "";
}

bool Swap::old_is_gone(const GraphView& view, std::uint32_t replica) const {
  const auto process = view.processes.find({request_.stage, replica, request_.old_generation});
  return process == view.processes.end() || process->second.state != ProcessState::running;
}

void Swap::enter(Phase phase, Clock::time_point now) {
  phase_ = phase;
  entered_ = now;
  if (finished()) ended_ = now;
}

void Swap::give_up(const std::string& why, Clock::time_point now) {
  why_ = why;
  if (phase_ != Phase::launching)
    orders_.push_back(to_stage(verb::kRelease, request_.old_generation));
  to_agents(request_.new_hosts, verb::kDismiss, request_.new_generation);
  to_agents(request_.old_hosts, verb::kKeep, request_.old_generation);
  enter(Phase::failed, now);
}

void Swap::await_readiness(const GraphView& view) {
  if (const std::string fault = newcomer_fault(view); !fault.empty())
    return give_up(fault, view.now);
  std::string lacks;
  bool ready = true;
  for (std::uint32_t r = 0; r < replicas(); ++r) {
    const auto* seen = status(view, request_.new_generation, r);
    if (seen != nullptr && seen->state == State::standby) continue;
    ready = false;
    lacks = seen == nullptr ? "its agent has not started it" : seen->activity;
  }
  if (!ready && view.now - entered_ > kReadyPatience)
    return give_up("the newcomer did not get ready: " + lacks, view.now);
  if (!ready) return;
  if (request_.dry_run) {
    to_agents(request_.new_hosts, verb::kDismiss, request_.new_generation);
    to_agents(request_.old_hosts, verb::kKeep, request_.old_generation);
    return enter(Phase::done, view.now);
  }
  for (std::uint32_t r = 0; r < replicas(); ++r)
    if (const auto* old = status(view, request_.old_generation, r);
        old != nullptr && old->state == State::finished)
      return give_up("the stream is over", view.now);
  first_ = admission(view);
  drained_at_ = view.now;
  orders_.push_back(to_stage(verb::kDrain, request_.old_generation));
  enter(Phase::draining, view.now);
}

void Swap::await_drain(const GraphView& view) {
  if (const std::string fault = newcomer_fault(view); !fault.empty())
    return give_up(fault, view.now);
  handovers_.clear();
  std::string busy;
  for (std::uint32_t r = 0; r < replicas(); ++r) {
    Handover handover{.replica = r};
    const auto known = view.statuses.find({request_.stage, r, request_.old_generation});
    if (known != view.statuses.end() && known->second.second.state == State::drained) {
      const auto& [header, status] = known->second;
      handover.next = {header.epoch, status.next};
      handover.taken = status.next;
      handover.account = status.account;
    } else if (!old_is_gone(view, r)) {
      busy = known == view.statuses.end() ? "" : known->second.first.name;
      if (busy.empty()) busy = "a frame";
      continue;
    }
    handovers_.push_back(handover);
  }
  if (handovers_.size() < replicas()) {
    if (view.now - entered_ > std::chrono::duration<double>(request_.graph.deadline))
      give_up("the old one is still busy with " + busy, view.now);
    return;
  }
  std::vector<std::string> words;
  for (const auto& handover : handovers_) words.push_back(handover.to_word());
  orders_.push_back(to_stage(verb::kActivate, request_.new_generation, std::move(words)));
  enter(Phase::activating, view.now);
}

void Swap::await_activation(const GraphView& view) {
  if (const std::string fault = newcomer_fault(view); !fault.empty())
    return give_up(fault, view.now);
  for (std::uint32_t r = 0; r < replicas(); ++r) {
    const auto* seen = status(view, request_.new_generation, r);
    if (seen != nullptr && !seen->candidate) continue;
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
  to_agents(request_.new_hosts, verb::kPromote, request_.new_generation);
  to_agents(request_.old_hosts, verb::kDismiss, request_.old_generation);
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

}  // namespace cosegraph::graph
