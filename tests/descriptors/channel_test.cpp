#include <gmock/gmock.h>

#include "descriptors/descriptors.hpp"

namespace cosegraph::descriptors {
namespace {

using ::testing::HasSubstr;

std::string refusal(std::string_view text) {
  try {
    parse_channel(text);
  } catch (const ParameterError& error) {
    return error.what();
  }
  return "";
}

TEST(ChannelText, RoundTrips) {
  for (const char* text : {"fpfh:0.08", "fpfh+place:0.08", "fpfh:0.1:0.02", "shot:0.13:0.03",
                           "shot+place:0.24:0", "place"})
    EXPECT_EQ(to_text(parse_channel(text)), text);
  for (const Kind kind : {Kind::fpfh, Kind::shot})
    for (const bool with_place : {false, true})
      for (const double spacing : {0.0, 0.02, 0.1}) {
        const Channel channel{kind, with_place, 0.123, spacing};
        EXPECT_EQ(parse_channel(to_text(channel)), channel);
      }
}

TEST(ChannelText, SaysWhatItMeans) {
  const Channel channel = parse_channel("fpfh+place:0.09:0.04");
  EXPECT_EQ(channel.kind, Kind::fpfh);
  EXPECT_TRUE(channel.with_place);
  EXPECT_EQ(channel.radius, 0.09);
  EXPECT_EQ(channel.spacing, 0.04);
}

TEST(ChannelText, GivesShotASpacingOfItsOwn) {
  EXPECT_EQ(parse_channel("shot:0.13").spacing, kShotSpacing);
  EXPECT_EQ(parse_channel("shot:0.13:0").spacing, 0.0);
  EXPECT_EQ(parse_channel("fpfh:0.13").spacing, 0.0);
}

TEST(ChannelText, IsRefusedWithAReason) {
  EXPECT_THAT(refusal("pfh:0.1"), HasSubstr("'pfh' is none of: fpfh, shot, place"));
  EXPECT_THAT(refusal("fpfh"), HasSubstr("radius is missing"));
  EXPECT_THAT(refusal("fpfh:"), HasSubstr("radius"));
  EXPECT_THAT(refusal("fpfh:wide"), HasSubstr("'wide' is not a number"));
  EXPECT_THAT(refusal("fpfh:0"), HasSubstr("radius 0 is outside"));
  EXPECT_THAT(refusal("fpfh:0.1:-1"), HasSubstr("spacing -1 is outside"));
  EXPECT_THAT(refusal("fpfh:0.1:0.1:0.1"), HasSubstr("expected KIND"));
  EXPECT_THAT(refusal("place:0.1"), HasSubstr("stands alone"));
  EXPECT_THAT(refusal("place+place"), HasSubstr("stands alone"));
  EXPECT_THAT(refusal(""), HasSubstr("channel ''"));
  Params params;
  EXPECT_THROW(set_field(describe(params), "channels", {"fpfh:0.1", "shot"}), ParameterError);
}

TEST(ChannelDimension, CountsThePlace) {
  EXPECT_EQ(dimension(parse_channel("fpfh:0.1")), 33);
  EXPECT_EQ(dimension(parse_channel("fpfh+place:0.1")), 35);
  EXPECT_EQ(dimension(parse_channel("shot:0.1")), 352);
  EXPECT_EQ(dimension(parse_channel("shot+place:0.1")), 354);
  EXPECT_EQ(dimension(parse_channel("place")), 2);
}

TEST(DescriptorRecipe, IsTheSameForTheSameDescriptors) {
  Params params{.channels = {"fpfh:0.080", "shot:0.13"}, .threads = 1};
  Params same{.channels = {"fpfh:0.08:0", "shot:0.13:0.02"}, .threads = 2, .kernel = Kernel::pcl};
  EXPECT_EQ(recipe_of(params), recipe_of(same));
  EXPECT_THAT(recipe_of(params), HasSubstr("fpfh:0.08,shot:0.13:0.02"));
  EXPECT_NE(recipe_of(params), recipe_of(Params{}));
}

TEST(KindNames, RoundTrip) {
  for (const Kind kind : {Kind::fpfh, Kind::shot, Kind::place})
    EXPECT_EQ(from_name<Kind>(to_name(kind)), kind);
}

TEST(KernelNames, RoundTrip) {
  for (const Kernel kernel : {Kernel::own, Kernel::pcl})
    EXPECT_EQ(from_name<Kernel>(to_name(kernel)), kernel);
}

}  // namespace
}  // namespace cosegraph::descriptors
