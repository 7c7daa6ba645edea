// The topics of a graph that carry no frames, and the orders that travel on them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "graph/dds.hpp"
#include "graph/description.hpp"
#include "graph/join.hpp"
#include "idl/codec.hpp"

namespace cosegraph::graph {

// "GRAPH/frame_done" and so on.
std::string control_topic(const GraphDescription& graph, std::string_view what);

// History of who reads a topic on which many write about themselves, over and over.
constexpr int kStatusDepth = 64;

// Of such a reader, if what gets lost need not be sent again. A single one that wants that makes
// the writers ask all their readers, over and over, what has arrived.
constexpr EndpointQos kOverheard{.depth = kStatusDepth, .keep_for_late = false, .reliable = false};

// Messages of frames that their writers keep, for who is slow or comes late.
int frame_history(const GraphDescription& graph);

// How one process of a stage is called: "cpc", of several replicas "cpc.0", "cpc.1", ...
std::string process_name(const StageNode& stage, std::uint32_t replica);

// Orders to a stage (Command::verb). `generation` is always that of the newcomer in a swap; its
// predecessors may be of any before, since a process that is started again counts up.
namespace verb {
// To the predecessors: finish the frame in work, then hold; go on after that.
constexpr std::string_view kDrain = "drain";
constexpr std::string_view kRelease = "release";
// To the newcomer: end of standby; words: a Handover per replica.
constexpr std::string_view kActivate = "activate";

// All other orders are for agents.
constexpr bool is_for_stage(std::string_view verb) {
  return verb == kDrain || verb == kRelease || verb == kActivate;
}
}  // namespace verb

// What one process of a stage leaves to the one that takes its place.
struct Handover {
  std::uint32_t replica = 0;
  StreamPosition next;      // the first frame that it has not done
  std::uint64_t taken = 0;  // sources: frames taken from the input
  idl::Account account;     // sources

  std::string to_word() const;
  static std::optional<Handover> from_word(const std::string& word);
};

// A name for a request that nobody else has.
std::uint64_t random_id();

}  // namespace cosegraph::graph
