#include "descriptors/place.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <queue>
#include <utility>

#include "core/nearest.hpp"

namespace cosegraph::descriptors {
namespace {

constexpr std::size_t kNeighbours = 8;
constexpr std::size_t kSources = 30;
constexpr std::size_t kSmallPiece = 32;

using Indices = std::vector<std::int32_t>;

struct Edge {
  std::int32_t to;
  double length;
};
using Graph = std::vector<std::vector<Edge>>;

struct Bridge {
  std::int32_t from;
  std::int32_t to;
  float squared_length;
};

void connect(Graph& graph, std::int32_t a, std::int32_t b, float squared_length) {
  const double length = std::sqrt(static_cast<double>(squared_length));
  graph[a].push_back({b, length});
  graph[b].push_back({a, length});
}

Graph neighbour_graph(std::span<const float> xyz, const NearestNeighbours& tree) {
  Graph graph(xyz.size() / 3);
  for (std::size_t i = 0; i < graph.size(); ++i)
    for (const auto& near : tree.nearest(&xyz[3 * i], kNeighbours + 1))
      if (near.index != static_cast<std::int32_t>(i))
        connect(graph, static_cast<std::int32_t>(i), near.index, near.squared_distance);
  return graph;
}

// The points of each connected piece, ascending.
std::vector<Indices> pieces_of(const Graph& graph) {
  std::vector<Indices> pieces;
  std::vector<char> seen(graph.size(), 0);
  for (std::size_t start = 0; start < graph.size(); ++start) {
    if (seen[start]) continue;
    Indices piece{static_cast<std::int32_t>(start)};
    seen[start] = 1;
    for (std::size_t next = 0; next < piece.size(); ++next)
      for (const Edge& edge : graph[piece[next]])
        if (!std::exchange(seen[edge.to], 1)) piece.push_back(edge.to);
    std::ranges::sort(piece);
    pieces.push_back(std::move(piece));
  }
  return pieces;
}

// Finds for points of one piece the nearest point of any other.
class Outside {
 public:
  Outside(std::span<const float> xyz, const NearestNeighbours& tree, const Indices& piece)
      : xyz_(xyz), tree_(tree), inside_(xyz.size() / 3, 0), piece_size_(piece.size()) {
    for (const std::int32_t i : piece) inside_[i] = 1;
    if (piece_size_ <= kSmallPiece) return;
    std::vector<float> others;
    for (std::size_t i = 0; i < inside_.size(); ++i) {
      if (inside_[i]) continue;
      others.insert(others.end(), &xyz[3 * i], &xyz[3 * i] + 3);
      other_.push_back(static_cast<std::int32_t>(i));
    }
    others_.emplace(others);
  }

  Bridge shortest_from(std::int32_t point) const {
    const float* query = &xyz_[3 * static_cast<std::size_t>(point)];
    if (others_) {
      const auto near = others_->nearest(query, 1).front();
      return {point, other_[near.index], near.squared_distance};
    }
    // Of so many nearest points at least one is outside.
    const auto nearest = tree_.nearest(query, piece_size_ + 1);
    const auto near = *std::ranges::find_if(
        nearest, [this](const auto& neighbour) { return !inside_[neighbour.index]; });
    return {point, near.index, near.squared_distance};
  }

 private:
  std::span<const float> xyz_;
  const NearestNeighbours& tree_;
  std::vector<char> inside_;
  std::size_t piece_size_;
  Indices other_;
  std::optional<NearestNeighbours> others_;  // large pieces only
};

Bridge shortest_bridge(std::span<const float> xyz, const NearestNeighbours& tree,
                       const Indices& piece) {
  const Outside outside(xyz, tree, piece);
  Bridge shortest = outside.shortest_from(piece.front());
  for (const std::int32_t point : piece) {
    const Bridge bridge = outside.shortest_from(point);
    if (bridge.squared_length < shortest.squared_length) shortest = bridge;
  }
  return shortest;
}

// Boruvka's rounds: every piece but the largest is joined to the piece nearest to it.
void join_pieces(Graph& graph, std::span<const float> xyz, const NearestNeighbours& tree) {
  for (auto pieces = pieces_of(graph); pieces.size() > 1; pieces = pieces_of(graph)) {
    const auto largest = std::ranges::max_element(pieces, {}, &Indices::size);
    std::vector<Bridge> bridges;
    for (auto piece = pieces.begin(); piece != pieces.end(); ++piece)
      if (piece != largest) bridges.push_back(shortest_bridge(xyz, tree, *piece));
    for (const Bridge& bridge : bridges)
      connect(graph, bridge.from, bridge.to, bridge.squared_length);
  }
}

// Dijkstra.
std::vector<double> path_lengths(const Graph& graph, std::int32_t source) {
  using Front = std::pair<double, std::int32_t>;
  std::vector<double> length(graph.size(), std::numeric_limits<double>::infinity());
  std::priority_queue<Front, std::vector<Front>, std::greater<>> front;
  length[source] = 0.0;
  front.emplace(0.0, source);
  while (!front.empty()) {
    const auto [reached, point] = front.top();
    front.pop();
    if (reached > length[point]) continue;
    for (const Edge& edge : graph[point]) {
      const double through = reached + edge.length;
      if (through >= length[edge.to]) continue;
      length[edge.to] = through;
      front.emplace(through, edge.to);
    }
  }
  return length;
}

std::int32_t largest_of(const std::vector<double>& values) {
  return static_cast<std::int32_t>(std::ranges::max_element(values) - values.begin());
}

// Path lengths from sources in farthest-point order, and per source the share of the points that
// are nearer to it than to any other (ties: the earlier source).
struct Sources {
  std::vector<std::vector<double>> length;
  std::vector<double> share;
};

Sources spread_sources(const Graph& graph, std::int32_t first) {
  const std::size_t count = std::min(kSources, graph.size());
  Sources sources{.share = std::vector<double>(count, 0.0)};
  std::vector<double> to_nearest(graph.size(), std::numeric_limits<double>::infinity());
  std::vector<std::size_t> nearest(graph.size(), 0);
  for (std::size_t s = 0; s < count; ++s) {
    sources.length.push_back(path_lengths(graph, s == 0 ? first : largest_of(to_nearest)));
    for (std::size_t i = 0; i < graph.size(); ++i) {
      if (sources.length[s][i] >= to_nearest[i]) continue;
      to_nearest[i] = sources.length[s][i];
      nearest[i] = s;
    }
  }
  for (const std::size_t s : nearest) sources.share[s] += 1.0 / static_cast<double>(graph.size());
  return sources;
}

std::vector<double> mean_path_lengths(const Graph& graph, std::int32_t first_source) {
  const Sources sources = spread_sources(graph, first_source);
  std::vector<double> mean(graph.size(), 0.0);
  for (std::size_t s = 0; s < sources.share.size(); ++s)
    for (std::size_t i = 0; i < mean.size(); ++i)
      mean[i] += sources.share[s] * sources.length[s][i];
  return mean;
}

std::vector<double> centroid_distances(std::span<const float> xyz) {
  const std::size_t count = xyz.size() / 3;
  std::array<double, 3> centroid{};
  for (std::size_t i = 0; i < xyz.size(); ++i)
    centroid[i % 3] += xyz[i] / static_cast<double>(count);
  std::vector<double> distance(count);
  for (std::size_t i = 0; i < count; ++i)
    distance[i] = std::hypot(xyz[3 * i] - centroid[0], xyz[3 * i + 1] - centroid[1],
                             xyz[3 * i + 2] - centroid[2]);
  return distance;
}

}  // namespace

std::vector<float> place(std::span<const float> xyz, double scale) {
  if (xyz.empty()) return {};
  const NearestNeighbours tree(xyz);
  Graph graph = neighbour_graph(xyz, tree);
  join_pieces(graph, xyz, tree);
  const std::vector<double> from_centroid = centroid_distances(xyz);
  const std::vector<double> mean_path = mean_path_lengths(graph, largest_of(from_centroid));
  std::vector<float> rows;
  rows.reserve(kPlaceSize * graph.size());
  for (std::size_t i = 0; i < graph.size(); ++i) {
    rows.push_back(static_cast<float>(mean_path[i] / scale));
    rows.push_back(static_cast<float>(from_centroid[i] / scale));
  }
  return rows;
}

}  // namespace cosegraph::descriptors
