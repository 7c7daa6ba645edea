#include "tools/evaluation/forecast.hpp"

#include <algorithm>

namespace cosegraph::evaluation {
namespace {

// Seconds per piece, believed as much as one piece measured.
constexpr std::array<double, kPieceKinds> kPrior{1.0, 0.4, 0.4, 0.3};

}  // namespace

void Forecast::expect(Piece kind, long pieces) {
  const std::lock_guard lock(mutex_);
  tally_[static_cast<std::size_t>(kind)].expected += pieces;
}

void Forecast::done(Piece kind, double seconds) {
  const std::lock_guard lock(mutex_);
  Tally& tally = tally_[static_cast<std::size_t>(kind)];
  ++tally.done;
  tally.seconds += seconds;
}

double Forecast::cost(std::size_t kind) const {
  return (kPrior[kind] + tally_[kind].seconds) / static_cast<double>(1 + tally_[kind].done);
}

double Forecast::fraction() const {
  const std::lock_guard lock(mutex_);
  double all = 0.0;
  double done = 0.0;
  for (std::size_t kind = 0; kind < kPieceKinds; ++kind) {
    const Tally& tally = tally_[kind];
    all += cost(kind) * static_cast<double>(std::max(tally.expected, tally.done));
    done += cost(kind) * static_cast<double>(tally.done);
  }
  return all > 0.0 ? done / all : 0.0;
}

double Forecast::seconds_left() const {
  const std::lock_guard lock(mutex_);
  double left = 0.0;
  for (std::size_t kind = 0; kind < kPieceKinds; ++kind)
    left +=
        cost(kind) * static_cast<double>(std::max(0L, tally_[kind].expected - tally_[kind].done));
  return left / jobs_;
}

}  // namespace cosegraph::evaluation
