#include "graph/join.hpp"

#include <algorithm>
#include <iterator>

namespace cosegraph::graph {

using Start = JoinOptions::Start;

namespace {

constexpr std::uint64_t kFarthestAhead = 1U << 20U;  // of what the source says is over, in frames
// Of frames that cannot be in flight.
constexpr std::size_t kMostSlots = 1024;
constexpr std::size_t kMostBytes = std::size_t{256} << 20U;

}  // namespace

Join::Join(std::vector<std::string> ports, const JoinOptions& options)
    : ports_(ports.size()),
      options_(options),
      mode_(options.start == Start::standby  ? Mode::standby
            : options.start == Start::resume ? Mode::resuming
                                             : Mode::running),
      gone_(static_cast<std::size_t>(options.replicas), false) {}

// False for a message of an epoch that is over.
bool Join::adopt(std::uint64_t epoch) {
  if (epoch < epoch_) return false;
  if (epoch > epoch_) {
    // A stream that began before this eye is resumed; one that begins under it is not.
    if (epoch_ != 0 && mode_ != Mode::standby) mode_ = Mode::running;
    epoch_ = epoch;
    floor_ = 0;
    released_.clear();
    slots_.clear();
    seen_ports_.clear();
    count_.reset();
    ended_ = false;
    told_ = false;
  }
  return true;
}

Join::Slot* Join::slot_of(const idl::FrameHeader& header) {
  const std::uint64_t sequence = header.sequence;
  if (!adopt(header.epoch) || sequence < floor_ || released_.contains(sequence) ||
      (told_ && sequence - floor_ > kFarthestAhead)) {
    ++ignored_;
    return nullptr;
  }
  Slot& slot = slots_[sequence];
  if (slot.header.epoch == 0) slot.header = header;
  // Of what may never be released here, no more is kept than can be in flight.
  const auto kept = 2 * static_cast<std::uint64_t>(options_.window) + 2;
  if (sequence >= kept && (mode_ == Mode::standby || options_.replicas > 1))
    raise_floor(sequence - kept + 1);
  return &slot;
}

void Join::add(const std::string& port, const idl::FrameHeader& header, Sample sample) {
  Slot* slot = slot_of(header);
  if (slot == nullptr) return;
  if (mode_ != Mode::running) seen_ports_.insert(port);
  if (!slot->failed && !slot->inputs.emplace(port, std::move(sample)).second) ++ignored_;
  shed();
  find_start();
}

void Join::fail(const idl::FrameHeader& header, std::string stage, std::string reason) {
  Slot* slot = slot_of(header);
  if (slot == nullptr || slot->failed) return;
  slot->failed = true;
  slot->inputs.clear();
  slot->stage = std::move(stage);
  slot->reason = std::move(reason);
  shed();
  find_start();
}

void Join::end(const idl::FrameHeader& header, std::uint64_t count) {
  if (!adopt(header.epoch)) return;
  count_ = count;
  end_header_ = header;
  find_start();
}

void Join::raise_floor(std::uint64_t sequence) {
  if (sequence <= floor_) return;
  floor_ = sequence;
  slots_.erase(slots_.begin(), slots_.lower_bound(floor_));
  released_.erase(released_.begin(), released_.lower_bound(floor_));
  while (released_.erase(floor_) > 0) ++floor_;
}

// Drops the frames farthest ahead while there are more than can be in flight, and too many or too
// large ones.
void Join::shed() {
  const auto in_flight = 2 * static_cast<std::size_t>(options_.window) + 2;
  if (slots_.size() <= in_flight) return;
  const auto size_of = [](const Slot& slot) {
    std::size_t bytes = slot.reason.size() + slot.header.name.size();
    for (const auto& [port, sample] : slot.inputs) bytes += sample->size();
    return bytes;
  };
  std::size_t bytes = 0;
  for (const auto& [sequence, slot] : slots_) bytes += size_of(slot);
  while (slots_.size() > in_flight && (slots_.size() > kMostSlots || bytes > kMostBytes)) {
    const auto farthest = std::prev(slots_.end());
    bytes -= size_of(farthest->second);
    slots_.erase(farthest);
    ++ignored_;
  }
}

void Join::settle(const StreamPosition& position) {
  if (position.epoch == 0 || !adopt(position.epoch)) return;
  told_ = true;
  raise_floor(position.sequence);
  if (mode_ == Mode::resuming || mode_ == Mode::anyway) mode_ = Mode::running;
}

void Join::activate(const StreamPosition& position) {
  if (mode_ != Mode::standby) return;
  // Frames before the floor are over, whatever the position says.
  mode_ = position.epoch == 0 && epoch_ != 0 && floor_ == 0 ? Mode::resuming : Mode::running;
  if (position.epoch != 0 && adopt(position.epoch)) {
    raise_floor(position.sequence);
    mode_ = Mode::running;
  }
}

void Join::resume_anyway() {
  if (mode_ != Mode::resuming) return;
  mode_ = Mode::anyway;
  find_start();
}

// Without the source's word: the first frame that can be completed, once every port is heard.
void Join::find_start() {
  if (mode_ != Mode::anyway) return;
  if (seen_ports_.size() == ports_) {
    for (const auto& [sequence, slot] : slots_) {
      if (!is_complete(slot)) continue;
      raise_floor(sequence);
      mode_ = Mode::running;
      return;
    }
  } else if (count_ && slots_.empty()) {
    // Nothing more will come: the stream has ended with nothing left for this stage.
    raise_floor(*count_);
    mode_ = Mode::running;
  }
}

void Join::give_up(int replica, bool gone) {
  gone_.at(static_cast<std::size_t>(replica)) = gone;
}

bool Join::is_mine(std::uint64_t sequence) const {
  const auto count = gone_.size();
  std::size_t owner = sequence % count;
  for (std::size_t i = 0; i < count && gone_[owner]; ++i) owner = (owner + 1) % count;
  return owner == static_cast<std::size_t>(options_.replica);
}

std::uint64_t Join::next_sequence() const {
  std::uint64_t next = floor_;
  while ((!count_ || next < *count_) && (released_.contains(next) || !is_mine(next))) ++next;
  return next;
}

bool Join::ready() const {
  if (mode_ != Mode::running) return false;
  const std::uint64_t next = next_sequence();
  if (count_ && next >= *count_) return !ended_;
  const auto slot = slots_.find(next);
  return slot != slots_.end() && is_complete(slot->second);
}

std::size_t Join::waiting() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(slots_, [&](const auto& entry) { return is_mine(entry.first); }));
}

std::optional<Join::Released> Join::take() {
  if (!ready()) return std::nullopt;
  const std::uint64_t next = next_sequence();
  if (count_ && next >= *count_) {
    ended_ = true;
    return Released{.kind = Released::Kind::ended, .header = end_header_};
  }
  auto node = slots_.extract(next);
  Slot& slot = node.mapped();
  released_.insert(next);
  while (released_.erase(floor_) > 0) ++floor_;
  return Released{.kind = slot.failed ? Released::Kind::failed : Released::Kind::frame,
                  .header = std::move(slot.header),
                  .inputs = std::move(slot.inputs),
                  .failed_stage = std::move(slot.stage),
                  .reason = std::move(slot.reason)};
}

}  // namespace cosegraph::graph
