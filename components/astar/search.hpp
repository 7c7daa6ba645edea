// Exact minimum of a small fully connected pairwise energy by A* (Bergtholdt, Kappes, Schmidt,
// Schnoerr, IJCV 2010): nodes in order, star-shaped tree on the last node as admissible heuristic.
// Ours: the energy is first reparametrised by a linear-programming relaxation, which leaves its
// values as they are and makes the heuristic nearly tight; and nodes that promise no less than a
// solution found by coordinate descent are not opened.
#pragma once

#include <cstdint>
#include <vector>

namespace cosegraph::astar {

// sum_i unary_i(x_i) + sum_{i<j} pairwise_ij(x_i, x_j), n nodes with L states each.
struct Energy {
  int nodes = 0;
  int states = 0;
  std::vector<double> unary;     // nodes x states
  std::vector<double> pairwise;  // [pair_index(i, j)][x_i][x_j] for i > j (i the larger node);
                                 // empty: no pairwise terms; blocks (i, i) are not used

  double& pair(int i, int j, int xi, int xj);  // i != j, in either order
  double pair(int i, int j, int xi, int xj) const;
  double value(const std::vector<std::int32_t>& state) const;
};

struct Solution {
  std::vector<std::int32_t> state;
  double energy = 0.0;
  bool proven_optimal = false;
  double gap = 0.0;             // upper bound on energy - minimum
  std::int64_t expansions = 0;  // nodes taken from the heap
};

// When the heap would hold more than `max_open` nodes, or eight times as many have been made, the
// search stops: the answer is then the best of the most promising node completed greedily and the
// nodes' best unary states (after the reparametrisation) improved by coordinate descent, and `gap`
// is its energy minus the lowest f on the heap. 0 nodes: an empty, optimal solution. "Optimal" is
// up to rounding: 1e-10 of the energy. Values may be +inf (forbidden): the energy is +inf if
// nothing else is left. Throws InputError on sizes that do not fit or values that are NaN or -inf.
Solution minimise(const Energy& energy, std::int64_t max_open);

}  // namespace cosegraph::astar
