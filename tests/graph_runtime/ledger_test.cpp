#include "graph/ledger.hpp"

#include <gtest/gtest.h>

#include "core/random.hpp"

namespace cosegraph::graph {
namespace {

using idl::Outcome;
using namespace std::chrono_literals;

idl::FrameHeader frame(std::uint64_t sequence) {
  return {.epoch = 1, .sequence = sequence};
}

TEST(Ledger, FrameIsOpenUntilEveryLeafHasReported) {
  Ledger ledger({"sink", "recorder"}, 4);
  ledger.admit(frame(0), Clock::now());
  ledger.done("sink", frame(0), {Outcome::labelled});
  EXPECT_EQ(ledger.in_flight(), 1U);
  ledger.done("sink", frame(0), {Outcome::labelled});
  EXPECT_EQ(ledger.in_flight(), 1U) << "one leaf reporting twice is not two leaves";
  ledger.done("recorder", frame(0), {Outcome::consumed});
  EXPECT_EQ(ledger.in_flight(), 0U);
  EXPECT_EQ(ledger.account().labelled, 1U);
}

TEST(Ledger, OneFailedLeafFailsTheFrame) {
  Ledger ledger({"sink", "recorder"}, 4);
  ledger.admit(frame(0), Clock::now());
  ledger.done("sink", frame(0), {Outcome::failed, "cpc", "why"});
  ledger.done("recorder", frame(0), {Outcome::consumed});
  EXPECT_EQ(ledger.account().failed, 1U);
  EXPECT_EQ(ledger.account().consumed, 0U);
}

// A stranger can claim a frame before the source has come to it.
TEST(Ledger, ReportsThatComeEarlyHoldForTheirFrame) {
  Ledger ledger({"sink", "recorder"}, 4);
  ledger.done("sink", frame(1), {Outcome::failed, "cpc", "why"});
  ledger.done("sink", frame(100), {Outcome::failed, "cpc", "too far ahead"});
  for (std::uint64_t i = 0; i < 2; ++i) {
    ledger.admit(frame(i), Clock::now());
    ledger.done("recorder", frame(i), {Outcome::labelled});
  }
  EXPECT_EQ(ledger.open(), std::vector<std::uint64_t>{0});
  EXPECT_EQ(ledger.account().failed, 1U);
  ledger.admit(frame(100), Clock::now());
  ledger.done("recorder", frame(100), {Outcome::labelled});
  EXPECT_EQ(ledger.open(), (std::vector<std::uint64_t>{0, 100}));
}

// admitted = labelled + consumed + failed + in flight, at every moment and for any order.
TEST(Ledger, AccountClosesAtEveryMoment) {
  Random random(3);
  Ledger ledger({"a", "b"}, 5);
  std::uint64_t next = 0;
  for (int step = 0; step < 3000; ++step) {
    if (ledger.has_room() && random.below(2) == 0) ledger.admit(frame(next++), Clock::now());
    const auto outcome =
        std::array{Outcome::labelled, Outcome::consumed, Outcome::failed}[random.below(3)];
    ledger.done(random.below(2) == 0 ? "a" : "b", frame(random.below(next + 2)), {outcome});
    const idl::Account& account = ledger.account();
    ASSERT_EQ(account.admitted,
              account.labelled + account.consumed + account.failed + ledger.in_flight());
    ASSERT_LE(ledger.in_flight(), ledger.window());
  }
  EXPECT_GT(ledger.account().labelled, 0U);
  EXPECT_GT(ledger.account().failed, 0U);
}

TEST(Ledger, OverdueFramesAreNamedOnceAndCanBeAbandoned) {
  Ledger ledger({"sink"}, 4);
  const auto start = Clock::now();
  ledger.admit(frame(0), start);
  ledger.admit(frame(1), start + 10s);
  const auto overdue = ledger.overdue(start + 5s);
  ASSERT_EQ(overdue.size(), 1U);
  EXPECT_EQ(overdue[0].sequence, 0U);
  EXPECT_TRUE(ledger.overdue(start + 5s).empty());
  ledger.abandon(overdue[0]);
  EXPECT_EQ(ledger.account().failed, 1U);
  ledger.done("sink", frame(0), {Outcome::labelled});
  EXPECT_EQ(ledger.account().labelled, 0U) << "too late";
}

TEST(Ledger, StrangersReportsCountForNothing) {
  Ledger ledger({"sink"}, 4);
  ledger.admit(frame(0), Clock::now());
  ledger.done("stranger", frame(0), {Outcome::labelled});
  ledger.done("sink", frame(99), {Outcome::labelled});
  EXPECT_EQ(ledger.in_flight(), 1U);
}

TEST(Ledger, StreamIsOverWhenFramesAndLeavesAre) {
  Ledger ledger({"a", "b"}, 4);
  ledger.admit(frame(0), Clock::now());
  ledger.done("a", frame(1), {Outcome::ended});
  ledger.done("b", frame(1), {Outcome::ended, "b", "disk full"});
  EXPECT_FALSE(ledger.ended());
  ledger.done("a", frame(0), {Outcome::consumed});
  ledger.done("b", frame(0), {Outcome::consumed});
  EXPECT_TRUE(ledger.ended());
  EXPECT_EQ(ledger.end_failure(), "disk full");
}

}  // namespace
}  // namespace cosegraph::graph
