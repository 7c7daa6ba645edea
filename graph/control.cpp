#include "graph/control.hpp"

#include <random>
#include <sstream>

namespace cosegraph::graph {

std::string control_topic(const GraphDescription& graph, std::string_view what) {
  return graph.graph + "/" + std::string(what);
}

int frame_history(const GraphDescription& graph) {
  return 2 * graph.window + 2;
}

std::string process_name(const StageNode& stage, std::uint32_t replica) {
  return stage.replicas.empty() ? stage.name : stage.name + "." + std::to_string(replica);
}

std::string Handover::to_word() const {
  std::ostringstream text;
  text << replica << ' ' << next.epoch << ' ' << next.sequence << ' ' << taken << ' '
       << account.admitted << ' ' << account.labelled << ' ' << account.consumed << ' '
       << account.failed << ' ' << account.dropped;
  return text.str();
}

std::optional<Handover> Handover::from_word(const std::string& word) {
  std::istringstream text(word);
  Handover value;
  text >> value.replica >> value.next.epoch >> value.next.sequence >> value.taken >>
      value.account.admitted >> value.account.labelled >> value.account.consumed >>
      value.account.failed >> value.account.dropped;
  if (!text) return std::nullopt;
  return value;
}

std::uint64_t random_id() {
  std::random_device entropy;
  return (std::uint64_t{entropy()} << 32U) | entropy();
}

}  // namespace cosegraph::graph
