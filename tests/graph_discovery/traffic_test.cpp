// Rates from the counters of processes and their own clocks.
#include "graph/traffic.hpp"

#include <gmock/gmock.h>

namespace cosegraph::graph {
namespace {

Observed status(std::int64_t milliseconds, std::uint64_t messages, std::uint64_t frames = 0) {
  Observed seen;
  seen.header.stamp = milliseconds * 1'000'000;
  seen.status.pid = 7;
  seen.status.frames_out = frames;
  seen.status.cpu_seconds = 1e-3 * static_cast<double>(milliseconds) / 2.0;
  seen.status.ports = {{.name = "out",
                        .topic = "g/a/out",
                        .output = true,
                        .messages = messages,
                        .bytes = 10 * messages},
                       {.name = "in", .topic = "g/b/out", .messages = 1000 * messages}};
  return seen;
}

TEST(Traffic, IsWhatWritersCountedOverTheTimeOfTheirClock) {
  const auto traffic = traffic_of({{"a", status(1000, 5)}}, {{"a", status(3000, 25)}});
  ASSERT_EQ(traffic.size(), 1U) << "inputs do not count";
  const TopicTraffic& topic = traffic.at("g/a/out");
  EXPECT_EQ(topic.messages, 25U);
  EXPECT_EQ(topic.bytes, 250U);
  EXPECT_DOUBLE_EQ(topic.rate, 10.0);
  EXPECT_DOUBLE_EQ(topic.byte_rate, 100.0);
  EXPECT_DOUBLE_EQ(topic.span, 2.0);
}

TEST(Traffic, OfReplicasIsTheSum) {
  const Look before{{"a.0", status(1000, 5)}, {"a.1", status(1500, 0)}};
  const Look now{{"a.0", status(2000, 15)}, {"a.1", status(2000, 10)}};
  EXPECT_EQ(traffic_of(before, now).at("g/a/out").messages, 25U);
  EXPECT_DOUBLE_EQ(traffic_of(before, now).at("g/a/out").rate, 10.0 + 20.0);
}

TEST(Traffic, HasNoRateWithoutTwoStatusesOfOneProcess) {
  const Look now{{"a", status(2000, 15)}};
  EXPECT_EQ(traffic_of({}, now).at("g/a/out").span, 0.0);
  EXPECT_EQ(traffic_of(now, now).at("g/a/out").span, 0.0) << "the same status twice";
  Look other{{"a", status(1000, 50)}};
  other["a"].status.pid = 8;
  EXPECT_EQ(traffic_of(other, now).at("g/a/out").span, 0.0) << "another process";
  Look younger{{"a", status(1000, 5)}};
  younger["a"].header.generation = 1;
  EXPECT_EQ(traffic_of(younger, now).at("g/a/out").span, 0.0) << "another generation";
  EXPECT_EQ(loads_of({}, now).at("a").span, 0.0);
}

TEST(Traffic, LoadIsFramesAndCpuPerSecond) {
  const auto loads = loads_of({{"a", status(1000, 0, 3)}}, {{"a", status(3000, 0, 13)}});
  EXPECT_DOUBLE_EQ(loads.at("a").rate, 5.0);
  EXPECT_DOUBLE_EQ(loads.at("a").cpu, 0.5);
}

}  // namespace
}  // namespace cosegraph::graph
