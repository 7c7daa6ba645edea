// Random graphs of one source and stages that join up to three others.
#pragma once

#include <string>
#include <vector>

#include "core/random.hpp"
#include "graph_description/fake_catalog.hpp"

namespace cosegraph::graph::test {

// "start" gives clouds; "join1" .. "join3" take one to three, and another by way of `back`.
inline Catalog join_catalog() {
  Catalog catalog;
  const PortInfo cloud = framed("cloud", "Cloud");
  catalog["start"] = [=] { return fake_kind("start", {}, {cloud}, {}); };
  for (int count = 1; count <= 3; ++count) {
    std::vector<PortInfo> inputs = {optional(framed("back", "Cloud"))};
    for (int i = 0; i < count; ++i) inputs.push_back(framed("in" + std::to_string(i), "Cloud"));
    const std::string kind = "join" + std::to_string(count);
    catalog[kind] = [=] { return fake_kind(kind, inputs, {cloud}, {}); };
  }
  return catalog;
}

// Stage "s0" is the source; every other takes from stages with smaller numbers. Their order in the
// graph is random.
inline GraphDescription random_acyclic_graph(std::size_t count, Random& random) {
  GraphDescription graph{.file = "random.yaml", .graph = "random"};
  graph.stages.push_back({.name = "s0", .use = "start"});
  for (std::size_t i = 1; i < count; ++i) {
    const std::size_t inputs = 1 + random.below(3);
    StageNode stage{.name = "s" + std::to_string(i), .use = "join" + std::to_string(inputs)};
    for (std::size_t k = 0; k < inputs; ++k)
      stage.inputs.push_back({.port = "in" + std::to_string(k),
                              .from_stage = "s" + std::to_string(random.below(i)),
                              .from_port = "cloud"});
    graph.stages.push_back(stage);
  }
  random.shuffle(std::span(graph.stages));
  return graph;
}

inline std::size_t number_of(const std::string& stage) {
  return std::stoul(stage.substr(1));
}

// reach[i][j]: something of stage i comes to stage j (Warshall).
inline std::vector<std::vector<bool>> reachability(const GraphDescription& graph) {
  const std::size_t count = graph.stages.size();
  std::vector<std::vector<bool>> reach(count, std::vector<bool>(count, false));
  for (const auto& stage : graph.stages)
    for (const auto& input : stage.inputs)
      reach[number_of(input.from_stage)][number_of(stage.name)] = true;
  for (std::size_t k = 0; k < count; ++k)
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j < count; ++j)
        if (reach[i][k] && reach[k][j]) reach[i][j] = true;
  return reach;
}

}  // namespace cosegraph::graph::test
