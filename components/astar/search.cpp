#include "astar/search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <queue>
#include <string>

#include "core/error.hpp"
#include "core/values.hpp"

namespace cosegraph::astar {
namespace {

using States = std::vector<std::int32_t>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kSweeps = 40;              // of the reparametrisation
constexpr double kRounding = 1e-10;      // relative: energies closer than this are equal
constexpr std::size_t kMostPerOpen = 8;  // nodes ever made, in multiples of max_open

std::size_t position(const Energy& energy, int i, int j, int xi, int xj) {
  if (i < j) {
    std::swap(i, j);
    std::swap(xi, xj);
  }
  const auto states = static_cast<std::size_t>(energy.states);
  const std::size_t block = pair_index(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
  return (block * states + static_cast<std::size_t>(xi)) * states + static_cast<std::size_t>(xj);
}

void check_values(const std::vector<double>& values, const char* what) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (std::isnan(values[i]) || values[i] == -kInfinity)
      throw InputError(std::string(what) + " term " + std::to_string(i) + " of the energy is " +
                       std::to_string(values[i]));
}

void check(const Energy& energy) {
  if (energy.nodes < 0 || energy.states < 0 || (energy.nodes > 0 && energy.states == 0))
    throw InputError("an energy of " + std::to_string(energy.nodes) + " nodes with " +
                     std::to_string(energy.states) + " states");
  const auto nodes = static_cast<std::size_t>(energy.nodes);
  const auto states = static_cast<std::size_t>(energy.states);
  if (energy.unary.size() != nodes * states)
    throw InputError("the energy has " + std::to_string(energy.unary.size()) +
                     " unary terms where " + std::to_string(nodes * states) + " are needed");
  const std::size_t pairs = nodes * (nodes + 1) / 2 * states * states;
  if (!energy.pairwise.empty() && energy.pairwise.size() != pairs)
    throw InputError("the energy has " + std::to_string(energy.pairwise.size()) +
                     " pairwise terms where " + std::to_string(pairs) + " are needed");
  check_values(energy.unary, "unary");
  check_values(energy.pairwise, "pairwise");
}

// One node's best state given all others.
int best_state(const Energy& energy, const States& state, int node) {
  int best = 0;
  double lowest = kInfinity;
  for (int x = 0; x < energy.states; ++x) {
    double value = energy.unary[static_cast<std::size_t>(node * energy.states + x)];
    for (int other = 0; other < energy.nodes; ++other)
      if (other != node)
        value += energy.pair(node, other, x, state[static_cast<std::size_t>(other)]);
    if (value < lowest) {
      lowest = value;
      best = x;
    }
  }
  return best;
}

// Changes one node at a time as long as the energy falls.
void descend(const Energy& energy, States& state) {
  double value = energy.value(state);
  for (bool improved = true; improved;) {
    improved = false;
    for (int node = 0; node < energy.nodes; ++node) {
      const auto n = static_cast<std::size_t>(node);
      const std::int32_t before = state[n];
      state[n] = best_state(energy, state, node);
      if (state[n] == before) continue;
      if (const double now = energy.value(state); now < value) {
        value = now;
        improved = true;
      } else {
        state[n] = before;
      }
    }
  }
}

States best_unary_states(const Energy& energy) {
  States result;
  const auto states = static_cast<std::ptrdiff_t>(energy.states);
  for (int node = 0; node < energy.nodes; ++node) {
    const auto begin = energy.unary.begin() + node * states;
    result.push_back(static_cast<std::int32_t>(std::min_element(begin, begin + states) - begin));
  }
  return result;
}

// +inf becomes a finite value so large that one such term outweighs all finite ones.
Energy without_infinities(Energy energy) {
  double lowest = 0.0;
  double highest = 0.0;
  for (const auto* values : {&energy.unary, &energy.pairwise})
    for (const double value : *values)
      if (value != kInfinity) {
        lowest = std::min(lowest, value);
        highest = std::max(highest, value);
      }
  const double terms = 0.5 * energy.nodes * (energy.nodes + 1.0);
  const double forbidden = (highest - lowest) * terms + highest + 1.0;
  std::ranges::replace(energy.unary, kInfinity, forbidden);
  std::ranges::replace(energy.pairwise, kInfinity, forbidden);
  return energy;
}

// The same function of the states in other terms: sweep by sweep, every edge takes up the unary
// terms of its two nodes and gives half of its lowest value per state back to each (max-product
// linear programming; Globerson, Jaakkola, NIPS 2007). The sum of all terms' minima, a lower bound
// of the energy, never falls; unary terms end up telling what the pairwise ones imply, and the
// star's bound, which ignores most pairs of free nodes, becomes nearly tight.
Energy reparametrised(Energy energy) {
  const auto states = static_cast<std::size_t>(energy.states);
  std::vector<double> of_first(states), of_second(states);
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (int i = 0; i < energy.nodes; ++i)
      for (int j = 0; j < i; ++j) {
        double* first = &energy.unary[static_cast<std::size_t>(i) * states];
        double* second = &energy.unary[static_cast<std::size_t>(j) * states];
        double* pair = &energy.pair(i, j, 0, 0);
        std::ranges::fill(of_first, kInfinity);
        std::ranges::fill(of_second, kInfinity);
        for (std::size_t x = 0; x < states; ++x)
          for (std::size_t y = 0; y < states; ++y) {
            const double sum = pair[x * states + y] += first[x] + second[y];
            of_first[x] = std::min(of_first[x], sum);
            of_second[y] = std::min(of_second[y], sum);
          }
        for (std::size_t x = 0; x < states; ++x) {
          first[x] = 0.5 * of_first[x];
          second[x] = 0.5 * of_second[x];
        }
        for (std::size_t x = 0; x < states; ++x)
          for (std::size_t y = 0; y < states; ++y) pair[x * states + y] -= first[x] + second[y];
      }
  return energy;
}

// Certain nodes first: those whose best two states differ most, so that the search tree is narrow
// at its top and the least certain node is the root of the heuristic's star. Ties by number.
std::vector<int> search_order(const Energy& energy) {
  std::vector<double> certainty;
  for (int node = 0; node < energy.nodes; ++node) {
    double best = kInfinity;
    double second = kInfinity;
    for (int x = 0; x < energy.states; ++x) {
      const double value = energy.unary[static_cast<std::size_t>(node * energy.states + x)];
      second = std::min(second, std::max(best, value));
      best = std::min(best, value);
    }
    certainty.push_back(second - best);
  }
  std::vector<int> order(static_cast<std::size_t>(energy.nodes));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, [&](int a, int b) {
    return certainty[static_cast<std::size_t>(a)] > certainty[static_cast<std::size_t>(b)];
  });
  return order;
}

// The energy with its nodes in search order, laid out for the inner loops. The last node is the
// root of the heuristic's star.
class Tables {
 public:
  Tables(const Energy& energy, const std::vector<int>& order);

  std::size_t nodes, states;
  std::vector<double> unary;  // nodes x states
  // Of node i in state x: its pairwise terms with all states of nodes i + 1 .. root.
  const double* with_later(std::size_t i, std::size_t x) const {
    return &with_later_[(i * states + x) * nodes * states];
  }
  // Of node j < root: [x_j][x_root].
  const double* with_root(std::size_t j) const { return &with_root_[j * states * states]; }
  // Of node j < root: sum over nodes i, j < i < root, of min over x_i of the pairwise term, per
  // x_j. It bounds the pairs of free nodes that are not in the star.
  const double* beside_star(std::size_t j) const { return &beside_star_[j * states]; }

 private:
  std::vector<double> with_later_, with_root_, beside_star_;
};

Tables::Tables(const Energy& energy, const std::vector<int>& order)
    : nodes(order.size()),
      states(static_cast<std::size_t>(energy.states)),
      with_later_(nodes * nodes * states * states, 0.0),
      with_root_(nodes * states * states, 0.0),
      beside_star_(nodes * states, 0.0) {
  const auto at = [](std::size_t x) { return static_cast<int>(x); };
  for (const int node : order)
    for (std::size_t x = 0; x < states; ++x)
      unary.push_back(energy.unary[static_cast<std::size_t>(node) * states + x]);
  const std::size_t root = nodes - 1;
  for (std::size_t i = 0; i < nodes; ++i)
    for (std::size_t x = 0; x < states; ++x) {
      double* row = &with_later_[(i * states + x) * nodes * states];
      for (std::size_t j = i + 1; j < nodes; ++j, row += states) {
        for (std::size_t y = 0; y < states; ++y)
          row[y] = energy.pair(order[i], order[j], at(x), at(y));
        if (j < root)
          beside_star_[i * states + x] += *std::min_element(row, row + states);
        else
          std::copy(row, row + states, &with_root_[(i * states + x) * states]);
      }
    }
}

class Search {
 public:
  // `same` is a reparametrisation of `energy`.
  Search(const Energy& energy, const Energy& same, std::int64_t max_open)
      : energy_(energy),
        order_(search_order(same)),
        tables_(same, order_),
        max_open_(static_cast<std::size_t>(std::clamp<std::int64_t>(max_open, 1, 1 << 30))),
        sums_(tables_.unary.size()),
        child_(tables_.unary.size()),
        over_root_(tables_.states),
        lowest_(tables_.states) {}
  Solution run(States start);

 private:
  // A partial labelling: the states of the first nodes in order, as a path in pool_.
  struct Partial {
    std::int32_t parent;
    std::int32_t state;  // of the path's last node
  };
  struct Open {
    double f;
    std::int32_t depth;    // nodes fixed
    std::int32_t partial;  // end of the path; kNoPoint for depth 0
    // Greatest first in the queue: lowest f, then deepest, then oldest.
    bool operator<(const Open& other) const {
      if (f != other.f) return f > other.f;
      if (depth != other.depth) return depth < other.depth;
      return partial > other.partial;
    }
  };

  std::size_t fix(const Open& open);
  void fix_next(std::size_t depth, std::size_t x);
  double lower_bound(std::size_t depth, std::size_t x);
  void push_children(const Open& open);
  States complete(const Open& open);
  bool is_goal(const Open& open) const {
    return static_cast<std::size_t>(open.depth) + 1 == tables_.nodes;
  }
  void offer(States state);

  const Energy& energy_;
  const std::vector<int> order_;
  const Tables tables_;
  const std::size_t max_open_;
  std::vector<Partial> pool_;
  std::priority_queue<Open> open_;
  Solution best_;              // so far
  double enough_ = kInfinity;  // nodes that promise no less are not opened
  // Of the node being expanded: g, the states, and m_j(x_j) of every free node j.
  double cost_ = 0.0;
  States state_;
  std::vector<double> sums_;
  std::vector<double> child_, over_root_, lowest_;  // scratch of lower_bound()
};

// Makes `open` the node being expanded; returns its depth.
std::size_t Search::fix(const Open& open) {
  const auto depth = static_cast<std::size_t>(open.depth);
  state_.assign(depth, 0);
  std::int32_t at = open.partial;
  for (std::size_t i = depth; i-- > 0; at = pool_[static_cast<std::size_t>(at)].parent)
    state_[i] = pool_[static_cast<std::size_t>(at)].state;
  const States path = std::move(state_);
  state_.clear();
  cost_ = 0.0;
  sums_ = tables_.unary;
  for (std::size_t i = 0; i < depth; ++i) fix_next(i, static_cast<std::size_t>(path[i]));
  return depth;
}

// Fixes node `depth`, the first free one, in state `x`.
void Search::fix_next(std::size_t depth, std::size_t x) {
  const std::size_t begin = (depth + 1) * tables_.states;
  const double* row = tables_.with_later(depth, x);
  cost_ += sums_[depth * tables_.states + x];
  for (std::size_t k = begin; k < sums_.size(); ++k) sums_[k] += row[k - begin];
  state_.push_back(static_cast<std::int32_t>(x));
}

// f of the child that has node `depth` in state `x`; exact where only the root is left free.
double Search::lower_bound(std::size_t depth, std::size_t x) {
  const std::size_t states = tables_.states;
  const std::size_t root = tables_.nodes - 1;
  const std::size_t begin = (depth + 1) * states;
  const double* row = tables_.with_later(depth, x);
  for (std::size_t k = begin; k < sums_.size(); ++k) child_[k] = sums_[k] + row[k - begin];
  std::copy_n(&child_[root * states], states, over_root_.begin());
  for (std::size_t j = depth + 1; j < root; ++j) {
    const double* pair = tables_.with_root(j);
    const double* beside = tables_.beside_star(j);
    std::ranges::fill(lowest_, kInfinity);
    for (std::size_t y = 0; y < states; ++y, pair += states) {
      const double sum = child_[j * states + y] + beside[y];
      for (std::size_t r = 0; r < states; ++r)
        lowest_[r] = sum + pair[r] < lowest_[r] ? sum + pair[r] : lowest_[r];
    }
    for (std::size_t r = 0; r < states; ++r) over_root_[r] += lowest_[r];
  }
  return cost_ + sums_[depth * states + x] + *std::ranges::min_element(over_root_);
}

void Search::push_children(const Open& open) {
  const std::size_t depth = fix(open);
  for (std::size_t x = 0; x < tables_.states; ++x) {
    const double f = lower_bound(depth, x);
    if (f >= enough_) continue;
    pool_.push_back({open.partial, static_cast<std::int32_t>(x)});
    open_.push({f, open.depth + 1, static_cast<std::int32_t>(pool_.size()) - 1});
  }
}

// The states of all nodes, in the energy's order: those of `open`, then greedily by lower bound.
States Search::complete(const Open& open) {
  std::size_t depth = fix(open);
  for (; depth + 1 < tables_.nodes; ++depth) {
    std::size_t best = 0;
    double lowest = kInfinity;
    for (std::size_t x = 0; x < tables_.states; ++x)
      if (const double f = lower_bound(depth, x); f < lowest) {
        lowest = f;
        best = x;
      }
    fix_next(depth, best);
  }
  const double* root = &sums_[depth * tables_.states];
  state_.push_back(static_cast<std::int32_t>(std::min_element(root, root + tables_.states) - root));
  States result(order_.size());
  for (std::size_t i = 0; i < order_.size(); ++i)
    result[static_cast<std::size_t>(order_[i])] = state_[i];
  return result;
}

void Search::offer(States state) {
  if (const double value = energy_.value(state); best_.state.empty() || value < best_.energy) {
    best_.state = std::move(state);
    best_.energy = value;
    enough_ = value - kRounding * (1.0 + std::abs(value));
  }
}

Solution Search::run(States start) {
  descend(energy_, start);
  offer(std::move(start));
  open_.push({-kInfinity, 0, kNoPoint});
  best_.proven_optimal = true;
  while (!open_.empty()) {
    const Open open = open_.top();
    if (open_.size() > max_open_ || pool_.size() / kMostPerOpen > max_open_) {
      offer(complete(open));
      best_.gap = std::max(0.0, best_.energy - open.f);
      best_.proven_optimal = best_.gap == 0.0;
      break;
    }
    open_.pop();
    ++best_.expansions;
    if (is_goal(open)) {
      offer(complete(open));
      break;
    }
    push_children(open);
  }
  return best_;
}

}  // namespace

double& Energy::pair(int i, int j, int xi, int xj) {
  return pairwise[position(*this, i, j, xi, xj)];
}

double Energy::pair(int i, int j, int xi, int xj) const {
  return pairwise.empty() ? 0.0 : pairwise[position(*this, i, j, xi, xj)];
}

double Energy::value(const std::vector<std::int32_t>& state) const {
  double sum = 0.0;
  for (int i = 0; i < nodes; ++i) {
    const std::int32_t xi = state[static_cast<std::size_t>(i)];
    sum += unary[static_cast<std::size_t>(i * states + xi)];
    for (int j = 0; j < i; ++j) sum += pair(i, j, xi, state[static_cast<std::size_t>(j)]);
  }
  return sum;
}

Solution minimise(const Energy& energy, std::int64_t max_open) {
  check(energy);
  if (energy.nodes == 0) return {.proven_optimal = true};
  if (energy.pairwise.empty()) {
    Solution solution{.state = best_unary_states(energy), .proven_optimal = true};
    solution.energy = energy.value(solution.state);
    return solution;
  }
  const Energy same = reparametrised(without_infinities(energy));
  return Search(energy, same, max_open).run(best_unary_states(same));
}

}  // namespace cosegraph::astar
