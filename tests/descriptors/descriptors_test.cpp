#include "descriptors/descriptors.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/nearest.hpp"
#include "descriptors/surfaces.hpp"

namespace cosegraph::descriptors {
namespace {

using test::bumpy_egg;
using ::testing::HasSubstr;

Descriptors computed(const Cloud& cloud, std::vector<std::string> channels, int threads = 1) {
  return compute(cloud, {.channels = std::move(channels), .threads = threads});
}

double relative_difference(const std::vector<float>& a, const std::vector<float>& b) {
  double difference = 0.0;
  double size = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference += std::abs(a[i] - b[i]);
    size += std::abs(a[i]);
  }
  return difference / size;
}

TEST(Descriptors, ComeInTheOrderAndShapeThatIsAskedFor) {
  const Cloud egg = bumpy_egg(1500);
  const auto result = computed(egg, {"shot:0.15", "fpfh+place:0.1", "place"});
  ASSERT_EQ(result.channels.size(), 3U);
  EXPECT_EQ(result.channels[0].name, "shot:0.15:0.02");
  EXPECT_EQ(result.channels[1].name, "fpfh+place:0.1");
  EXPECT_EQ(result.channels[2].name, "place");
  for (const auto& channel : result.channels) {
    EXPECT_EQ(channel.dimension, dimension(parse_channel(channel.name)));
    EXPECT_EQ(channel.value.size(), channel.keypoint.size() * channel.dimension);
    EXPECT_TRUE(std::ranges::is_sorted(channel.keypoint));
    EXPECT_TRUE(std::ranges::all_of(channel.value, [](float v) { return std::isfinite(v); }));
  }
  EXPECT_EQ(result.channels[1].keypoint.size(), egg.size());
  EXPECT_EQ(result.recipe, "channels=shot:0.15:0.02,fpfh+place:0.1,place");
}

TEST(Descriptors, AppendThePlaceOfTheirKeypoint) {
  const Cloud egg = bumpy_egg(1500);
  const auto result = computed(egg, {"place", "fpfh:0.1:0.05", "fpfh+place:0.1:0.05"});
  const auto& place = result.channels[0];
  const auto& plain = result.channels[1];
  const auto& both = result.channels[2];
  ASSERT_EQ(both.keypoint, plain.keypoint);
  for (std::size_t k = 0; k < both.keypoint.size(); ++k) {
    for (int d = 0; d < 33; ++d) ASSERT_EQ(both.value[35 * k + d], plain.value[33 * k + d]);
    for (int d = 0; d < 2; ++d)
      ASSERT_EQ(both.value[35 * k + 33 + d], place.value[2 * both.keypoint[k] + d]);
  }
}

TEST(Descriptors, ChooseKeypointsThatCoverTheCloudAndKeepTheirDistance) {
  const Cloud egg = bumpy_egg(3000);
  const auto keypoint = computed(egg, {"fpfh:0.1:0.06"}).channels[0].keypoint;
  std::vector<float> chosen;
  for (const std::int32_t i : keypoint)
    chosen.insert(chosen.end(), &egg.xyz[3 * i], &egg.xyz[3 * i] + 3);
  const NearestNeighbours tree(chosen);
  for (std::size_t k = 0; k < keypoint.size(); ++k)
    ASSERT_GT(tree.nearest(&chosen[3 * k], 2)[1].squared_distance, 0.06F * 0.06F);
  for (std::size_t i = 0; i < egg.size(); ++i)
    ASSERT_LE(tree.nearest(&egg.xyz[3 * i], 1)[0].squared_distance, 0.06F * 0.06F * 1.0001F);
}

TEST(Descriptors, DoNotDependOnThePose) {
  const Cloud egg = bumpy_egg(1500);
  const std::vector<std::string> channels{"fpfh:0.1", "shot:0.15:0", "place"};
  const auto still = computed(egg, channels);
  for (const std::uint64_t seed : {1, 2}) {
    const auto turned = computed(test::moved(egg, seed), channels);
    for (std::size_t c = 0; c < channels.size(); ++c) {
      ASSERT_EQ(turned.channels[c].keypoint, still.channels[c].keypoint);
      EXPECT_LT(relative_difference(still.channels[c].value, turned.channels[c].value), 0.02)
          << channels[c];
    }
  }
}

TEST(Descriptors, DoNotDependOnTheUnitOfLength) {
  const Cloud metres = bumpy_egg(1500);
  Cloud larger = metres;
  larger.scale = 1024.0F;
  for (float& value : larger.xyz) value *= 1024.0F;
  const auto a = computed(metres, {"fpfh:0.1", "shot:0.15", "place"});
  const auto b = computed(larger, {"fpfh:0.1", "shot:0.15", "place"});
  for (std::size_t c = 0; c < a.channels.size(); ++c) {
    ASSERT_EQ(a.channels[c].keypoint, b.channels[c].keypoint);
    EXPECT_LT(relative_difference(a.channels[c].value, b.channels[c].value), 1e-4);
  }
}

TEST(Descriptors, AreTheSameBytesForAnyNumberOfThreads) {
  const Cloud egg = bumpy_egg(1500);
  const auto one = computed(egg, {"fpfh+place:0.1", "shot:0.15"}, 1);
  for (const int threads : {2, 5, 0}) {
    const auto many = computed(egg, {"fpfh+place:0.1", "shot:0.15"}, threads);
    EXPECT_EQ(many.recipe, one.recipe);
    for (std::size_t c = 0; c < one.channels.size(); ++c) {
      EXPECT_EQ(many.channels[c].keypoint, one.channels[c].keypoint);
      EXPECT_EQ(many.channels[c].value, one.channels[c].value);
    }
  }
}

TEST(Descriptors, LeaveOutPointsWithoutNeighbours) {
  Cloud egg = bumpy_egg(1500);
  egg.xyz.insert(egg.xyz.begin(), {5.0F, 5.0F, 5.0F});
  egg.normal.insert(egg.normal.begin(), {0.0F, 0.0F, 1.0F});
  egg.width += 1;
  const auto result = computed(egg, {"fpfh+place:0.1", "shot:0.15:0", "place"});
  EXPECT_EQ(result.channels[0].keypoint.front(), 1);
  EXPECT_EQ(result.channels[0].keypoint.size(), 1500U);
  EXPECT_EQ(result.channels[1].keypoint.front(), 1);
  EXPECT_EQ(result.channels[2].keypoint.size(), 1501U);
}

TEST(Descriptors, RefuseCloudsTheyCannotDescribe) {
  const Cloud egg = bumpy_egg(500);
  EXPECT_THROW(computed({}, {"fpfh:0.1"}), InputError);
  Cloud damaged = egg;
  damaged.normal.clear();
  EXPECT_THROW(computed(damaged, {"fpfh:0.1"}), InputError);
  damaged = egg;
  damaged.normal[5] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(computed(damaged, {"fpfh:0.1"}), InputError);
  damaged = egg;
  damaged.scale = 0.0F;
  EXPECT_THROW(computed(damaged, {"fpfh:0.1"}), InputError);
  damaged.scale = 0.001F;  // no neighbour within the radius
  EXPECT_THROW(computed(damaged, {"fpfh:0.1"}), InputError);
}

TEST(Descriptors, RefuseNeighbourhoodsThatHoldEverything) {
  Cloud cloud = bumpy_egg(50000);
  cloud.scale *= 1000.0F;
  EXPECT_THROW(computed(cloud, {"fpfh:0.1"}), InputError);
}

TEST(Descriptors, RefuseNoChannelAndTheSameTwice) {
  const Cloud egg = bumpy_egg(500);
  EXPECT_THROW(computed(egg, {}), ParameterError);
  EXPECT_THROW(computed(egg, {"fpfh:0.1", "fpfh:0.10:0"}), ParameterError);
  EXPECT_THROW(computed(egg, {"fpfh"}), ParameterError);
}

}  // namespace
}  // namespace cosegraph::descriptors
