// SHOT in two steps. The neighbours' weighted scatter, its signs settled by where most of them lie,
// gives the keypoint a frame. A grid of 8 sectors, 2 heights and 2 distances in that frame holds
// histograms of the angle between the neighbours' normals and the frame's third axis; a neighbour
// is shared with the next along each of the four. What the next gets is how far the neighbour is
// from the middle of its cell, and its own what is left of 4: PCL's formulas, case by case, come
// down to that.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "descriptors/neighbourhood.hpp"
#include "descriptors/own.hpp"
#include "descriptors/vectors.hpp"

namespace cosegraph::descriptors {
namespace {

constexpr int kCosines = 11;           // bins of a histogram
constexpr int kFewest = 5;             // neighbours that a frame takes
constexpr int kVotes = 5;              // of a neighbour: its own bin and the next in 4 directions
constexpr float kCoincident = 1e-15F;  // neighbours as near as this do not vote
constexpr float kNegligible = 1e-30F;  // coordinates as small as this are 0
constexpr int kDoubles = 4;
static_assert(kDoubles == sizeof(Doubles) / sizeof(double));

using Frame = std::array<Vector<float>, 3>;

// Upper triangle of the scatter of the neighbours' positions.
struct Scatter {
  double xx = 0.0;
  double xy = 0.0;
  double xz = 0.0;
  double yy = 0.0;
  double yz = 0.0;
  double zz = 0.0;
};

struct Votes {
  std::array<std::vector<std::int32_t>, kVotes> bin;
  std::array<std::vector<float>, kVotes> weight;
};

COSEGRAPH_INLINE Doubles doubles(const Narrow& v) {
  return __builtin_convertvector(v, Doubles);
}

COSEGRAPH_INLINE Doubles load_doubles(const float* from) {
  return doubles(load<Narrow>(from));
}

// Relative error below 1e-12: a float's root with a correction.
COSEGRAPH_INLINE Doubles precise_root(const Narrow& squared) {
  const Narrow inverse = inverse_root(squared);
  const Doubles guess = doubles(squared * inverse);
  return guess + (doubles(squared) - guess * guess) * (0.5 * doubles(inverse));
}

COSEGRAPH_INLINE double sum_of(const Doubles& v) {
  return (v[0] + v[1]) + (v[2] + v[3]);
}

// Weights are `radius` - distance; who is at the centre adds nothing. A flat patch's sides are told
// apart by the last bits of its frame, so that the weights need more than a float's precision.
COSEGRAPH_INLINE Scatter scatter_all(const Columns& columns, const float* squared, int count,
                                     double radius) {
  Doubles xx = {};
  Doubles xy = {};
  Doubles xz = {};
  Doubles yy = {};
  Doubles yz = {};
  Doubles zz = {};
  for (int i = 0; i < count; i += kDoubles) {
    const Doubles x = load_doubles(&columns[kX][i]);
    const Doubles y = load_doubles(&columns[kY][i]);
    const Doubles z = load_doubles(&columns[kZ][i]);
    const Doubles weight = radius - precise_root(load<Narrow>(squared + i));
    const Doubles wx = weight * x;
    const Doubles wy = weight * y;
    xx += wx * x;
    xy += wx * y;
    xz += wx * z;
    yy += wy * y;
    yz += wy * z;
    zz += weight * z * z;
  }
  return {sum_of(xx), sum_of(xy), sum_of(xz), sum_of(yy), sum_of(yz), sum_of(zz)};
}

// How many of the first `count` positions, in whole vectors, do not lie behind each of two planes.
COSEGRAPH_INLINE std::array<int, 2> in_front_all(const Columns& columns, int count,
                                                 const Vector<double>& first,
                                                 const Vector<double>& third) {
  Integers<Doubles> ahead = {};
  Integers<Doubles> above = {};
  for (int i = 0; i < count; i += kDoubles) {
    const Doubles x = load_doubles(&columns[kX][i]);
    const Doubles y = load_doubles(&columns[kY][i]);
    const Doubles z = load_doubles(&columns[kZ][i]);
    ahead -= x * first.x + y * first.y + z * first.z >= 0.0;
    above -= x * third.x + y * third.y + z * third.z >= 0.0;
  }
  return {static_cast<int>(ahead[0] + ahead[1] + ahead[2] + ahead[3]),
          static_cast<int>(above[0] + above[1] + above[2] + above[3])};
}

// Polynomials in v^2, near the best in absolute error (1e-7).
template <class V, std::size_t N>
COSEGRAPH_INLINE V odd_polynomial(const V& v, const float (&coefficient)[N]) {
  const V squared = v * v;
  V sum = V{} + coefficient[N - 1];
#pragma GCC unroll 10
  for (int k = N - 2; k >= 0; --k) sum = sum * squared + coefficient[k];
  return sum * v;
}

// Of v within [0, 1].
template <class V>
COSEGRAPH_INLINE V arc_tangent(const V& v) {
  constexpr float kCoefficients[] = {1.0F,          -0.333330367F,  0.19991872F,
                                     -0.141977978F, 0.106183706F,   -0.0745685483F,
                                     0.0421376236F, -0.0157312491F, 0.0027662835F};
  return odd_polynomial(v, kCoefficients);
}

// Of v within [0, 1]; from 1/2 on by the half angle's.
template <class V>
COSEGRAPH_INLINE V arc_sine(const V& v) {
  constexpr float kCoefficients[] = {1.0F,          0.16666782F,   0.0749469669F,
                                     0.0455206356F, 0.0239939996F, 0.0424173738F};
  const auto large = v > 0.5F;
  const V half = (1.0F - v) * 0.5F;
  const V angle = odd_polynomial(large ? half * inverse_root(half) : v, kCoefficients);
  return large ? 0.5F * std::numbers::pi_v<float> - 2.0F * angle : angle;
}

template <class V>
COSEGRAPH_INLINE V share_from(const V& v) {
  return v > 0.0F ? v : V{};
}

// What a radius says to a kernel.
struct Shells {
  float half_squared;  // squared distances above it are outside
  float inverse;       // of half the radius

  explicit Shells(double radius) : inverse(static_cast<float>(2.0 / radius)) {
    half_squared = static_cast<float>(0.25 * radius * radius);
    while (std::sqrt(static_cast<double>(half_squared)) > 0.5 * radius)
      half_squared = std::nextafter(half_squared, 0.0F);
  }
};

template <class V>
COSEGRAPH_INLINE Vector<V> spread(const Vector<float>& v) {
  return {V{} + v.x, V{} + v.y, V{} + v.z};
}

template <class V>
COSEGRAPH_INLINE V coordinate(const Vector<V>& position, const Vector<V>& axis) {
  const V value = dot(position, axis);
  return magnitude(value) < kNegligible ? V{} : value;
}

// The bin that 5 (1 + cosine) is nearest to, and how far above its middle that is. The product is
// kept with its rounding error, so that no bin differs from that of double precision.
template <class V>
COSEGRAPH_INLINE void place_cosine(const V& cosine, Integers<V>& step, V& lean) {
  constexpr float kZero = 0.5F * (kCosines - 1);  // bin of cosine 0
  const V four = 4.0F * cosine;
  const V five = four + cosine;
  const V error = cosine - (five - four);
  step = __builtin_convertvector(five + (kZero + 0.5F), Integers<V>);
  const V rest = five - (__builtin_convertvector(step, V) - kZero);
  step -= ((rest - 0.5F) + error >= 0.0F) - ((rest + 0.5F) + error < 0.0F);
  lean = (five - (__builtin_convertvector(step, V) - kZero)) + error;
}

// The votes of every neighbour.
template <class V>
COSEGRAPH_INLINE void votes_all(const Columns& columns, const float* squared, int count,
                                const Frame& frame, const Shells& shells, Votes& votes) {
  using Ints = Integers<V>;
  const Vector<V> first = spread<V>(frame[0]);
  const Vector<V> second = spread<V>(frame[1]);
  const Vector<V> third = spread<V>(frame[2]);
  for (int i = 0; i < count; i += kWidth<V>) {
    const Vector<V> position{load<V>(&columns[kX][i]), load<V>(&columns[kY][i]),
                             load<V>(&columns[kZ][i])};
    const Vector<V> normal{load<V>(&columns[kNormalX][i]), load<V>(&columns[kNormalY][i]),
                           load<V>(&columns[kNormalZ][i])};
    const V square = load<V>(squared + i);
    const V distance = square_root(square);
    const V x = coordinate(position, first);
    const V y = coordinate(position, second);
    const V z = coordinate(position, third);

    // Sectors are counted from -180 degrees. Each lies between an axis and a diagonal: even ones
    // begin at the axis, odd ones end there.
    const Ints upper = (y > 0.0F) | ((y == 0.0F) & (x < 0.0F));
    const Ints right = (x > 0.0F) | ((x == 0.0F) & (y > 0.0F));
    const V wide = magnitude(x);
    const V high = magnitude(y);
    const Ints same_sign = ((x > 0.0F) & (y > 0.0F)) | ((x < 0.0F) & (y < 0.0F)) | (x == 0.0F);
    const Ints odd = same_sign ? wide < high : wide > high;
    const Ints sector = (upper & 4) | ((upper ^ right) & 2) | (odd & 1);
    const V longer = wide > high ? wide : high;
    const V shorter = wide > high ? high : wide;
    const Ints off_axis = longer > 0.0F;
    const V from_axis = arc_tangent(shorter / (off_axis ? longer : V{} + 1.0F)) *
                        (4.0F / std::numbers::pi_v<float>);
    const V turn = bounded(odd ? 0.5F - from_axis : from_axis - 0.5F, -0.5F, 0.5F);

    const Ints outside = square > shells.half_squared;
    const V shell = distance * shells.inverse - (outside ? V{} + 1.5F : V{} + 0.5F);
    const V steepness = bounded(magnitude(z) / distance, 0.0F, 1.0F);
    const V tilt = 0.5F - arc_sine(steepness) * (2.0F / std::numbers::pi_v<float>);

    const V cosine = bounded(dot(normal, third), -1.0F, 1.0F);
    Ints step;
    V lean;
    place_cosine(cosine, step, lean);
    // As in PCL: the bin after 9 is 0.
    const Ints after = step >= kCosines - 2 ? Ints{} + (step - (kCosines - 2)) : step + 1;
    const Ints before = step > 0 ? step - 1 : Ints{} + (kCosines - 2);

    const Ints cell = sector << 2 | (outside & 2) | ((z > 0.0F) & 1);
    const Ints next_cell =
        ((sector + (turn > 0.0F ? Ints{} + 1 : Ints{} - 1)) & 7) << 2 | (cell & 3);
    const Ints bins[kVotes] = {
        cell * kCosines + step, cell * kCosines + (lean > 0.0F ? after : before),
        (cell ^ 2) * kCosines + step, (cell ^ 1) * kCosines + step, next_cell * kCosines + step};
    const V turn_share = off_axis ? magnitude(turn) : V{};
    const V own_of_turn = off_axis ? 1.0F - turn_share : V{};
    const V weights[kVotes] = {
        ((1.0F - magnitude(lean)) + (1.0F - magnitude(shell)) + (1.0F - magnitude(tilt))) +
            own_of_turn,
        magnitude(lean), share_from(outside ? -shell : shell), share_from(tilt), turn_share};
    const Ints counts = distance >= kCoincident;
#pragma GCC unroll 5
    for (int k = 0; k < kVotes; ++k) {
      store(&votes.bin[k][i], bins[k]);
      const V weight = counts ? weights[k] : V{};
      store(&votes.weight[k][i], weight);
    }
  }
}

struct Kernels {
  Scatter (*scatter)(const Columns& columns, const float* squared, int count, double radius);
  std::array<int, 2> (*in_front)(const Columns& columns, int count, const Vector<double>& first,
                                 const Vector<double>& third);
  void (*votes)(const Columns& columns, const float* squared, int count, const Frame& frame,
                const Shells& shells, Votes& votes);
};

constexpr Kernels kBaseline{
    [](const Columns& columns, const float* squared, int count, double radius) {
      return scatter_all(columns, squared, count, radius);
    },
    [](const Columns& columns, int count, const Vector<double>& first,
       const Vector<double>& third) { return in_front_all(columns, count, first, third); },
    [](const Columns& columns, const float* squared, int count, const Frame& frame,
       const Shells& shells,
       Votes& votes) { votes_all<Narrow>(columns, squared, count, frame, shells, votes); }};

#ifdef COSEGRAPH_AVX2
constexpr Kernels kAvx2{
    [](const Columns& columns, const float* squared, int count, double radius)
        COSEGRAPH_AVX2 { return scatter_all(columns, squared, count, radius); },
    [](const Columns& columns, int count, const Vector<double>& first, const Vector<double>& third)
        COSEGRAPH_AVX2 { return in_front_all(columns, count, first, third); },
    [](const Columns& columns, const float* squared, int count, const Frame& frame,
       const Shells& shells, Votes& votes)
        COSEGRAPH_AVX2 { votes_all<Wide>(columns, squared, count, frame, shells, votes); }};
#endif

const Kernels& kernels([[maybe_unused]] Instructions instructions) {
#ifdef COSEGRAPH_AVX2
  if (instructions == Instructions::avx2) return kAvx2;
#endif
  return kBaseline;
}

class Signatures {
 public:
  Signatures(const Grid& grid, double radius, Instructions instructions, std::span<float> rows)
      : grid_(grid),
        radius_(radius),
        shells_(radius),
        kernels_(kernels(instructions)),
        rows_(rows) {}

  void operator()(const Grid::Target& target, const Patch& patch, const Neighbours& neighbours) {
    gather(patch, neighbours, grid_.at(target.place), columns_);
    const int count = padded(neighbours.count);
    const auto row = rows_.subspan(static_cast<std::size_t>(target.row) * kShotSize, kShotSize);
    Frame frame;
    if (!find_frame(patch, neighbours, frame)) {
      std::ranges::fill(row, std::numeric_limits<float>::quiet_NaN());
      return;
    }
    for (auto& bin : votes_.bin) bin.resize(count);
    for (auto& weight : votes_.weight) weight.resize(count);
    kernels_.votes(columns_, neighbours.squared.data(), count, frame, shells_, votes_);
    std::ranges::fill(row, 0.0F);
    for (int i = 0; i < neighbours.count; ++i)
      for (int k = 0; k < kVotes; ++k) row[votes_.bin[k][i]] += votes_.weight[k][i];
    normalise(row);
  }

 private:
  // False if there are too few neighbours.
  bool find_frame(const Patch& patch, const Neighbours& neighbours, Frame& frame) {
    const int count = padded(neighbours.count);
    int apart = 0;
    for (int i = 0; i < count; ++i) apart += is_apart(i) ? 1 : 0;
    if (apart < kFewest) return false;
    const Scatter s = kernels_.scatter(columns_, neighbours.squared.data(), count, radius_);
    Eigen::Matrix3d matrix;
    matrix << s.xx, s.xy, s.xz, s.xy, s.yy, s.yz, s.xz, s.yz, s.zz;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(matrix);
    if (!solver.eigenvalues().allFinite()) return false;
    Eigen::Vector3d first = solver.eigenvectors().col(2);
    Eigen::Vector3d third = solver.eigenvectors().col(0);
    const auto [ahead, above] = kernels_.in_front(
        columns_, count, {first.x(), first.y(), first.z()}, {third.x(), third.y(), third.z()});
    const int centred = count - apart;  // these are counted as ahead and above
    if (points_back(first, 2 * (ahead - centred) - apart, patch, neighbours)) first = -first;
    if (points_back(third, 2 * (above - centred) - apart, patch, neighbours)) third = -third;
    const Eigen::Vector3f x = first.cast<float>();
    const Eigen::Vector3f z = third.cast<float>();
    frame[0] = {x.x(), x.y(), x.z()};
    frame[2] = {z.x(), z.y(), z.z()};
    frame[1] = cross(frame[2], frame[0]);
    return true;
  }

  // Whether a neighbour is not where the keypoint is.
  bool is_apart(int i) const {
    return columns_[kX][i] != 0.0F || columns_[kY][i] != 0.0F || columns_[kZ][i] != 0.0F;
  }

  // Most neighbours shall lie on the positive side; where they are even, most of the five that are
  // nearest to the median distance.
  bool points_back(const Eigen::Vector3d& axis, int majority, const Patch& patch,
                   const Neighbours& neighbours) const {
    if (majority != 0) return majority < 0;
    std::vector<int> order;
    for (int i = 0; i < neighbours.count; ++i)
      if (is_apart(i)) order.push_back(i);
    std::ranges::sort(order, {}, [&](int i) {
      return std::pair(neighbours.squared[i], grid_.point_at(patch.place[neighbours.index[i]]));
    });
    int in_front = 0;
    for (int k = -kFewest / 2; k <= kFewest / 2; ++k) {
      const int i = order[static_cast<int>(order.size()) / 2 + k];
      const Eigen::Vector3f position(columns_[kX][i], columns_[kY][i], columns_[kZ][i]);
      if (position.cast<double>().dot(axis) > 0.0) ++in_front;
    }
    return in_front < kFewest / 2 + 1;
  }

  static void normalise(std::span<float> row) {
    double sum[kDoubles] = {};
    for (int i = 0; i < kShotSize; i += kDoubles)
      for (int k = 0; k < kDoubles; ++k) sum[k] += static_cast<double>(row[i + k]) * row[i + k];
    const auto length = static_cast<float>(std::sqrt((sum[0] + sum[1]) + (sum[2] + sum[3])));
    for (float& value : row) value /= length;
  }

  const Grid& grid_;
  double radius_;
  Shells shells_;
  const Kernels& kernels_;
  std::span<float> rows_;
  Columns columns_;
  Votes votes_;
};

}  // namespace

std::vector<float> own_shot(const Surface& surface, std::span<const std::int32_t> keypoint,
                            double radius, int threads, Instructions instructions) {
  const Grid grid(surface, radius);
  std::vector<float> rows(keypoint.size() * kShotSize);
  grid.for_each(grid.targets(keypoint), threads, instructions,
                [&] { return Signatures(grid, radius, instructions, rows); });
  return rows;
}

}  // namespace cosegraph::descriptors
