#include "tools/evaluation/block.hpp"

#include <nlohmann/json.hpp>

namespace cosegraph::evaluation {

// Numbers survive JSON to the last bit: nlohmann writes the shortest text that reads the same.
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Problem, where, what)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Figures, accuracy, missing, false_alarm, rand, gce, lce)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(CategoryCounts, name, label_names, compatible, incompatible)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Pair, reference, query, view, figures, majority_floor, oracle,
                                   expansions, proven_optimal, segment_label, ms)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(QueryResult, pairs, confusion, problems)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Block, counts, problems, results, complete)

Block read_block(const std::string& key, const Store& store) {
  const auto record = store.read(key);
  return record ? nlohmann::json::parse(record->at(0)).get<Block>() : Block{};
}

void write_block(const std::string& key, const Block& block, Store& store) {
  store.write(key, std::vector{nlohmann::json(block).dump()});
}

}  // namespace cosegraph::evaluation
