// Between plain values and the bytes of a topic: CDR (XCDR1) of the types in coseg_*.idl.
//
// Nothing here knows DDS; what is encoded can be sent, recorded or compared. Decoding checks that
// arrays fit together, so that a hostile or damaged sample becomes an InputError and never an
// out-of-bounds access in an algorithm.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/names.hpp"
#include "core/values.hpp"

namespace cosegraph::idl {

using Bytes = std::vector<std::uint8_t>;

// Identity of a frame and of who wrote the message; see coseg_frame.idl.
struct FrameHeader {
  std::string graph;
  std::string stage;
  std::uint32_t generation = 0;
  std::string source;
  std::uint64_t epoch = 0;
  std::uint64_t sequence = 0;
  std::int64_t stamp = 0;
  std::uint64_t model_id = 0;
  std::string name;
};

struct StreamEnd {
  std::uint64_t count = 0;
};

struct FrameFailure {
  std::string reason;
};

enum class Outcome { labelled, consumed, failed, ended };

struct FrameDone {
  Outcome outcome = Outcome::labelled;
  std::string failed_stage;
  std::string reason;
};

enum class State { starting, waiting, working, finished, failed, stopped };

struct Account {
  std::uint64_t admitted = 0;
  std::uint64_t labelled = 0;
  std::uint64_t consumed = 0;
  std::uint64_t failed = 0;
  std::uint64_t dropped = 0;
};

struct StageStatus {
  std::string kind;
  std::string host;
  std::uint32_t pid = 0;
  State state = State::starting;
  std::string activity;
  double progress = -1.0;
  std::uint64_t frames_in = 0;
  std::uint64_t frames_out = 0;
  std::uint64_t frames_failed = 0;
  double latency_median = 0.0;
  double latency_p99 = 0.0;
  double latency_sum = 0.0;
  double cpu_seconds = 0.0;
  std::uint64_t memory = 0;
  Account account;
};

// "Cloud", "Supervoxels", ...: the name in graph files. On the wire it is wire_type(name).
template <class Value>
std::string_view type_name();

// "cosegraph::msg::" + name.
std::string wire_type(std::string_view name);

// Every type that can travel, control messages last.
std::span<const std::string_view> type_names();

template <class Value>
Bytes encode(const FrameHeader& header, const Value& value);

// Throws InputError naming the type and what does not fit.
template <class Value>
Value decode(std::span<const std::uint8_t> bytes);

// The header that every message begins with.
FrameHeader decode_header(std::span<const std::uint8_t> bytes);

}  // namespace cosegraph::idl

template <>
cosegraph::Names<cosegraph::idl::Outcome> cosegraph::names<cosegraph::idl::Outcome>();
template <>
cosegraph::Names<cosegraph::idl::State> cosegraph::names<cosegraph::idl::State>();
