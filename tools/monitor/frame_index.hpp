// The frames of what never changes (a recording, files), and the parts in which a client can have
// them. A plain data structure.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "idl/codec.hpp"

namespace cosegraph::monitor {

class FrameIndex {
 public:
  static constexpr std::size_t kPartFrames = 40;
  static constexpr std::size_t kPartBytes = 64U << 20U;  // a larger frame is a part of its own

  struct Frame {
    std::uint64_t epoch = 0;
    std::uint64_t sequence = 0;
    std::string name;
    std::uint64_t begin = 0;  // ns since 1970, of its first and last message; 0: nobody knows
    std::uint64_t end = 0;
    std::size_t bytes = 0;  // of all its messages
  };
  // Frames `from` to before `to`.
  struct Range {
    std::size_t from = 0;
    std::size_t to = 0;

    bool contains(std::size_t number) const { return from <= number && number < to; }
    bool operator==(const Range&) const = default;
  };

  // Takes note of a message. Returns its frame's number: they are counted from 0 in the order in
  // which they began.
  std::size_t add(const idl::FrameHeader& header, std::uint64_t time, std::size_t bytes);

  std::size_t size() const { return frames_.size(); }
  const Frame& operator[](std::size_t number) const { return frames_[number]; }
  std::optional<std::size_t> number_of(const idl::FrameHeader& header) const;

  // As many frames from number `from` on as these bounds allow, and at least one if there is one.
  Range range(std::size_t from, std::size_t max_frames, std::size_t max_bytes) const;
  // All frames, each in one part.
  std::vector<Range> parts() const;

 private:
  std::vector<Frame> frames_;
  std::map<std::pair<std::uint64_t, std::uint64_t>, std::size_t> number_;  // by epoch and sequence
};

// The fields "frames", "parts" (their first frames) and "first" (to be shown first) of the state;
// see docs/monitor.md.
void describe_frames(nlohmann::ordered_json& state, const FrameIndex& frames, std::size_t first);

}  // namespace cosegraph::monitor
