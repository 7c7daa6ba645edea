// Why a stage gets nothing on an input, or makes nothing of it: every link from the writer's
// process to the reader's frames, judged by what is heard of both. Knows no DDS.
#pragma once

#include <string>
#include <vector>

#include "graph/discovery.hpp"
#include "graph/observer.hpp"
#include "graph/traffic.hpp"

namespace cosegraph::graph {

enum class Verdict {
  fine,
  broken,
  unknown  // cannot be judged, mostly because of a link before it
};

struct Link {
  std::string name;  // "process", "participant", "topic", "type", ..., "accepted"
  Verdict verdict = Verdict::unknown;
  std::string text;    // what is the case
  std::string remedy;  // of a broken link
};

struct Question {
  const GraphDescription& graph;
  const StageNode& stage;  // the reader
  const Connection& input;
  bool latched = false;  // the newest value counts, instead of one per frame
  const Domain& domain;
  const Look& look;
  std::vector<ObservedFailure> failures;
  std::chrono::steady_clock::time_point now;
};

// In the order of the way of a message. Links behind a broken one are judged as far as they can be;
// type and policies are links of their own where both sides are there.
std::vector<Link> links_of(const Question& question);

// Null: none.
const Link* first_broken(const std::vector<Link>& links);

}  // namespace cosegraph::graph

template <>
cosegraph::Names<cosegraph::graph::Verdict> cosegraph::names<cosegraph::graph::Verdict>();
