// What a stage's process leaves for the one that is started after it: a small file, mapped into
// memory, that survives kill -9 (not the loss of the machine).
//
// A record is written whole or not at all: there are two places in the file, each written with a
// counter before and after, and the newer complete one counts.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "idl/codec.hpp"

namespace cosegraph::graph {

struct JournalRecord {
  static constexpr std::size_t kMaxOpen = 64;  // the largest window of a graph file

  std::uint32_t generation = 0;
  // The frame in work, and how many processes of the stage have died over it.
  bool working = false;
  std::uint64_t epoch = 0;
  std::uint64_t sequence = 0;
  std::uint32_t deaths = 0;
  // Of a source: frames taken from its input, the account of all epochs, and the frames of
  // `epoch` that were not over.
  std::uint64_t taken = 0;
  idl::Account account;
  std::uint32_t open_count = 0;
  std::array<std::uint64_t, kMaxOpen> open{};
};

class Journal {
 public:
  // Opens or makes the file. Throws InputError naming it.
  explicit Journal(const std::filesystem::path& file);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  // The newest record; none in a new or damaged file.
  std::optional<JournalRecord> load() const;
  void store(const JournalRecord& record);

 private:
  struct Place;
  struct Layout;
  const Place* newest() const;
  Layout* layout_ = nullptr;
};

}  // namespace cosegraph::graph
