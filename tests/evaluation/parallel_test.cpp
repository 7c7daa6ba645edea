#include "tools/evaluation/parallel.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

#include "tools/evaluation/forecast.hpp"

namespace cosegraph::evaluation {
namespace {

TEST(Parallel, EveryPieceIsDoneOnceWhateverTheNumberOfThreads) {
  for (const int jobs : {0, 1, 2, 7, 100}) {
    std::vector<std::atomic<int>> calls(50);
    EXPECT_TRUE(parallel_for(calls.size(), jobs, {}, [&](std::size_t i) { ++calls[i]; }));
    for (const auto& count : calls) EXPECT_EQ(count, 1);
  }
}

TEST(Parallel, NothingToDoIsComplete) {
  EXPECT_TRUE(parallel_for(
      0, 3, [] { return true; }, [](std::size_t) { FAIL(); }));
}

TEST(Parallel, StoppingStartsNoFurtherPiece) {
  std::atomic<int> calls = 0;
  EXPECT_FALSE(parallel_for(
      100, 1, [&] { return calls == 3; }, [&](std::size_t) { ++calls; }));
  EXPECT_EQ(calls, 3);
}

TEST(Parallel, AnExceptionEndsTheWorkAndArrives) {
  std::atomic<int> calls = 0;
  const auto body = [&](std::size_t i) {
    ++calls;
    if (i == 5) throw std::runtime_error("piece 5");
  };
  EXPECT_THROW(parallel_for(1000, 1, {}, body), std::runtime_error);
  EXPECT_EQ(calls, 6);
  EXPECT_THROW(parallel_for(1000, 3, {}, body), std::runtime_error);
}

TEST(Forecast, TheTimeLeftIsThePiecesLeftAtTheMeanCostSharedByTheThreads) {
  Forecast forecast(2);
  EXPECT_EQ(forecast.seconds_left(), 0.0);
  forecast.expect(Piece::view, 10000);
  for (int i = 0; i < 5000; ++i) forecast.done(Piece::view, 4.0);
  EXPECT_NEAR(forecast.seconds_left(), 5000 * 4.0 / 2, 10.0);
  EXPECT_NEAR(forecast.fraction(), 0.5, 1e-9);
  forecast.expect(Piece::view, -5000);
  EXPECT_EQ(forecast.seconds_left(), 0.0);
  EXPECT_EQ(forecast.fraction(), 1.0);
}

}  // namespace
}  // namespace cosegraph::evaluation
