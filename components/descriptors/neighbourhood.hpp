// The neighbours of many points of a surface within one radius, found cell by cell.
//
// The points are sorted into cells as wide as the radius, so that the neighbours of a cell's points
// lie in that cell and the 26 around it. These are copied side by side once per cell (a patch) and
// compared with each of the cell's points, several at a time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "descriptors/own.hpp"

namespace cosegraph::descriptors {

// What is known of a point; the numbers of many stand in columns.
enum Column { kX, kY, kZ, kNormalX, kNormalY, kNormalZ, kColumns };
using PointNumbers = std::array<float, kColumns>;
using Columns = std::array<std::vector<float>, kColumns>;

// The points of a cell and of those around it.
struct Patch {
  std::vector<std::int32_t> place;  // in the grid, ascending
  Columns column;                   // padded with NaN
};

// The points of a patch that are nearer to one of them than the radius, itself included, in the
// patch's order.
struct Neighbours {
  int count = 0;
  std::vector<std::int32_t> index;  // in the patch
  std::vector<float> squared;       // distance; padded with 0
};

class Grid {
 public:
  // A point whose neighbours are wanted, and the row of the results that it is for.
  struct Target {
    std::int32_t place;
    std::int32_t row;
  };

  // Points within NearestNeighbours::kFarthest.
  Grid(const Surface& surface, double radius);

  // Points have places, in the order of the cells.
  std::size_t size() const { return order_.size(); }
  std::int32_t point_at(std::int32_t place) const { return order_[place]; }
  PointNumbers at(std::int32_t place) const;

  // `points` as targets in the order of their places; rows count through `points`.
  std::vector<Target> targets(std::span<const std::int32_t> points) const;
  std::vector<Target> all() const;  // rows are places

  // Makes a worker per thread, make_worker(), and calls
  // worker(const Target&, const Patch&, const Neighbours&) for every target. `threads` 0: all
  // cores.
  template <class MakeWorker>
  void for_each(std::span<const Target> targets, int threads, Instructions instructions,
                const MakeWorker& make_worker) const;

 private:
  using Run = std::array<std::int32_t, 2>;  // places [from, to)
  static constexpr int kRuns = 9;           // cells above each other are neighbours in order, too

  void sort_points(const Surface& surface, double width);
  void find_runs();
  // Ends of pieces of `targets`: each within a cell, and small enough for threads to share.
  std::vector<std::size_t> pieces(std::span<const Target> targets) const;
  void copy(std::int32_t cell, Patch& patch) const;
  void find(std::int32_t place, const Patch& patch, Instructions instructions,
            Neighbours& neighbours) const;

  float limit_;                      // of squared distances
  std::vector<std::int32_t> order_;  // point at each place
  Columns column_;                   // by place
  std::vector<std::int32_t> cell_;   // at each place
  std::vector<std::uint64_t> key_;   // of each cell, ascending; from high bits to low x, y, z
  std::vector<std::int32_t> begin_;  // first place of each cell; at the end the number of points
  std::vector<std::array<Run, kRuns>> runs_;  // places of the cells around each cell
};

// Numbers of the neighbours, their positions relative to `centre`; padded with 0.
void gather(const Patch& patch, const Neighbours& neighbours, const PointNumbers& centre,
            Columns& result);

int threads_of(int threads);  // all cores for 0

template <class MakeWorker>
void Grid::for_each(std::span<const Target> targets, int threads, Instructions instructions,
                    const MakeWorker& make_worker) const {
  const std::vector<std::size_t> end = pieces(targets);
#pragma omp parallel num_threads(threads_of(threads))
  {
    auto worker = make_worker();
    Patch patch;
    Neighbours neighbours;
#pragma omp for schedule(dynamic)
    for (std::size_t piece = 0; piece < end.size(); ++piece) {
      const std::size_t first = piece == 0 ? 0 : end[piece - 1];
      copy(cell_[targets[first].place], patch);
      for (const Target& target : targets.subspan(first, end[piece] - first)) {
        find(target.place, patch, instructions, neighbours);
        worker(target, patch, neighbours);
      }
    }
  }
}

}  // namespace cosegraph::descriptors
