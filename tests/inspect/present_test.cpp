// What people and programs are shown of a message.
#include "idl/present.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "inspect/examples.hpp"

namespace cosegraph::idl {
namespace {

using Json = nlohmann::ordered_json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

template <class Value>
std::string text_of(const Value& value, const std::string& path = "", Presentation how = {}) {
  const Bytes bytes = encode(test::kHeader, value);
  return to_text(select(inspect(type_name<Value>(), bytes), path), how);
}

template <class Value>
Json json_of(const Value& value, Presentation how = {}) {
  const Bytes bytes = encode(test::kHeader, value);
  return to_json(inspect(type_name<Value>(), bytes), how);
}

TEST(Present, CloudAsText) {
  EXPECT_EQ(text_of(test::example_cloud()), R"(header:
  graph: segment
  stage: camera
  generation: 3
  source: camera
  epoch: 12345678901234
  sequence_number: 42
  stamp: 1700000000250000000  # 2023-11-14T22:13:20.250Z
  model_id: 18364758544493064720
  name: mug 1
xyz: 4 x 3 floats, [0 .. 9] x [1 .. 10] x [2 .. 11]
normal: []
rgb: []
label: [1, -1, 0, 0]
label_names: [body, handle]
origin: [0.5, 0, -1]
scale: 0.1
recipe: spacing=0.014
dense_index: []
notes: [reduced]
width: 4
height: 1
frame_id: ""
stamp: 0  # 1970-01-01T00:00:00.000Z
)");
}

// Zeros do not travel, but are shown.
TEST(Present, PackedNumbersAsTheyWere) {
  Descriptors descriptors{.recipe = "r"};
  auto& channel = descriptors.channels.emplace_back(
      DescriptorChannel{.name = "fpfh:0.08", .dimension = 33, .keypoint = {3, 9}});
  channel.value.resize(66);
  channel.value[7] = 0.5F;
  channel.value[65] = 2.0F;
  const std::string text = text_of(descriptors);
  EXPECT_THAT(text, HasSubstr("values: 2 x 33 floats, [0 .. 2]\n"));
  EXPECT_THAT(text, Not(HasSubstr("runs")));
  EXPECT_THAT(text_of(descriptors, "channels[0].values[65]"), HasSubstr("2"));
  const Json json = json_of(descriptors, {.whole = true});
  EXPECT_EQ(json["channels"][0]["values"].size(), 66U);
  EXPECT_EQ(json["channels"][0]["values"][7], 0.5);
  EXPECT_THAT(text_of(Encodings{.segment_count = 1,
                                .dimension = 6,
                                .segment = {0, 0},
                                .value = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3}}),
              HasSubstr("values: 2 x 6 floats, [0 .. 3]\n"));
}

TEST(Present, RangesOfColumnsOfAnyNumber) {
  for (std::int32_t columns = 1; columns <= 5; ++columns) {
    Descriptors descriptors{.recipe = "r"};
    auto& channel =
        descriptors.channels.emplace_back(DescriptorChannel{.name = "any", .dimension = columns});
    for (int row = 0; row < 31; ++row) {
      channel.keypoint.push_back(row);
      for (int c = 0; c < columns; ++c)
        channel.value.push_back(static_cast<float>(10 * c + (row == 17 ? 9 : row % 4)));
    }
    const Bytes bytes = encode(test::kHeader, descriptors);
    const Summary summary = summary_of(select(inspect("Descriptors", bytes), "channels[0].values"));
    EXPECT_EQ(summary.columns, static_cast<std::size_t>(columns));
    if (columns == 5) {
      EXPECT_THAT(summary.least, ElementsAre(0));
      EXPECT_THAT(summary.greatest, ElementsAre(49));
      continue;
    }
    ASSERT_EQ(summary.least.size(), static_cast<std::size_t>(columns));
    for (std::size_t c = 0; c < summary.least.size(); ++c) {
      EXPECT_EQ(summary.least[c], 10.0 * static_cast<double>(c)) << columns;
      EXPECT_EQ(summary.greatest[c], 10.0 * static_cast<double>(c) + 9.0) << columns;
    }
  }
}

TEST(Present, WholeMatricesHaveALinePerRow) {
  EXPECT_THAT(text_of(test::example_cloud(), "", {.whole = true}),
              HasSubstr("xyz:\n  - [0, 1, 2]\n  - [3, 4, 5]\n"));
  EXPECT_EQ(text_of(test::example_cloud(), "xyz", {.whole = true}),
            "- [0, 1, 2]\n- [3, 4, 5]\n- [6, 7, 8]\n- [9, 10, 11]\n");
}

TEST(Present, ListsOfStructures) {
  EXPECT_EQ(text_of(test::example_descriptors(), "channels"), R"(- name: fpfh:0.08
  dimension: 2
  keypoint: [0, 5]
  values:
    - [1, 2]
    - [3, 4]
- name: shot:0.13
  dimension: 1
  keypoint: [7]
  values: [9]
)");
  EXPECT_THAT(text_of(test::example_status(), "ports", {.longest = 1}), HasSubstr("# 1 more"));
}

TEST(Present, OneField) {
  EXPECT_EQ(text_of(test::example_cloud(), "header.stage"), "camera\n");
  EXPECT_EQ(text_of(test::example_cloud(), "xyz[2]"), "2\n");
}

TEST(Present, LongListsOfTextsAreCut) {
  const LogLines log{.lines = std::vector<std::string>(40, "line")};
  EXPECT_THAT(text_of(log, "lines", {.longest = 2}), "[line, line]  # the first of 40\n");
}

TEST(Present, HostileTextsDoNotReachTheTerminal) {
  const std::string text = text_of(FrameFailure{"a\x1b[2J\nb: \xff\"c"}, "reason");
  EXPECT_THAT(text, Not(HasSubstr("\x1b")));
  EXPECT_EQ(text, "\"a\\u001b[2J\\nb: \\ufffd\\\"c\"\n");
  EXPECT_EQ(text_of(FrameFailure{"true"}, "reason"), "\"true\"\n") << "is not a boolean";
  EXPECT_EQ(text_of(FrameFailure{"12"}, "reason"), "\"12\"\n") << "is not a number";
  EXPECT_EQ(text_of(FrameFailure{""}, "reason"), "\"\"\n");
}

TEST(Present, NansAreCountedAndTakenOutOfTheRange) {
  Cloud cloud;
  for (int i = 0; i < 10; ++i) {
    const float gap = i == 3 ? NAN : static_cast<float>(i);
    cloud.xyz.insert(cloud.xyz.end(), {gap, 2.0F, -1.0F});
  }
  cloud.normal.assign(30, NAN);
  EXPECT_THAT(text_of(cloud), HasSubstr("10 x 3 floats, [0 .. 9] x [2 .. 2] x [-1 .. -1], 1 NaN"));
  EXPECT_THAT(text_of(cloud), HasSubstr("normal: 10 x 3 floats, 30 NaN"));
  const Json json = json_of(cloud);
  EXPECT_EQ(json["xyz"], Json::parse(R"({"count": 30, "rows": 10, "columns": 3, "nan": 1,
                            "min": [0.0, 2.0, -1.0], "max": [9.0, 2.0, -1.0]})"));
  EXPECT_TRUE(json_of(cloud, {.whole = true})["xyz"][9].is_null());
}

TEST(Present, EveryTypeAsJsonKeepsEveryMember) {
  for (const auto& [type, bytes] : test::examples()) {
    const Node root = inspect(type, bytes);
    const Json json = Json::parse(to_json(root, {.whole = true}).dump());
    ASSERT_EQ(json.size(), root.members.size()) << type;
    for (const auto& member : root.members) {
      ASSERT_TRUE(json.contains(std::string(member.name))) << type << "." << member.name;
      const Json& value = json[std::string(member.name)];
      EXPECT_EQ(value.is_array() ? value.size() : 1U, member.size()) << type << member.name;
    }
    EXPECT_EQ(json["header"]["model_id"], 0xfedcba9876543210ULL) << type;
    EXPECT_FALSE(to_text(root, {.whole = true}).empty()) << type;
  }
}

TEST(Present, NumbersAreExactInJson) {
  const Json json = json_of(test::example_cloud(), {.whole = true});
  EXPECT_EQ(json["scale"].dump(), "0.1");
  EXPECT_EQ(json["xyz"].size(), 12U);
  EXPECT_EQ(json["label"], Json::parse("[1, -1, 0, 0]"));
  const Json status = json_of(test::example_status());
  EXPECT_EQ(status["ports"][0]["output"], true);
  EXPECT_EQ(status["ports"][0]["bytes"], 99);
  EXPECT_EQ(status["state"], "working");
}

TEST(Present, TextsThatAreNoUtf8StayJson) {
  const Bytes bytes = encode(test::kHeader, FrameFailure{"\xff\xfe"});
  const Json json = to_json(inspect("FrameFailure", bytes), {});
  EXPECT_NO_THROW(json.dump());
}

}  // namespace
}  // namespace cosegraph::idl
