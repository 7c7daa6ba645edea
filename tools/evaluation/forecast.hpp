// How much of a long run is done, and how long the rest takes.
#pragma once

#include <array>
#include <cstddef>
#include <mutex>

namespace cosegraph::evaluation {

// Kinds of pieces of work in the order in which a category does them.
enum class Piece { shape, view, model, query };
constexpr std::size_t kPieceKinds = 4;

// Thread-safe. The pieces of one kind are taken to cost the same as those of it that are done.
class Forecast {
 public:
  explicit Forecast(int jobs) : jobs_(jobs) {}

  // Adds to the pieces expected; less than zero where fewer turned up than were expected.
  void expect(Piece kind, long pieces);
  void done(Piece kind, double seconds);

  double fraction() const;      // of the estimated thread time, in [0, 1]
  double seconds_left() const;  // wall time

 private:
  struct Tally {
    long expected = 0;
    long done = 0;
    double seconds = 0.0;
  };
  double cost(std::size_t kind) const;

  mutable std::mutex mutex_;
  std::array<Tally, kPieceKinds> tally_;
  int jobs_;
};

}  // namespace cosegraph::evaluation
