#include "tools/monitor/outbox.hpp"

#include <algorithm>

namespace cosegraph::monitor {

void Outbox::push(std::string text, bool is_binary) {
  bytes_ += text.size();
  kept_bytes_ += text.size();
  items_.push_back({.text = std::move(text), .is_binary = is_binary, .keep = true});
}

void Outbox::push(std::uint32_t subscription, const Message& message) {
  Item item{.head = message_head(subscription, message.time),
            .payload = message.payload,
            .subscription = subscription,
            .keep = message.keep};
  const std::size_t size = item.size();
  if (!item.keep) make_room(size);
  bytes_ += size;
  if (item.keep) kept_bytes_ += size;
  items_.push_back(std::move(item));
}

// What is kept does not count: else a long list of it would leave no room for anything new.
void Outbox::make_room(std::size_t bytes) {
  while (bytes_ - kept_bytes_ + bytes > max_bytes_) {
    const auto oldest = std::ranges::find(items_, false, &Item::keep);
    if (oldest == items_.end()) return;
    ++dropped_[oldest->subscription];
    remove(oldest);
  }
}

std::deque<Outbox::Item>::iterator Outbox::remove(std::deque<Item>::iterator item) {
  bytes_ -= item->size();
  if (item->keep) kept_bytes_ -= item->size();
  return items_.erase(item);
}

std::optional<Outbox::Item> Outbox::pop() {
  if (items_.empty()) return std::nullopt;
  const Item item = items_.front();
  remove(items_.begin());
  return item;
}

void Outbox::forget(std::uint32_t subscription) {
  for (auto item = items_.begin(); item != items_.end();)
    if (item->payload != nullptr && item->subscription == subscription)
      item = remove(item);
    else
      ++item;
}

}  // namespace cosegraph::monitor
