// Which writers and readers DDS lets talk, and what is said about those that it does not.
#include "graph/matching.hpp"

#include <gmock/gmock.h>

namespace cosegraph::graph {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::StartsWith;

const Endpoint kWriter{.is_writer = true,
                       .topic = "g/s/out",
                       .type = "cosegraph::msg::Cloud",
                       .partitions = {"g.1"},
                       .qos = {.durability = Durability::transient_local}};

Endpoint reader() {
  Endpoint endpoint = kWriter;
  endpoint.is_writer = false;
  return endpoint;
}

TEST(Matching, AReaderMayAskForLess) {
  EXPECT_THAT(mismatches(kWriter, reader()), IsEmpty());
  Endpoint modest = reader();
  modest.qos.reliable = false;
  modest.qos.durability = Durability::volatile_;
  EXPECT_THAT(mismatches(kWriter, modest), IsEmpty());
  Endpoint strict = kWriter;
  strict.qos.deadline = 0.5;
  strict.qos.liveliness = Liveliness::manual_by_topic;
  strict.qos.lease = 1.0;
  EXPECT_THAT(mismatches(strict, reader()), IsEmpty());
}

TEST(Matching, EveryPolicyThatAsksForMoreIsNamed) {
  Endpoint demanding = reader();
  demanding.type = "cosegraph::msg::Segments";
  demanding.keyed = true;
  demanding.partitions = {"g.2"};
  demanding.qos = {.durability = Durability::persistent,
                   .liveliness = Liveliness::manual_by_topic,
                   .lease = 1.0,
                   .deadline = 0.5,
                   .exclusive = true};
  Endpoint lax = kWriter;
  lax.qos.reliable = false;
  EXPECT_THAT(
      mismatches(lax, demanding),
      ElementsAre("type: the writer has cosegraph::msg::Cloud, the reader "
                  "cosegraph::msg::Segments",
                  StartsWith("keys: "), "partition: the writer is in 'g.1', the reader in 'g.2'",
                  "reliability: the writer offers best_effort, the reader requests "
                  "reliable",
                  "durability: the writer offers transient_local, the reader requests "
                  "persistent",
                  "deadline: the writer offers no limit, the reader requests 0.5 s",
                  "ownership: the writer offers shared, the reader requests exclusive",
                  "liveliness: the writer offers automatic, the reader requests "
                  "manual_by_topic",
                  "lease of liveliness: the writer offers no limit, the reader requests "
                  "1 s"));
}

TEST(Matching, PartitionsMatchByPattern) {
  Endpoint any = reader();
  any.partitions = {"other", "g.*"};
  EXPECT_THAT(mismatches(kWriter, any), IsEmpty());
  Endpoint none = reader();
  none.partitions = {};
  EXPECT_THAT(mismatches(kWriter, none),
              ElementsAre("partition: the writer is in 'g.1', the reader in none"));
  Endpoint bare = kWriter;
  bare.partitions = {};
  none.partitions = {""};
  EXPECT_THAT(mismatches(bare, none), IsEmpty()) << "no partition and the one without a name";
}

TEST(Matching, OffersAreShownOnOneLine) {
  EXPECT_EQ(to_text(kWriter.qos), "reliable, transient_local");
  EXPECT_EQ(to_text(Offer{.reliable = false,
                          .liveliness = Liveliness::manual_by_topic,
                          .lease = 0.2,
                          .deadline = 1.5,
                          .exclusive = true}),
            "best_effort, volatile, deadline 1.5 s, liveliness manual_by_topic 0.2 s, exclusive");
}

TEST(Matching, EveryEnumValueHasAName) {
  for (const auto& [value, name] : names<Durability>())
    EXPECT_EQ(from_name<Durability>(name), value);
  for (const auto& [value, name] : names<Liveliness>())
    EXPECT_EQ(from_name<Liveliness>(name), value);
}

}  // namespace
}  // namespace cosegraph::graph
