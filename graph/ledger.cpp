#include "graph/ledger.hpp"

#include <algorithm>

namespace cosegraph::graph {

Ledger::Ledger(std::vector<std::string> leaves, int window)
    : leaves_(std::move(leaves)), window_(static_cast<std::size_t>(window)) {}

std::vector<std::uint64_t> Ledger::open() const {
  std::vector<std::uint64_t> result;
  for (const auto& [sequence, frame] : open_) result.push_back(sequence);
  return result;
}

void Ledger::admit(const idl::FrameHeader& header, Clock::time_point now) {
  open_[header.sequence] = {.header = header, .admitted = now};
  ++account_.admitted;
  next_ = header.sequence + 1;
  while (!early_.empty() && early_.begin()->first.first < next_) {
    const auto report = early_.extract(early_.begin());
    if (report.key().first == header.sequence) done(report.key().second, header, report.mapped());
  }
}

void Ledger::done(const std::string& leaf, const idl::FrameHeader& header,
                  const idl::FrameDone& done) {
  if (std::ranges::find(leaves_, leaf) == leaves_.end()) return;
  if (done.outcome == idl::Outcome::ended) {
    ended_.insert(leaf);
    if (end_failure_.empty()) end_failure_ = done.reason;
    return;
  }
  const auto found = open_.find(header.sequence);
  if (found == open_.end()) {
    if (header.sequence >= next_ && header.sequence - next_ < window_)
      early_.insert_or_assign({header.sequence, leaf}, done);
    return;
  }
  Open& frame = found->second;
  frame.reported.insert(leaf);
  frame.labelled |= done.outcome == idl::Outcome::labelled;
  frame.failed |= done.outcome == idl::Outcome::failed;
  if (frame.reported.size() == leaves_.size()) close(header.sequence);
}

void Ledger::close(std::uint64_t sequence) {
  const Open& frame = open_.at(sequence);
  ++(frame.failed ? account_.failed : frame.labelled ? account_.labelled : account_.consumed);
  open_.erase(sequence);
}

std::vector<idl::FrameHeader> Ledger::overdue(Clock::time_point limit) {
  std::vector<idl::FrameHeader> result;
  for (auto& [sequence, frame] : open_) {
    if (frame.overdue || frame.admitted > limit) continue;
    frame.overdue = true;
    result.push_back(frame.header);
  }
  return result;
}

void Ledger::abandon(const idl::FrameHeader& header) {
  const auto found = open_.find(header.sequence);
  if (found == open_.end()) return;
  found->second.failed = true;
  close(header.sequence);
}

}  // namespace cosegraph::graph
