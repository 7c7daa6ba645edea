#include "tools/monitor/outbox.hpp"

#include <gmock/gmock.h>

#include <random>

namespace cosegraph::monitor {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

constexpr std::size_t kHead = std::tuple_size_v<MessageHead>;

Message message(std::size_t size, std::uint64_t time = 0, bool keep = false) {
  return {.time = time, .payload = std::make_shared<const idl::Bytes>(size - kHead), .keep = keep};
}

TEST(Outbox, GivesInTheOrderItTook) {
  Outbox outbox(1000);
  outbox.push("hello");
  outbox.push(7, message(100, 1));
  EXPECT_EQ(outbox.bytes(), 105U);
  EXPECT_EQ(outbox.pop()->text, "hello");
  const auto second = outbox.pop();
  EXPECT_EQ(second->subscription, 7U);
  EXPECT_EQ(second->head, message_head(7, 1));
  EXPECT_FALSE(outbox.pop().has_value());
  EXPECT_EQ(outbox.bytes(), 0U);
  EXPECT_THAT(outbox.dropped(), IsEmpty());
}

TEST(Outbox, TheOldestGoesFirstAndIsCounted) {
  Outbox outbox(300);
  outbox.push(1, message(100, 1));
  outbox.push(2, message(100, 2));
  outbox.push("news");
  outbox.push(1, message(200, 3));
  EXPECT_THAT(outbox.dropped(), ElementsAre(Pair(1, 1)));
  outbox.push(1, message(200, 4));
  EXPECT_THAT(outbox.dropped(), ElementsAre(Pair(1, 2), Pair(2, 1)));
  EXPECT_EQ(outbox.pop()->text, "news");
  EXPECT_EQ(outbox.pop()->head, message_head(1, 4));
  EXPECT_TRUE(outbox.empty());
}

TEST(Outbox, OneMessageIsHeldWhateverItsSize) {
  Outbox outbox(50);
  outbox.push(1, message(500));
  EXPECT_EQ(outbox.bytes(), 500U);
  EXPECT_THAT(outbox.dropped(), IsEmpty());
}

TEST(Outbox, WhatIsKeptTakesNoRoomFromTheRest) {
  Outbox outbox(100);
  for (int i = 0; i < 5; ++i) outbox.push(1, message(100, 0, true));
  outbox.push(2, message(100, 6));
  EXPECT_THAT(outbox.dropped(), IsEmpty());
  EXPECT_EQ(outbox.bytes(), 600U);
}

TEST(Outbox, AClientThatNeverReadsIsHopelessInTheEnd) {
  Outbox outbox(100);
  for (int i = 0; i < 1000; ++i) outbox.push(1, message(100));
  EXPECT_FALSE(outbox.is_hopeless());
  for (int i = 0; i < 20; ++i) outbox.push(std::string(100, 'x'));
  EXPECT_TRUE(outbox.is_hopeless());
}

TEST(Outbox, ForgetsOneSubscription) {
  Outbox outbox(1000);
  outbox.push(1, message(100));
  outbox.push(2, message(100, 0, true));
  outbox.push(1, message(100));
  outbox.push("news");
  outbox.forget(1);
  EXPECT_EQ(outbox.pop()->subscription, 2U);
  EXPECT_EQ(outbox.pop()->text, "news");
  EXPECT_TRUE(outbox.empty());
}

// Any sequence of calls: the bound holds, no message is both given and dropped, none is lost
// without being counted.
TEST(Outbox, AccountsForEveryMessage) {
  std::mt19937 random(1);
  Outbox outbox(1000);
  std::map<std::uint32_t, std::uint64_t> pushed;
  std::map<std::uint32_t, std::uint64_t> given;
  for (int step = 0; step < 20000; ++step) {
    if (random() % 3 != 0) {
      const std::uint32_t subscription = random() % 4;
      outbox.push(subscription, message(20 + random() % 300));
      ++pushed[subscription];
    } else if (const auto item = outbox.pop()) {
      ++given[item->subscription];
    }
    ASSERT_LE(outbox.bytes(), 1000U);
  }
  while (const auto item = outbox.pop()) ++given[item->subscription];
  for (const auto& [subscription, count] : pushed)
    EXPECT_EQ(given[subscription] + outbox.dropped().at(subscription), count);
}

}  // namespace
}  // namespace cosegraph::monitor
