// Messages are taken apart as they were encoded, and hostile ones are refused.
#include "idl/inspect.hpp"

#include <gmock/gmock.h>

#include <random>

#include "core/error.hpp"
#include "inspect/examples.hpp"

namespace cosegraph::idl {
namespace {

using test::examples;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

// Keeps the bytes that the tree refers to.
struct Opened {
  template <class Value>
  explicit Opened(const Value& value)
      : bytes(encode(test::kHeader, value)), root(inspect(type_name<Value>(), bytes)) {}
  Bytes bytes;
  Node root;

  template <class T>
  std::vector<T> numbers(std::string_view path) const {
    const Node node = select(root, path);
    std::vector<T> values;
    for (std::size_t i = 0; i < node.size(); ++i) values.push_back(std::get<T>(node.number(i)));
    return values;
  }
};

std::string refusal(const Node& root, const std::string& path) {
  try {
    select(root, path);
  } catch (const ParameterError& error) {
    return error.what();
  }
  ADD_FAILURE() << path << " was found";
  return "";
}

TEST(Inspect, ReadsEveryTypeThatTravelsToItsLastByte) {
  const auto all = examples();
  ASSERT_EQ(all.size(), type_names().size());
  for (const auto& [type, bytes] : all) {
    const Node root = inspect(type, bytes);
    EXPECT_EQ(root.members.front().name, "header") << type;
    EXPECT_EQ(select(root, "header.name").texts[0], "mug 1") << type;
    for (std::size_t size = 0; size < bytes.size(); ++size)
      EXPECT_THROW(inspect(type, std::span(bytes).first(size)), InputError) << type << size;
  }
}

TEST(Inspect, GivesEveryKindOfValue) {
  const Opened labelling(Labelling{.label_names = {"body", "", "handle"},
                                   .majority = 1,
                                   .segment_label = {1, 0},
                                   .segment_confidence = {0.5F, 0.25F},
                                   .energy = -1.5,
                                   .proven_optimal = true,
                                   .expansions = -(1LL << 40)});
  EXPECT_THAT(labelling.numbers<std::uint64_t>("header.generation"), ElementsAre(3U));
  EXPECT_THAT(labelling.numbers<std::uint64_t>("header.model_id"),
              ElementsAre(0xfedcba9876543210ULL));
  EXPECT_THAT(select(labelling.root, "label_names").texts, ElementsAre("body", "", "handle"));
  EXPECT_THAT(labelling.numbers<std::int64_t>("segment_label"), ElementsAre(1, 0));
  EXPECT_THAT(labelling.numbers<float>("segment_confidence"), ElementsAre(0.5F, 0.25F));
  EXPECT_THAT(labelling.numbers<double>("energy"), ElementsAre(-1.5));
  EXPECT_THAT(labelling.numbers<bool>("proven_optimal"), ElementsAre(true));
  EXPECT_THAT(labelling.numbers<std::int64_t>("expansions"), ElementsAre(-(1LL << 40)));
  const Opened relations(RelationModel{.id = 1, .label_names = {"a"}, .neighbours = {200}});
  EXPECT_THAT(relations.numbers<std::uint64_t>("neighbours"), ElementsAre(200U));
}

TEST(Inspect, ReadsTheOtherByteOrder) {
  // FrameFailure: four texts and numbers of 4 and 8 bytes, written by hand as big endian.
  Bytes bytes{0, 0, 0, 0};
  const auto align = [&](std::size_t to) {
    while ((bytes.size() - 4) % to != 0) bytes.push_back(0);
  };
  const auto number = [&](std::uint64_t value, std::size_t size) {
    align(size);
    for (std::size_t i = size; i-- > 0;) bytes.push_back(static_cast<std::uint8_t>(value >> 8 * i));
  };
  const auto text = [&](const std::string& value) {
    number(value.size() + 1, 4);
    for (const char c : value) bytes.push_back(static_cast<std::uint8_t>(c));
    bytes.push_back(0);
  };
  text("g");
  text("s");
  number(3, 4);
  text("source");
  for (const std::uint64_t value : {7ULL, 8ULL, 9ULL, 10ULL}) number(value, 8);
  text("frame");
  text("why");
  const Node root = inspect("FrameFailure", bytes);
  EXPECT_EQ(std::get<std::uint64_t>(select(root, "header.sequence_number").number(0)), 8U);
  EXPECT_EQ(std::get<std::int64_t>(select(root, "header.stamp").number(0)), 9);
  EXPECT_EQ(select(root, "reason").texts[0], "why");
}

TEST(Inspect, FindsMatricesByTheCommentsOfTheIdl) {
  EXPECT_EQ(select(Opened(test::example_cloud()).root, "xyz").columns, 3U);
  EXPECT_EQ(select(Opened(test::example_cloud()).root, "label").columns, 1U);
  EXPECT_EQ(select(Opened(test::example_cloud()).root, "normal").columns, 1U) << "is empty";
  const Opened descriptors(test::example_descriptors());
  EXPECT_EQ(select(descriptors.root, "channels[0].values").columns, 2U);
  const auto all = examples();
  EXPECT_EQ(select(inspect("Scores", all.at("Scores")), "probability").columns, 2U);
  EXPECT_EQ(select(inspect("Spectrum", all.at("Spectrum")), "eigenfunction").columns, 3U);
  EXPECT_EQ(select(inspect("RelationModel", all.at("RelationModel")), "neighbours").columns, 2U);
}

TEST(Inspect, ColumnsThatDoNotFitAreNone) {
  Descriptors descriptors{.recipe = "r", .channels = {{"c", 3, {0}, {1, 2}}}};
  EXPECT_EQ(select(Opened(descriptors).root, "channels[0].values").columns, 1U);
  descriptors.channels[0] = {"c", -3, {0}, {1, 2, 3}};
  EXPECT_EQ(select(Opened(descriptors).root, "channels[0].values").columns, 1U);
}

TEST(Inspect, SelectsByPath) {
  const Opened status(test::example_status());
  EXPECT_EQ(select(status.root, "").members.size(), status.root.members.size());
  EXPECT_EQ(select(status.root, "ports[1].topic").texts[0], "g/m/model");
  EXPECT_THAT(select(status.root, "ports").members, SizeIs(2));
  const Node port = select(status.root, "ports[0]");
  EXPECT_FALSE(port.is_list);
  EXPECT_EQ(port.members.front().texts[0], "dense");
  const Opened cloud(test::example_cloud());
  EXPECT_EQ(select(cloud.root, "xyz[7]").as_double(0), 7.0);
  EXPECT_EQ(select(cloud.root, "label_names[1]").texts[0], "handle");
}

TEST(Inspect, SaysWhatThereIsInsteadOfAnUnknownPath) {
  const Opened status(test::example_status());
  EXPECT_THAT(refusal(status.root, "header.stagg"), HasSubstr("did you mean 'stage'?"));
  EXPECT_THAT(refusal(status.root, "nothing"), HasSubstr("there are: header, kind, host"));
  EXPECT_THAT(refusal(status.root, "ports.name"), HasSubstr("'ports[0]'"));
  EXPECT_THAT(refusal(status.root, "ports[2]"), HasSubstr("2 values"));
  EXPECT_THAT(refusal(status.root, "ports[-1]"), HasSubstr("2 values"));
  EXPECT_THAT(refusal(status.root, "kind[0]"), HasSubstr("no index"));
  EXPECT_THAT(refusal(status.root, "kind.x"), HasSubstr("nothing is inside 'kind'"));
}

TEST(Inspect, RefusesWhatIsNoMessageOfOurs) {
  const Bytes bytes = examples().at("Cloud");
  EXPECT_THROW(inspect("Teapot", bytes), InputError);
  EXPECT_THROW(inspect("FrameHeader", bytes), InputError) << "does not travel alone";
  EXPECT_THROW(inspect_wire("std_msgs::msg::dds_::String_", bytes), InputError);
  EXPECT_NO_THROW(inspect_wire("cosegraph::msg::Cloud", bytes));
}

// Walks over everything, as who prints or compares a message does.
void touch(const Node& node) {
  double sum = 0.0;
  if (node.is_number())
    for (std::size_t i = 0; i < node.size(); ++i) sum += node.as_double(i);
  for (const auto text : node.texts) sum += text.empty() ? 0.0 : text.front() + text.back();
  for (const auto& member : node.members) touch(member);
  EXPECT_NE(sum, 0.123456789);
}

TEST(Inspect, DamagedMessagesAreReadOrRefused) {
  std::mt19937 random(1);
  int read = 0;
  int refused = 0;
  for (const auto& [type, bytes] : examples()) {
    for (int i = 0; i < 400; ++i) {
      Bytes damaged = bytes;
      for (int k = 0; k < 1 + i % 4; ++k)
        damaged[random() % damaged.size()] =
            static_cast<std::uint8_t>(i % 3 == 0 ? 0xff : random());
      try {
        touch(inspect(type, damaged));
        ++read;
      } catch (const InputError&) {
        ++refused;
      }
    }
  }
  EXPECT_GT(read, 100);
  EXPECT_GT(refused, 100);
}

TEST(Inspect, NothingIsAllocatedForAClaim) {
  // Every length of four bytes in turn claims four thousand million elements.
  for (const auto& [type, bytes] : examples())
    for (std::size_t at = 4; at + 4 <= bytes.size(); at += 4) {
      Bytes hostile = bytes;
      std::fill_n(hostile.begin() + static_cast<std::ptrdiff_t>(at), 4, std::uint8_t{0xff});
      try {
        touch(inspect(type, hostile));
      } catch (const InputError&) {
      }
    }
}

}  // namespace
}  // namespace cosegraph::idl
