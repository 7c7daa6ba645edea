// What one configuration did in one category with one seed: the unit that is kept on disk. Internal
// to evaluation.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "tools/evaluation/evaluation.hpp"
#include "tools/evaluation/store.hpp"

namespace cosegraph::evaluation {

// Of one query view, with all references that it is compatible with.
struct QueryResult {
  std::vector<Pair> pairs;  // `configuration`, `category` and `seed` are not kept
  std::vector<double> confusion;
  std::vector<Problem> problems;
};

struct Block {
  CategoryCounts counts;
  std::vector<Problem> problems;                      // of shapes, views and references
  std::map<std::array<int, 2>, QueryResult> results;  // of finished queries, by (shape, view)
  bool complete = false;
};

// The block under `key`; an empty one if the store has none.
Block read_block(const std::string& key, const Store& store);
void write_block(const std::string& key, const Block& block, Store& store);

}  // namespace cosegraph::evaluation
