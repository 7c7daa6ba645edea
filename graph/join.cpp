#include "graph/join.hpp"

namespace cosegraph::graph {

Join::Join(std::vector<std::string> ports, bool resume) : ports_(ports.size()), resume_(resume) {}

// False for a message of an epoch that is over.
bool Join::adopt(const idl::FrameHeader& header) {
  if (header.epoch < epoch_) return false;
  if (header.epoch > epoch_) {
    if (epoch_ != 0) resume_ = false;
    epoch_ = header.epoch;
    next_ = 0;
    slots_.clear();
    seen_ports_.clear();
    count_.reset();
    ended_ = false;
  }
  return true;
}

Join::Slot* Join::slot_of(const idl::FrameHeader& header) {
  if (!adopt(header) || (!resume_ && header.sequence < next_)) {
    ++ignored_;
    return nullptr;
  }
  Slot& slot = slots_[header.sequence];
  if (slot.header.epoch == 0) slot.header = header;
  return &slot;
}

void Join::add(const std::string& port, const idl::FrameHeader& header, Sample sample) {
  Slot* slot = slot_of(header);
  if (slot == nullptr) return;
  if (resume_) seen_ports_.insert(port);
  if (!slot->failed && !slot->inputs.emplace(port, std::move(sample)).second) ++ignored_;
}

void Join::fail(const idl::FrameHeader& header, std::string stage, std::string reason) {
  Slot* slot = slot_of(header);
  if (slot == nullptr || slot->failed) return;
  slot->failed = true;
  slot->inputs.clear();
  slot->stage = std::move(stage);
  slot->reason = std::move(reason);
}

void Join::end(const idl::FrameHeader& header, std::uint64_t count) {
  if (!adopt(header)) return;
  count_ = count;
  end_header_ = header;
}

// Which frame is to be released next, if that is known yet.
std::optional<std::uint64_t> Join::next_sequence() const {
  if (!resume_) return next_;
  if (seen_ports_.size() < ports_) {
    // Nothing more will come once the stream has ended with nothing left for this stage.
    if (count_ && slots_.empty()) return count_;
    return std::nullopt;
  }
  for (const auto& [sequence, slot] : slots_)
    if (is_complete(slot)) return sequence;
  return std::nullopt;
}

bool Join::ready() const {
  const auto next = next_sequence();
  if (!next) return false;
  if (count_ && *next >= *count_) return !ended_;
  const auto slot = slots_.find(*next);
  return slot != slots_.end() && is_complete(slot->second);
}

std::optional<Join::Released> Join::take() {
  if (!ready()) return std::nullopt;
  const std::uint64_t next = *next_sequence();
  resume_ = false;
  next_ = next;
  slots_.erase(slots_.begin(), slots_.lower_bound(next));
  if (count_ && next >= *count_) {
    ended_ = true;
    return Released{.kind = Released::Kind::ended, .header = end_header_};
  }
  auto node = slots_.extract(next);
  Slot& slot = node.mapped();
  ++next_;
  return Released{.kind = slot.failed ? Released::Kind::failed : Released::Kind::frame,
                  .header = std::move(slot.header),
                  .inputs = std::move(slot.inputs),
                  .failed_stage = std::move(slot.stage),
                  .reason = std::move(slot.reason)};
}

}  // namespace cosegraph::graph
