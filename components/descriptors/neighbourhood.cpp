#include "descriptors/neighbourhood.hpp"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "descriptors/vectors.hpp"

#ifdef COSEGRAPH_AVX2
#include <immintrin.h>
#endif

namespace cosegraph::descriptors {
namespace {

constexpr int kKeyBits = 21;  // per axis
constexpr double kMiddleCell = 1 << (kKeyBits - 1);
constexpr double kLastCell = (1 << kKeyBits) - 2;  // there is a cell before the first and after it
constexpr std::size_t kPiece = 64;                 // most targets of a piece

// Squares of rounded differences may be below the limit where the true distance is a bit more than
// the radius, and a good deal more where squares are next to nothing.
double cell_width(double radius) {
  return std::max(radius * (1.0 + 1e-5), 1e-21);
}

float squared_limit(double radius) {
  if (!(radius > 0.0)) return 0.0F;
  return static_cast<float>(
      std::min(radius * radius, static_cast<double>(std::numeric_limits<float>::max())));
}

// Where cells are counted from: however far out a few points are, most keep cells of their own.
double median(std::span<const float> xyz, int axis) {
  std::vector<float> value;
  value.reserve(xyz.size() / 3);
  for (std::size_t i = axis; i < xyz.size(); i += 3) value.push_back(xyz[i]);
  const auto middle = value.begin() + static_cast<std::ptrdiff_t>(value.size() / 2);
  std::ranges::nth_element(value, middle);
  return *middle;
}

// Neighbours' cells differ by one at most, also where they are cut off at the grid's border.
std::uint64_t cell_of(double distance, double width) {
  return static_cast<std::uint64_t>(
      std::clamp(std::floor(distance / width) + kMiddleCell, 1.0, kLastCell));
}

std::int64_t key_step(int x, int y, int z) {
  return (static_cast<std::int64_t>(x) * (1 << kKeyBits) + y) * (1 << kKeyBits) + z;
}

// Both write up to kWidest entries behind those that they count.
int collect(const Patch& patch, const PointNumbers& centre, float limit, std::int32_t* index,
            float* squared) {
  const int count = static_cast<int>(patch.place.size());
  const float* x = patch.column[kX].data();
  const float* y = patch.column[kY].data();
  const float* z = patch.column[kZ].data();
  int found = 0;
  for (int i = 0; i < count; ++i) {
    const float dx = x[i] - centre[kX];
    const float dy = y[i] - centre[kY];
    const float dz = z[i] - centre[kZ];
    const float distance = dx * dx + dy * dy + dz * dz;
    index[found] = i;
    squared[found] = distance;
    found += distance < limit ? 1 : 0;
  }
  return found;
}

#ifdef COSEGRAPH_AVX2
// For every set of lanes their numbers, from low to high, as bytes.
constexpr std::array<std::uint64_t, 256> kLanesOf = [] {
  std::array<std::uint64_t, 256> table{};
  for (unsigned set = 0; set < 256; ++set)
    for (unsigned lane = 0, shift = 0; lane < 8; ++lane)
      if (((set >> lane) & 1U) != 0) {
        table[set] |= static_cast<std::uint64_t>(lane) << shift;
        shift += 8;
      }
  return table;
}();

COSEGRAPH_AVX2 int collect_avx2(const Patch& patch, const PointNumbers& centre, float limit,
                                std::int32_t* index, float* squared) {
  const int count = static_cast<int>(patch.place.size());
  const float* x = patch.column[kX].data();
  const float* y = patch.column[kY].data();
  const float* z = patch.column[kZ].data();
  int found = 0;
  for (int i = 0; i < count; i += kWidest) {
    const __m256 dx = _mm256_loadu_ps(x + i) - _mm256_set1_ps(centre[kX]);
    const __m256 dy = _mm256_loadu_ps(y + i) - _mm256_set1_ps(centre[kY]);
    const __m256 dz = _mm256_loadu_ps(z + i) - _mm256_set1_ps(centre[kZ]);
    const __m256 distance = dx * dx + dy * dy + dz * dz;
    const auto near = static_cast<unsigned>(
        _mm256_movemask_ps(_mm256_cmp_ps(distance, _mm256_set1_ps(limit), _CMP_LT_OQ)));
    const __m256i lanes =
        _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kLanesOf[near])));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(index + found),
                        _mm256_add_epi32(lanes, _mm256_set1_epi32(i)));
    _mm256_storeu_ps(squared + found, _mm256_permutevar8x32_ps(distance, lanes));
    found += __builtin_popcount(near);
  }
  return found;
}
#endif

}  // namespace

Instructions best_instructions() {
#ifdef COSEGRAPH_AVX2
  if (__builtin_cpu_supports("avx2")) return Instructions::avx2;
#endif
  return Instructions::baseline;
}

int threads_of(int threads) {
  return threads > 0 ? threads : omp_get_num_procs();
}

Grid::Grid(const Surface& surface, double radius) : limit_(squared_limit(radius)) {
  sort_points(surface, cell_width(radius));
  find_runs();
}

void Grid::sort_points(const Surface& surface, double width) {
  const std::size_t count = surface.xyz.size() / 3;
  struct Keyed {
    std::uint64_t key;
    std::int32_t point;
    auto operator<=>(const Keyed&) const = default;
  };
  std::vector<Keyed> keyed(count);
  if (count == 0) return begin_.assign(1, 0);
  for (std::size_t i = 0; i < count; ++i) keyed[i].point = static_cast<std::int32_t>(i);
  for (int axis = 0; axis < 3; ++axis) {
    const double origin = median(surface.xyz, axis);
    for (std::size_t i = 0; i < count; ++i)
      keyed[i].key = keyed[i].key << kKeyBits | cell_of(surface.xyz[3 * i + axis] - origin, width);
  }
  std::ranges::sort(keyed);
  for (auto& column : column_) column.reserve(count);
  for (const auto& [key, point] : keyed) {
    if (key_.empty() || key_.back() != key) {
      key_.push_back(key);
      begin_.push_back(static_cast<std::int32_t>(order_.size()));
    }
    order_.push_back(point);
    cell_.push_back(static_cast<std::int32_t>(key_.size()) - 1);
    for (int axis = 0; axis < 3; ++axis) {
      column_[kX + axis].push_back(surface.xyz[3 * static_cast<std::size_t>(point) + axis]);
      column_[kNormalX + axis].push_back(
          surface.normal[3 * static_cast<std::size_t>(point) + axis]);
    }
  }
  begin_.push_back(static_cast<std::int32_t>(count));
}

// Keys ascend, so each run's ends only move forward from cell to cell.
void Grid::find_runs() {
  runs_.resize(key_.size());
  int run = 0;
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y, ++run) {
      std::size_t from = 0;
      std::size_t to = 0;
      for (std::size_t cell = 0; cell < key_.size(); ++cell) {
        while (from < key_.size() && key_[from] < key_[cell] + key_step(x, y, -1)) ++from;
        while (to < key_.size() && key_[to] <= key_[cell] + key_step(x, y, 1)) ++to;
        runs_[cell][run] = {begin_[from], begin_[to]};
      }
    }
}

PointNumbers Grid::at(std::int32_t place) const {
  PointNumbers numbers;
  for (int c = 0; c < kColumns; ++c) numbers[c] = column_[c][place];
  return numbers;
}

std::vector<Grid::Target> Grid::targets(std::span<const std::int32_t> points) const {
  std::vector<std::int32_t> place(order_.size());
  for (std::size_t i = 0; i < order_.size(); ++i) place[order_[i]] = static_cast<std::int32_t>(i);
  std::vector<Target> result;
  result.reserve(points.size());
  for (std::size_t k = 0; k < points.size(); ++k)
    result.push_back({place[points[k]], static_cast<std::int32_t>(k)});
  std::ranges::sort(result, {},
                    [](const Target& target) { return std::pair(target.place, target.row); });
  return result;
}

std::vector<Grid::Target> Grid::all() const {
  std::vector<Target> result(order_.size());
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(result.size()); ++i) result[i] = {i, i};
  return result;
}

std::vector<std::size_t> Grid::pieces(std::span<const Target> targets) const {
  std::vector<std::size_t> end;
  std::size_t first = 0;
  for (std::size_t i = 1; i <= targets.size(); ++i) {
    const bool within = i < targets.size() && i < first + kPiece &&
                        cell_[targets[i].place] == cell_[targets[first].place];
    if (within) continue;
    end.push_back(i);
    first = i;
  }
  return end;
}

void Grid::copy(std::int32_t cell, Patch& patch) const {
  patch.place.clear();
  for (auto& column : patch.column) column.clear();
  for (const auto [from, to] : runs_[cell]) {
    for (std::int32_t place = from; place < to; ++place) patch.place.push_back(place);
    for (int c = 0; c < kColumns; ++c)
      patch.column[c].insert(patch.column[c].end(), column_[c].begin() + from,
                             column_[c].begin() + to);
  }
  for (auto& column : patch.column)
    column.resize(padded(static_cast<int>(patch.place.size())),
                  std::numeric_limits<float>::quiet_NaN());
}

void Grid::find(std::int32_t place, const Patch& patch, [[maybe_unused]] Instructions instructions,
                Neighbours& neighbours) const {
  const std::size_t room = patch.place.size() + kWidest;
  if (neighbours.index.size() < room) {
    neighbours.index.resize(room);
    neighbours.squared.resize(room);
  }
  std::int32_t* index = neighbours.index.data();
  float* squared = neighbours.squared.data();
  int count = 0;
#ifdef COSEGRAPH_AVX2
  if (instructions == Instructions::avx2)
    count = collect_avx2(patch, at(place), limit_, index, squared);
  else
#endif
    count = collect(patch, at(place), limit_, index, squared);
  neighbours.count = count;
  std::fill(squared + count, squared + padded(count), 0.0F);
}

void gather(const Patch& patch, const Neighbours& neighbours, const PointNumbers& centre,
            Columns& result) {
  const int count = neighbours.count;
  const std::int32_t* index = neighbours.index.data();
  for (int c = 0; c < kColumns; ++c) {
    result[c].resize(padded(count));
    const float* from = patch.column[c].data();
    const float origin = c <= kZ ? centre[c] : 0.0F;
    float* to = result[c].data();
    for (int i = 0; i < count; ++i) to[i] = from[index[i]] - origin;
    std::fill(to + count, to + padded(count), 0.0F);
  }
}

}  // namespace cosegraph::descriptors
