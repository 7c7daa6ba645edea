// How much of a long run is done, and how long the rest takes.
#pragma once

#include <array>
#include <cstddef>
#include <mutex>

namespace cosegraph::evaluation {

// Kinds of work in the order in which a category does them.
enum class Work { shape, view, model, query };
constexpr std::size_t kWorkKinds = 4;

// Thread-safe. The pieces of one kind are taken to cost the same as those of it that are done.
class Forecast {
 public:
  explicit Forecast(int jobs) : jobs_(jobs) {}

  // Adds to the pieces expected; less than zero where fewer turned up than were expected.
  void expect(Work kind, long pieces);
  void done(Work kind, double seconds);

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
  std::array<Tally, kWorkKinds> tally_;
  int jobs_;
};

}  // namespace cosegraph::evaluation
