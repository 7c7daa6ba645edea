// FPFH in two rounds. Every point near a keypoint gets its simple histogram (SPFH): the angles
// between it and each neighbour fall into 3 x 11 bins. A keypoint's FPFH is the mean of its
// neighbours' simple histograms, weighted by 1 / squared distance.
//
// Of a pair, that point is the source whose normal leans less to the line between them. The angle
// that PCL gets from atan2 is only compared with the bins' borders.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <numbers>

#include "descriptors/neighbourhood.hpp"
#include "descriptors/own.hpp"
#include "descriptors/vectors.hpp"

namespace cosegraph::descriptors {
namespace {

constexpr int kBins = kFpfhSize / 3;
constexpr int kMiddle = kBins / 2;
constexpr int kRow = padded(kFpfhSize);  // numbers per simple histogram

// The bins of a pair, one byte each, and whether rounding decides about them.
constexpr std::int32_t kDoubtful = 1 << 24;
constexpr std::int32_t code(int first, int second, int third) {
  return first | second << 8 | third << 16;
}

// Cosines and sines of pi/11, 3pi/11, .. 9pi/11: the borders of the upper half circle's bins.
constexpr float kBorder[kMiddle][2] = {{0.9594929736F, 0.2817325568F},
                                       {0.6548607339F, 0.7557495744F},
                                       {0.1423148383F, 0.9898214419F},
                                       {-0.4154150130F, 0.9096319954F},
                                       {-0.8412535328F, 0.5406408175F}};

// The bin of a number within [-1, 1]. `doubt` is set where rounding may decide about it.
template <class V>
COSEGRAPH_INLINE Integers<V> bin_of(const V& v, Integers<V>& doubt) {
  constexpr float kMargin = 1e-5F;
  // The range ends within bins: its ends are no borders.
  const V scaled = bounded((v + 1.0F) * (0.5F * kBins), 2.0F * kMargin, kBins - 0.5F);
  const Integers<V> bin = __builtin_convertvector(scaled, Integers<V>);
  const V within = scaled - __builtin_convertvector(bin, V);
  doubt |= magnitude(within - 0.5F) > 0.5F - kMargin;
  return bin;
}

// The bin of the angle of (x, y), likewise.
template <class V>
COSEGRAPH_INLINE Integers<V> bin_of_angle(const V& x, const V& y, Integers<V>& doubt) {
  const V height = magnitude(y);
  Integers<V> passed = {};
#pragma GCC unroll 5
  for (const auto& [cosine, sine] : kBorder) {
    const V beyond = height * cosine - x * sine;
    passed -= beyond >= 0.0F;
    doubt |= magnitude(beyond) < 2e-6F;
  }
  return kMiddle + (y < 0.0F ? -passed : passed);
}

// Codes of the pairs of a point with normal `n` and its neighbours, in `columns`.
template <class V>
COSEGRAPH_INLINE void codes_all(const PointNumbers& centre, const Columns& columns, int count,
                                std::int32_t* codes) {
  const Vector<V> n{V{} + centre[kNormalX], V{} + centre[kNormalY], V{} + centre[kNormalZ]};
  for (int i = 0; i < count; i += kWidth<V>) {
    const Vector<V> line{load<V>(&columns[kX][i]), load<V>(&columns[kY][i]),
                         load<V>(&columns[kZ][i])};
    const Vector<V> m{load<V>(&columns[kNormalX][i]), load<V>(&columns[kNormalY][i]),
                      load<V>(&columns[kNormalZ][i])};
    const V n_leans = dot(n, line);
    const V m_leans = dot(m, line);
    const auto turned = magnitude(n_leans) < magnitude(m_leans);
    const Vector<V> source{turned ? m.x : n.x, turned ? m.y : n.y, turned ? m.z : n.z};
    const Vector<V> target{turned ? n.x : m.x, turned ? n.y : m.y, turned ? n.z : m.z};
    const Vector<V> way{turned ? -line.x : line.x, turned ? -line.y : line.y,
                        turned ? -line.z : line.z};
    const V leans = turned ? -m_leans : n_leans;

    const Vector<V> v = cross(way, source);  // the frame's second axis, not of unit length
    const Vector<V> w = cross(source, v);
    const V squared = dot(way, way);
    const V across = dot(v, v);
    const V near = inverse_root(squared);
    const V inverse = inverse_root(across);
    const V x = dot(source, target);
    const V y = dot(w, target) * inverse;
    Integers<V> border = {};
    Integers<V> pair = bin_of_angle(x, y, border);
    pair |= bin_of(dot(v, target) * inverse, border) << 8;
    pair |= bin_of(leans * near, border) << 16;

    const V n_tilt = magnitude(n_leans * near);
    const V m_tilt = magnitude(m_leans * near);
    // As good as equal, and it matters which one is the source: both lean the same way, and so far
    // that a bin changes.
    const auto tie = (magnitude(n_tilt - m_tilt) < 1e-6F) & (n_leans * m_leans > 0.0F) &
                     ((n_tilt > 0.08F) | (x < 0.9F)) & ((n.x != m.x) | (n.y != m.y) | (n.z != m.z));
    const auto upright = m_tilt > 1.0F - 1e-6F;
    const auto opposite = (magnitude(y) < 1e-6F) & (x < 0.0F);
    const Integers<V> doubt = (border | tie | upright | opposite) & kDoubtful;
    const auto degenerate = (squared <= 0.0F) | (across <= 0.0F);
    const Integers<V> result =
        degenerate ? Integers<V>{} + code(kMiddle, kMiddle, kMiddle) : pair | doubt;
    store(codes + i, result);
  }
}

// Adds weight * row, in order.
template <class V>
COSEGRAPH_INLINE void weighted_sum_all(const std::int32_t* place, const float* weight, int count,
                                       const float* rows, float* result) {
  constexpr int kVectors = kRow / kWidth<V>;
  V sum[kVectors] = {};
  for (int i = 0; i < count; ++i) {
    const float* row = rows + static_cast<std::ptrdiff_t>(place[i]) * kRow;
#pragma GCC unroll 10
    for (int j = 0; j < kVectors; ++j) sum[j] += load<V>(row + j * kWidth<V>) * weight[i];
  }
#pragma GCC unroll 10
  for (int j = 0; j < kVectors; ++j) store(result + j * kWidth<V>, sum[j]);
}

struct Kernels {
  void (*codes)(const PointNumbers& centre, const Columns& columns, int count, std::int32_t* codes);
  void (*weighted_sum)(const std::int32_t* place, const float* weight, int count, const float* rows,
                       float* result);
};

constexpr Kernels kBaseline{
    [](const PointNumbers& centre, const Columns& columns, int count, std::int32_t* codes) {
      codes_all<Narrow>(centre, columns, count, codes);
    },
    [](const std::int32_t* place, const float* weight, int count, const float* rows,
       float* result) { weighted_sum_all<Narrow>(place, weight, count, rows, result); }};

#ifdef COSEGRAPH_AVX2
constexpr Kernels kAvx2{
    [](const PointNumbers& centre, const Columns& columns, int count, std::int32_t* codes)
        COSEGRAPH_AVX2 { codes_all<Wide>(centre, columns, count, codes); },
    [](const std::int32_t* place, const float* weight, int count, const float* rows, float* result)
        COSEGRAPH_AVX2 { weighted_sum_all<Wide>(place, weight, count, rows, result); }};
#endif

const Kernels& kernels([[maybe_unused]] Instructions instructions) {
#ifdef COSEGRAPH_AVX2
  if (instructions == Instructions::avx2) return kAvx2;
#endif
  return kBaseline;
}

// The first bin if the value is NaN.
int careful_bin(double value) {
  return static_cast<int>(std::fmin(std::fmax(std::floor(kBins * value), 0.0), kBins - 1.0));
}

// Step by step as PCL does it, so that rounding decides alike.
std::int32_t careful_code(const Vector<float>& n, const Vector<float>& m, Vector<float> line) {
  constexpr std::int32_t kDegenerate = code(kMiddle, kMiddle, kMiddle);
  const float length = std::sqrt(dot(line, line));
  if (length == 0.0F) return kDegenerate;
  const float n_tilt = dot(n, line) / length;
  const float m_tilt = dot(m, line) / length;
  const bool turned = std::acos(std::abs(n_tilt)) > std::acos(std::abs(m_tilt));
  const Vector<float>& source = turned ? m : n;
  const Vector<float>& target = turned ? n : m;
  if (turned) line = {-line.x, -line.y, -line.z};
  Vector<float> v = cross(line, source);
  const float across = std::sqrt(dot(v, v));
  if (across == 0.0F) return kDegenerate;
  v = {v.x / across, v.y / across, v.z / across};
  const float y = dot(cross(source, v), target) + 0.0F;  // PCL's 0 is never -0
  const float angle = std::atan2(y, dot(source, target));
  constexpr auto kTurn = static_cast<double>(1.0F / (2.0F * std::numbers::pi_v<float>));
  return code(careful_bin((angle + std::numbers::pi) * kTurn),
              careful_bin((dot(v, target) + 1.0) * 0.5),
              careful_bin(((turned ? -m_tilt : n_tilt) + 1.0) * 0.5));
}

void resolve_doubts(const PointNumbers& centre, const Columns& columns,
                    std::span<std::int32_t> codes) {
  std::int32_t any = 0;
  for (const std::int32_t pair : codes) any |= pair;
  if (any < kDoubtful) return;
  const Vector<float> n{centre[kNormalX], centre[kNormalY], centre[kNormalZ]};
  for (std::size_t i = 0; i < codes.size(); ++i)
    if (codes[i] >= kDoubtful)
      codes[i] = careful_code(n, {columns[kNormalX][i], columns[kNormalY][i], columns[kNormalZ][i]},
                              {columns[kX][i], columns[kY][i], columns[kZ][i]});
}

using Counts = std::array<std::int32_t, kFpfhSize>;
using Bytes [[gnu::vector_size(16)]] = std::uint8_t;

constexpr auto kOneHot = [] {
  std::array<std::array<std::uint8_t, sizeof(Bytes)>, kBins> table{};
  for (int bin = 0; bin < kBins; ++bin) table[bin][bin] = 1;
  return table;
}();

Bytes one_hot(std::int32_t bin) {
  Bytes bytes;
  std::memcpy(&bytes, kOneHot[bin].data(), sizeof bytes);
  return bytes;
}

// How often each bin occurs. Three vectors of bytes count 255 pairs before they would overflow.
Counts count(std::span<const std::int32_t> codes) {
  constexpr std::size_t kMost = 255;
  Counts counts{};
  for (std::size_t first = 0; first < codes.size(); first += kMost) {
    Bytes histogram[3] = {};
    for (const std::int32_t pair : codes.subspan(first, std::min(kMost, codes.size() - first))) {
      histogram[0] += one_hot(pair & 0xff);
      histogram[1] += one_hot(pair >> 8 & 0xff);
      histogram[2] += one_hot(pair >> 16);
    }
    for (int part = 0; part < 3; ++part)
      for (int bin = 0; bin < kBins; ++bin) counts[part * kBins + bin] += histogram[part][bin];
  }
  return counts;
}

// Writes a simple histogram to the target's row.
class SimpleHistograms {
 public:
  SimpleHistograms(const Grid& grid, Instructions instructions, float* rows)
      : grid_(grid), kernels_(kernels(instructions)), rows_(rows) {}

  void operator()(const Grid::Target& target, const Patch& patch, const Neighbours& neighbours) {
    float* row = rows_ + static_cast<std::ptrdiff_t>(target.row) * kRow;
    std::fill_n(row, kRow, 0.0F);
    if (neighbours.count < 2) return;  // the point itself
    const PointNumbers centre = grid_.at(target.place);
    gather(patch, neighbours, centre, columns_);
    codes_.resize(padded(neighbours.count));
    kernels_.codes(centre, columns_, neighbours.count, codes_.data());
    const auto codes = std::span(codes_).first(neighbours.count);
    resolve_doubts(centre, columns_, codes);
    Counts counts = count(codes);
    for (int part = 0; part < 3; ++part) --counts[part * kBins + kMiddle];  // with itself
    const float share = 100.0F / static_cast<float>(neighbours.count - 1);
    for (int bin = 0; bin < kFpfhSize; ++bin) row[bin] = share * static_cast<float>(counts[bin]);
  }

 private:
  const Grid& grid_;
  const Kernels& kernels_;
  float* rows_;
  Columns columns_;
  std::vector<std::int32_t> codes_;
};

// Writes the weighted means of simple histograms, which stand by place, to the target's row.
class WeightedMeans {
 public:
  WeightedMeans(Instructions instructions, const float* simple, std::span<float> rows)
      : kernels_(kernels(instructions)), simple_(simple), rows_(rows) {}

  void operator()(const Grid::Target& target, const Patch& patch, const Neighbours& neighbours) {
    const int count = neighbours.count;
    place_.resize(count);
    weight_.resize(count);
    for (int i = 0; i < count; ++i) {
      const float squared = neighbours.squared[i];
      place_[i] = patch.place[neighbours.index[i]];
      weight_[i] = squared == 0.0F ? 0.0F : 1.0F / squared;
    }
    float sum[kRow];
    kernels_.weighted_sum(place_.data(), weight_.data(), count, simple_, sum);
    float* row = rows_.data() + static_cast<std::ptrdiff_t>(target.row) * kFpfhSize;
    for (int part = 0; part < kFpfhSize; part += kBins) {
      double total = 0.0;
      for (int bin = part; bin < part + kBins; ++bin) total += sum[bin];
      // No neighbour that counts: 0 / 0.
      for (int bin = part; bin < part + kBins; ++bin)
        row[bin] = static_cast<float>(sum[bin] * (100.0 / total));
    }
  }

 private:
  const Kernels& kernels_;
  const float* simple_;
  std::span<float> rows_;
  std::vector<std::int32_t> place_;
  std::vector<float> weight_;
};

// Every place that is near to a target.
std::vector<Grid::Target> near_targets(const Grid& grid, std::span<const Grid::Target> targets,
                                       int threads, Instructions instructions) {
  std::vector<std::atomic<char>> near(grid.size());
  grid.for_each(targets, threads, instructions, [&near] {
    return [&near](const Grid::Target&, const Patch& patch, const Neighbours& neighbours) {
      for (int i = 0; i < neighbours.count; ++i)
        near[patch.place[neighbours.index[i]]].store(1, std::memory_order_relaxed);
    };
  });
  std::vector<Grid::Target> result = grid.all();
  std::erase_if(result, [&near](const Grid::Target& target) { return near[target.place] == 0; });
  return result;
}

}  // namespace

std::vector<float> own_fpfh(const Surface& surface, std::span<const std::int32_t> keypoint,
                            double radius, int threads, Instructions instructions) {
  const Grid grid(surface, radius);
  const std::vector<Grid::Target> targets = grid.targets(keypoint);
  const std::vector<Grid::Target> sources = targets.size() < grid.size()
                                                ? near_targets(grid, targets, threads, instructions)
                                                : grid.all();
  // By place; only those of the sources are written, and read.
  const auto simple = std::make_unique_for_overwrite<float[]>(grid.size() * kRow);
  grid.for_each(sources, threads, instructions,
                [&] { return SimpleHistograms(grid, instructions, simple.get()); });
  std::vector<float> rows(keypoint.size() * kFpfhSize);
  grid.for_each(targets, threads, instructions,
                [&] { return WeightedMeans(instructions, simple.get(), rows); });
  return rows;
}

}  // namespace cosegraph::descriptors
