// Messages taken apart without generated code: the values are those that were encoded.
#include "idl/members.hpp"

#include <gmock/gmock.h>

#include <algorithm>

#include "core/error.hpp"
#include "idl/codec.hpp"

namespace cosegraph::idl {
namespace {

using testing::ElementsAre;

const FrameHeader kHeader{.graph = "g",
                          .stage = "camera",
                          .generation = 3,
                          .source = "s",
                          .epoch = ~0ULL,
                          .sequence = 42,
                          .stamp = -7,
                          .name = "mug 1"};

template <class Kind, class Value>
std::vector<Kind> values_of(const Value& value, const std::string& name) {
  for (const auto& member : members_of(type_name<Value>(), encode(kHeader, value)))
    if (member.name == name) return std::get<std::vector<Kind>>(member.values);
  ADD_FAILURE() << "no member " << name;
  return {};
}

template <class Value>
std::vector<std::string> names_of(const Value& value) {
  std::vector<std::string> names;
  for (const auto& member : members_of(type_name<Value>(), encode(kHeader, value)))
    if (!member.name.starts_with("header.")) names.push_back(member.name);
  return names;
}

TEST(Members, OfEveryKindOfNumberAndText) {
  const Labelling labelling{.label_names = {"body", "", "handle"},
                            .majority = 1,
                            .segment_label = {1, 0},
                            .segment_confidence = {0.5F, 0.25F},
                            .energy = -1.5,
                            .proven_optimal = true,
                            .violations = 3,
                            .expansions = 1LL << 40};
  EXPECT_THAT(values_of<std::string>(labelling, "header.name"), ElementsAre("mug 1"));
  EXPECT_THAT(values_of<std::uint64_t>(labelling, "header.generation"), ElementsAre(3));
  EXPECT_THAT(values_of<std::uint64_t>(labelling, "header.epoch"), ElementsAre(~0ULL));
  EXPECT_THAT(values_of<std::int64_t>(labelling, "header.stamp"), ElementsAre(-7));
  EXPECT_THAT(values_of<std::string>(labelling, "label_names"), ElementsAre("body", "", "handle"));
  EXPECT_THAT(values_of<std::int64_t>(labelling, "segment_label"), ElementsAre(1, 0));
  EXPECT_THAT(values_of<double>(labelling, "segment_confidence"), ElementsAre(0.5, 0.25));
  EXPECT_THAT(values_of<double>(labelling, "energy"), ElementsAre(-1.5));
  EXPECT_THAT(values_of<std::uint64_t>(labelling, "proven_optimal"), ElementsAre(1));
  EXPECT_THAT(values_of<std::int64_t>(labelling, "expansions"), ElementsAre(1LL << 40));
}

TEST(Members, OfArraysAndNestedStructs) {
  const Cloud cloud{.xyz = {1, 2, 3}, .origin = {0.5F, 0, -1}, .width = 1, .height = 1};
  EXPECT_THAT(values_of<double>(cloud, "origin"), ElementsAre(0.5, 0, -1));
  EXPECT_THAT(values_of<double>(cloud, "normal"), ElementsAre());
  const Descriptors descriptors{
      .recipe = "r", .channels = {{"fpfh", 2, {0, 5}, {1, 2, 3, 4}}, {"shot", 1, {7}, {9}}}};
  EXPECT_THAT(values_of<double>(descriptors, "channels[1].values"), ElementsAre(9));
  EXPECT_THAT(names_of(descriptors),
              ElementsAre("recipe", "channels[0].name", "channels[0].dimension",
                          "channels[0].keypoint", "channels[0].values", "channels[1].name",
                          "channels[1].dimension", "channels[1].keypoint", "channels[1].values"));
  const RelationModel relations{.id = 7, .label_names = {"a", "b"}, .neighbours = {1, 0, 0, 1}};
  EXPECT_THAT(values_of<std::uint64_t>(relations, "neighbours"), ElementsAre(1, 0, 0, 1));
}

TEST(Members, OfTruncatedMessagesAreRefused) {
  const Bytes bytes = encode(
      kHeader,
      StageStatus{.kind = "cpc", .activity = "x", .ports = {{.name = "out"}, {.name = "in"}}});
  ASSERT_NO_THROW(members_of("StageStatus", bytes));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(members_of("StageStatus", std::span(bytes).first(size)), InputError) << size;
}

TEST(Members, NoDamagedByteDoesHarm) {
  const Bytes bytes =
      encode(kHeader, Descriptors{.recipe = "r", .channels = {{"fpfh", 2, {0, 5}, {1, 2, 3, 4}}}});
  for (std::size_t i = 0; i < bytes.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      Bytes damaged = bytes;
      damaged[i] ^= static_cast<std::uint8_t>(1U << bit);
      try {
        members_of("Descriptors", damaged);
      } catch (const InputError&) {
        continue;
      }
    }
}

TEST(Members, OfUnknownTypesAreRefused) {
  EXPECT_THROW(members_of("Teapot", encode(kHeader, StreamEnd{1})), InputError);
}

// The other byte order: every number of the message reversed.
TEST(Members, OfBigEndianMessages) {
  const Bytes bytes{0, 0, 0, 0,                 // big endian
                    0, 0, 0, 2, 'g', 0,         // graph
                    0, 0, 0, 0, 0,   1, 0,      // padding, stage ""
                    0, 0, 0, 0, 0,   0, 9,      // padding, generation
                    0, 0, 0, 1, 0,              // source ""
                    0, 0, 0, 0, 0,   0, 0,      // padding
                    0, 0, 0, 0, 0,   0, 1, 2,   // epoch
                    0, 0, 0, 0, 0,   0, 0, 3,   // sequence
                    0, 0, 0, 0, 0,   0, 0, 4,   // stamp
                    0, 0, 0, 0, 0,   0, 0, 5,   // model
                    0, 0, 0, 1, 0,   0, 0, 0,   // name "", padding
                    0, 0, 0, 0, 0,   0, 0, 6};  // count
  const FrameHeader header = decode_header(bytes);
  ASSERT_EQ(header.epoch, 0x102U);
  const auto members = members_of("StreamEnd", bytes);
  EXPECT_EQ(members.back().name, "count");
  EXPECT_THAT(std::get<std::vector<std::uint64_t>>(members.back().values),
              ElementsAre(decode<StreamEnd>(bytes).count));
}

TEST(Members, BooleansAreOneOrZero) {
  const Bytes no = encode(kHeader, Labelling{});
  Bytes bytes = encode(kHeader, Labelling{.proven_optimal = true});
  ASSERT_EQ(bytes.size(), no.size());
  const auto [octet, other] = std::ranges::mismatch(bytes, no);
  ASSERT_NE(octet, bytes.end());
  *octet = 7;
  std::vector<std::uint64_t> values;
  for (const auto& member : members_of("Labelling", bytes))
    if (member.name == "proven_optimal")
      values = std::get<std::vector<std::uint64_t>>(member.values);
  EXPECT_THAT(values, ElementsAre(1));
}

// As of a hostile message: a matrix whose columns nobody has named.
TEST(Members, OfAMatrixWithoutColumnsAreAList) {
  const Scores odd{.segment_count = 1, .probability = {0.5F, 0.25F}};
  EXPECT_THAT(values_of<double>(odd, "probability"), ElementsAre(0.5, 0.25));
}

}  // namespace
}  // namespace cosegraph::idl
