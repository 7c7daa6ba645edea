#include "graph/journal.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>

namespace cosegraph::graph {
namespace {

constexpr std::uint64_t kMagic = 0x3130'4a47'4553'4f43ULL;  // "COSEGJ01"

}  // namespace

struct Journal::Place {
  std::atomic<std::uint64_t> before;
  JournalRecord record;
  std::atomic<std::uint64_t> after;
};

struct Journal::Layout {
  std::uint64_t magic;
  Place places[2];
};

Journal::Journal(const std::filesystem::path& file) {
  const auto fail = [&] { throw InputError(file.string() + ": " + std::strerror(errno)); };
  const int fd = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) fail();
  void* memory = MAP_FAILED;
  // Space is taken now: a full disk would otherwise be met as a signal at the first write.
  const int error = ::posix_fallocate(fd, 0, sizeof(Layout));
  if (error == 0)
    memory = ::mmap(nullptr, sizeof(Layout), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  ::close(fd);
  if (error != 0) errno = error;
  if (memory == MAP_FAILED) fail();
  layout_ = static_cast<Layout*>(memory);
  if (layout_->magic != kMagic) {
    std::memset(memory, 0, sizeof(Layout));
    layout_->magic = kMagic;
  }
}

Journal::~Journal() {
  ::munmap(layout_, sizeof(Layout));
}

const Journal::Place* Journal::newest() const {
  const Place* best = nullptr;
  for (const auto& place : layout_->places) {
    const std::uint64_t count = place.after.load();
    if (count == 0 || place.before.load() != count) continue;
    if (best == nullptr || count > best->after.load()) best = &place;
  }
  return best;
}

std::optional<JournalRecord> Journal::load() const {
  const Place* place = newest();
  if (place == nullptr || place->record.open_count > JournalRecord::kMaxOpen) return std::nullopt;
  return place->record;
}

void Journal::store(const JournalRecord& record) {
  const Place* current = newest();
  const std::uint64_t count = current == nullptr ? 1 : current->after.load() + 1;
  Place& place = layout_->places[current == &layout_->places[0] ? 1 : 0];
  place.before.store(count);
  std::atomic_thread_fence(std::memory_order_seq_cst);
  place.record = record;
  std::atomic_thread_fence(std::memory_order_seq_cst);
  place.after.store(count);
}

}  // namespace cosegraph::graph
