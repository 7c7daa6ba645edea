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

// standby: started beside the one it is to replace, takes nothing from its inputs yet. drained: has
// given its place up and works on nothing. restarting: its process died and will be started again.
enum class State {
  starting,
  standby,
  waiting,
  working,
  drained,
  finished,
  restarting,
  failed,
  stopped
};

struct Account {
  std::uint64_t admitted = 0;
  std::uint64_t labelled = 0;
  std::uint64_t consumed = 0;
  std::uint64_t failed = 0;
  std::uint64_t dropped = 0;
};

// Of one port since the stage's process began.
struct PortTraffic {
  std::string name;
  std::string topic;
  bool output = false;
  std::uint64_t messages = 0;
  std::uint64_t bytes = 0;
};

// See coseg_frame.idl.
struct StageStatus {
  std::string kind;
  std::string host;
  std::uint32_t pid = 0;
  std::uint32_t replica = 0;
  bool candidate = false;
  State state = State::starting;
  std::string activity;
  std::string recipe;
  double progress = -1.0;
  std::uint64_t frames_in = 0;
  std::uint64_t frames_out = 0;
  std::uint64_t frames_failed = 0;
  std::uint64_t repeated = 0;
  std::uint64_t queue = 0;
  std::uint64_t next = 0;
  double latency_median = 0.0;
  double latency_p99 = 0.0;
  double latency_sum = 0.0;
  double cpu_seconds = 0.0;
  std::uint64_t memory = 0;
  Account account;
  std::uint64_t settled = 0;
  std::vector<PortTraffic> ports;
};

// Control messages; see coseg_control.idl.
struct Command {
  std::uint64_t id = 0;
  std::string host;
  std::string stage;
  std::uint32_t generation = 0;
  std::string verb;
  std::vector<std::string> words;
};

enum class ReplyState { accepted, progress, done, refused };

struct Reply {
  std::uint64_t id = 0;
  std::string host;
  ReplyState state = ReplyState::done;
  std::string text;
};

enum class ProcessState { running, restarting, stopped, failed };

struct AgentProcess {
  std::string stage;
  std::uint32_t replica = 0;
  std::uint32_t generation = 0;
  std::uint32_t pid = 0;
  bool candidate = false;
  ProcessState state = ProcessState::stopped;
  std::uint32_t restarts = 0;
  std::string text;
};

struct AgentStatus {
  std::string host;
  std::string address;
  std::uint32_t pid = 0;
  std::vector<AgentProcess> processes;
  std::string swapping;        // the stage whose swap it leads; empty: none
  std::uint32_t newcomer = 0;  // generation in that swap
};

struct LogLines {
  std::string host;
  std::string stage;
  std::uint32_t replica = 0;
  std::vector<std::string> lines;
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

// Throws as decode does for the type of that name, or InputError if there is none.
void check(std::string_view type, std::span<const std::uint8_t> bytes);

// The header that every message begins with.
FrameHeader decode_header(std::span<const std::uint8_t> bytes);

// Writes another epoch into a message, where the old one stands. Throws InputError as
// decode_header.
void set_epoch(std::span<std::uint8_t> bytes, std::uint64_t epoch);

}  // namespace cosegraph::idl

template <>
cosegraph::Names<cosegraph::idl::Outcome> cosegraph::names<cosegraph::idl::Outcome>();
template <>
cosegraph::Names<cosegraph::idl::State> cosegraph::names<cosegraph::idl::State>();
template <>
cosegraph::Names<cosegraph::idl::ReplyState> cosegraph::names<cosegraph::idl::ReplyState>();
template <>
cosegraph::Names<cosegraph::idl::ProcessState> cosegraph::names<cosegraph::idl::ProcessState>();
