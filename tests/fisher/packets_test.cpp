#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/error.hpp"
#include "fisher/fisher.hpp"
#include "fisher/samples.hpp"

namespace cosegraph::fisher {
namespace {

using test::normal_values;
using test::random_mixture;
using test::relative_difference;
using test::Values;
using testing::HasSubstr;
using testing::SizeIs;

// A cloud of `count` random points, a group each (half left, half right), and two channels: one
// with a keypoint at every point, one at every third.
struct Scene {
  Values xyz;
  std::vector<std::int32_t> group;
  std::vector<DescriptorChannel> channels;

  explicit Scene(int count = 200) : xyz(normal_values(3 * count, 1)) {
    channels = {{.name = "fine", .dimension = 4}, {.name = "coarse", .dimension = 6}};
    for (int i = 0; i < count; ++i) {
      group.push_back(xyz[3 * i] < 0.0F ? 0 : 1);
      channels[0].keypoint.push_back(i);
      if (i % 3 == 0) channels[1].keypoint.push_back(i);
    }
    for (auto& channel : channels)
      channel.value = normal_values(channel.keypoint.size() * channel.dimension, 2);
  }

  std::vector<Values> values() const { return {channels[0].value, channels[1].value}; }
};

std::vector<AppearanceChannel> random_channels() {
  return {{.name = "fine", .dimension = 4, .mixture = random_mixture(5, 4, 3)},
          {.name = "coarse", .dimension = 6, .mixture = random_mixture(3, 6, 4)}};
}

double squared_distance(const Values& xyz, int a, int b) {
  double sum = 0.0;
  for (int axis = 0; axis < 3; ++axis) sum += std::pow(xyz[3 * a + axis] - xyz[3 * b + axis], 2);
  return sum;
}

TEST(Packets, AreOfEqualSizeAndStayInTheirGroup) {
  const Scene scene;
  const Encoding encoding{.cluster_points = 10, .packet_clusters = 4};
  const Draw draw{.clusters = 30, .packets = 12};
  const auto drawn = draw_packets(scene.xyz, scene.group, 1, scene.channels, encoding, draw);
  ASSERT_THAT(drawn, SizeIs(2));
  for (std::size_t c = 0; c < 2; ++c) {
    ASSERT_THAT(drawn[c].cluster, SizeIs(30));
    ASSERT_THAT(drawn[c].packet, SizeIs(12));
    for (const auto& packet : drawn[c].packet) {
      EXPECT_THAT(packet, SizeIs(4));
      EXPECT_THAT(std::set<std::int32_t>(packet.begin(), packet.end()), SizeIs(4));
    }
    for (const auto& cluster : drawn[c].cluster) {
      EXPECT_THAT(cluster, SizeIs(10));
      for (const auto row : cluster) EXPECT_EQ(scene.group[scene.channels[c].keypoint[row]], 1);
    }
  }
  EXPECT_EQ(drawn[0].packet, drawn[1].packet);
}

TEST(Packets, ClustersAreTheNearestKeypointsOfAPoint) {
  const Scene scene;
  const Encoding encoding{.cluster_points = 10};
  const auto drawn = draw_packets(scene.xyz, scene.group, 0, scene.channels, encoding, {});
  for (std::size_t i = 0; i < drawn[0].cluster.size(); ++i) {
    const int centre = drawn[0].cluster[i][0];  // at every point is a keypoint of this channel
    for (std::size_t c = 0; c < 2; ++c) {
      const auto& keypoint = scene.channels[c].keypoint;
      std::vector<std::pair<double, std::int32_t>> all;
      for (std::size_t row = 0; row < keypoint.size(); ++row)
        if (scene.group[keypoint[row]] == 0)
          all.emplace_back(squared_distance(scene.xyz, centre, keypoint[row]), row);
      std::ranges::sort(all);
      std::vector<std::int32_t> expected;
      for (int n = 0; n < 10; ++n) expected.push_back(all[n].second);
      EXPECT_EQ(drawn[c].cluster[i], expected);
    }
  }
}

TEST(Packets, HaveDifferentCentresAsLongAsThereArePoints) {
  const Scene scene;
  const auto drawn = draw_packets(scene.xyz, scene.group, 0, scene.channels, {}, {.clusters = 40});
  std::set<std::int32_t> centres;
  for (const auto& cluster : drawn[0].cluster) centres.insert(cluster[0]);
  EXPECT_THAT(centres, SizeIs(40));
}

TEST(Packets, TakeWhatAGroupHas) {
  const Scene scene(5);
  std::vector<std::int32_t> group(5, 7);
  const auto drawn = draw_packets(scene.xyz, group, 7, scene.channels, {.cluster_points = 25},
                                  {.clusters = 12, .packets = 3});
  EXPECT_THAT(drawn[0].cluster, SizeIs(12));
  EXPECT_THAT(drawn[0].cluster, testing::Each(SizeIs(5)));
  EXPECT_THAT(drawn[1].cluster, testing::Each(SizeIs(2)));
  EXPECT_THAT(drawn[1].packet, SizeIs(3));
}

TEST(Packets, AreNoneWhereAChannelHasNoKeypoint) {
  Scene scene;
  for (const std::int32_t point : scene.channels[1].keypoint) scene.group[point] = 0;
  const auto drawn = draw_packets(scene.xyz, scene.group, 1, scene.channels, {}, {});
  ASSERT_THAT(drawn, SizeIs(2));
  for (const auto& packets : drawn) {
    EXPECT_TRUE(packets.cluster.empty());
    EXPECT_TRUE(packets.packet.empty());
  }
  EXPECT_TRUE(draw_packets(scene.xyz, scene.group, 9, scene.channels, {}, {})[0].packet.empty());
}

TEST(Packets, AppendedKeepTheirClusters) {
  Packets a{.cluster = {{1}, {2}}, .packet = {{0, 1}}};
  append(a, {.cluster = {{5}}, .packet = {{0}}});
  EXPECT_EQ(a.cluster, (std::vector<std::vector<std::int32_t>>{{1}, {2}, {5}}));
  EXPECT_EQ(a.packet, (std::vector<std::vector<std::int32_t>>{{0, 1}, {2}}));
}

// The vector of one packet, by encoding each of its clusters on its own.
Values packet_by_hand(const GaussianMixture& m, const Values& values, const Packets& packets,
                      std::size_t packet, const Encoding& encoding) {
  const auto rows = [&](const std::vector<std::int32_t>& list) {
    Values result;
    for (const auto row : list)
      result.insert(result.end(), &values[row * m.dimension],
                    &values[row * m.dimension] + m.dimension);
    return result;
  };
  Values sum;
  std::vector<std::int32_t> all;
  for (const auto index : packets.packet[packet]) {
    const auto& cluster = packets.cluster[index];
    all.insert(all.end(), cluster.begin(), cluster.end());
    const Values one = encode(m, rows(cluster), encoding);
    sum.resize(one.size());
    for (std::size_t i = 0; i < one.size(); ++i)
      sum[i] += one[i] / static_cast<float>(packets.packet[packet].size());
  }
  Values result = encoding.pool == Pool::packet ? encode(m, rows(all), encoding) : sum;
  for (float& z : result)
    z = std::copysign(std::pow(std::abs(z), static_cast<float>(encoding.alpha)), z);
  return result;
}

TEST(EncodePackets, IsPowerNormalisedAfterPooling) {
  const Values values = normal_values(30 * 4, 2);
  std::vector<AppearanceChannel> channels = {
      {.name = "x", .dimension = 4, .mixture = random_mixture(5, 4, 3), .block_scale = 1.0F}};
  // Clusters of different sizes, so that both ways to pool differ.
  const std::vector<Packets> packets = {
      {.cluster = {{0, 1, 2, 3, 4, 5, 6}, {7, 8}, {9, 10, 11}}, .packet = {{0, 1}, {2, 1}}}};
  for (const Method method : {Method::fv, Method::bow})
    for (const Pool pool : {Pool::cluster, Pool::packet})
      for (const double alpha : {0.3, 0.5, 1.0}) {
        const Encoding encoding{.method = method, .pool = pool, .alpha = alpha};
        const auto size = static_cast<std::size_t>(block_size(channels[0].mixture, encoding));
        const Values both =
            encode_packets(packets, std::vector<Values>{values}, channels, encoding);
        ASSERT_EQ(both.size(), 2 * size);
        for (std::size_t p = 0; p < 2; ++p) {
          const Values vector(both.begin() + p * size, both.begin() + (p + 1) * size);
          EXPECT_LT(relative_difference(vector, packet_by_hand(channels[0].mixture, values,
                                                               packets[0], p, encoding)),
                    1e-4);
        }
      }
}

TEST(EncodePackets, LiteralWordsPoolDensities) {
  const Values values = normal_values(9 * 4, 2);
  const std::vector<AppearanceChannel> channels = {
      {.name = "x", .dimension = 4, .mixture = random_mixture(5, 4, 3), .block_scale = 1.0F}};
  const std::vector<Packets> packets = {{.cluster = {{0, 1, 2}, {3, 4, 5}}, .packet = {{0, 1}}}};
  Encoding encoding{.method = Method::bow, .bow = BowForm::literal, .alpha = 1.0};
  const Values expected = encode(channels[0].mixture, std::span(values).first(6 * 4), encoding);
  for (const Pool pool : {Pool::cluster, Pool::packet}) {  // equal for clusters of equal size
    encoding.pool = pool;
    EXPECT_LT(
        relative_difference(
            encode_packets(packets, std::vector<Values>{values}, channels, encoding), expected),
        1e-5);
  }
}

TEST(EncodePackets, ScalesEachBlock) {
  const Scene scene;
  auto channels = random_channels();
  channels[0].block_scale = 2.0F;
  channels[1].block_scale = 0.5F;
  const Encoding encoding{.l2 = true};
  const auto packets = draw_packets(scene.xyz, scene.group, 0, scene.channels, encoding, {});
  const Values vectors = encode_packets(packets, scene.values(), channels, encoding);
  const std::size_t first = 2 * 5 * 4;
  const std::size_t stride = first + 2 * 3 * 6;
  ASSERT_EQ(vectors.size(), 20 * stride);
  for (std::size_t p = 0; p < 20; ++p) {
    double a = 0.0;
    double b = 0.0;
    for (std::size_t i = 0; i < stride; ++i)
      (i < first ? a : b) += std::pow(vectors[p * stride + i], 2);
    EXPECT_NEAR(std::sqrt(a), 2.0, 1e-4);
    EXPECT_NEAR(std::sqrt(b), 0.5, 1e-4);
  }
}

TEST(EncodePackets, RefusesListsThatDoNotFit) {
  const Scene scene;
  const auto packets = draw_packets(scene.xyz, scene.group, 0, scene.channels, {}, {});
  EXPECT_THROW(
      encode_packets(packets, std::vector<Values>{scene.channels[0].value}, random_channels(), {}),
      InputError);
}

// A query whose segments are the scene's groups, and the model for it.
struct Query {
  Scene scene;
  Cloud cloud;
  Descriptors descriptors;
  Segments segments;
  AppearanceModel model;

  explicit Query(int count = 200) : scene(count) {
    cloud.xyz = scene.xyz;
    cloud.recipe = "spacing=1";
    for (int i = 0; i < count; ++i) cloud.dense_index.push_back(i);
    descriptors = {.recipe = "channels=fine,coarse", .channels = scene.channels};
    segments.of_point = scene.group;
    segments.count = 2;
    segments.adjacency = {{0, 1}};
    model.cloud_recipe = cloud.recipe;
    model.descriptor_recipe = descriptors.recipe;
    Encoding encoding;
    model.encoding_recipe = recipe(describe(encoding));
    model.channels = random_channels();
  }

  Encodings encode(const Params& params = {}) const {
    return encode_segments(cloud, descriptors, segments, model, params);
  }
};

Values vectors_of(const Encodings& e, std::int32_t segment) {
  Values result;
  for (std::size_t p = 0; p < e.segment.size(); ++p)
    if (e.segment[p] == segment)
      result.insert(result.end(), &e.value[p * e.dimension],
                    &e.value[p * e.dimension] + e.dimension);
  return result;
}

TEST(EncodeSegments, DrawsEquallyManyPacketsPerSegment) {
  const Encodings e = Query().encode({.packets = 6});
  EXPECT_EQ(e.segment_count, 2);
  EXPECT_EQ(e.dimension, 2 * 5 * 4 + 2 * 3 * 6);
  EXPECT_THAT(e.segment, testing::ElementsAre(0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1));
  EXPECT_EQ(e.value.size(), 12U * e.dimension);
}

TEST(EncodeSegments, IsEncodingThePacketsOfEachSegment) {
  const Query query;
  const Encodings e = query.encode({.clusters = 9, .packets = 4, .seed = 5});
  const auto drawn = draw_packets(query.scene.xyz, query.scene.group, 1, query.scene.channels, {},
                                  {9, 4, derive_seed(5, 1)});
  EXPECT_EQ(vectors_of(e, 1),
            encode_packets(drawn, query.scene.values(), query.model.channels, {}));
}

TEST(EncodeSegments, DoesNotLetOneSegmentInfluenceAnother) {
  Query query;
  const Encodings before = query.encode();
  for (std::size_t i = 0; i < query.segments.of_point.size(); ++i)
    if (query.scene.group[i] == 1) query.segments.of_point[i] = 1 + static_cast<int>(i % 2);
  query.segments.count = 3;
  EXPECT_EQ(vectors_of(query.encode(), 0), vectors_of(before, 0));
}

TEST(EncodeSegments, RefusesPointsThatAreNotFiniteOrTooFarOut) {
  for (const float bad : {std::nanf(""), 1e20F}) {
    Query query;
    query.cloud.xyz[4] = bad;
    EXPECT_THROW(query.encode(), InputError) << bad;
  }
}

TEST(EncodeSegments, RefusesTablesBeyondAllMeasure) {
  Query query;
  query.segments.count = 1 << 28;  // without points: it costs a message nothing to say so
  EXPECT_THROW(query.encode(), InputError);
}

TEST(EncodeSegments, BorrowsKeypointsWhereAChannelHasNone) {
  Query query;
  for (const auto point : query.scene.channels[1].keypoint) query.segments.of_point[point] = 0;
  const Encodings e = query.encode();
  EXPECT_EQ(std::ranges::count(e.segment, 1), 10);
  EXPECT_THAT(e.value, testing::Each(testing::Truly([](float v) { return std::isfinite(v); })));
}

TEST(EncodeSegments, GivesASegmentWithoutPointsThoseOfItsNeighbours) {
  Query query;
  query.segments.count = 3;  // none of the cloud's points stands for one of segment 2
  query.segments.adjacency = {{0, 1}, {1, 2}};
  const Encodings e = query.encode();
  EXPECT_EQ(std::ranges::count(e.segment, 2), 10);
  query.segments.adjacency.clear();
  EXPECT_EQ(std::ranges::count(query.encode().segment, 2), 10);
}

TEST(EncodeSegments, LeavesOutPointsThatStandForNone) {
  Query query;
  std::fill(query.cloud.dense_index.begin() + 5, query.cloud.dense_index.end(), kNoPoint);
  EXPECT_THAT(query.encode().segment, SizeIs(20));
}

TEST(EncodeSegments, TakesAQueryOfOnePoint) {
  Query query(1);
  query.segments.count = 1;
  query.segments.of_point = {0};
  query.segments.adjacency.clear();
  EXPECT_THAT(query.encode().segment, SizeIs(10));
}

TEST(EncodeSegments, HasNothingToSayOfNoSegments) {
  Query query;
  query.segments = {};
  query.cloud.dense_index.assign(query.cloud.size(), kNoPoint);
  EXPECT_TRUE(query.encode().value.empty());
}

template <class Error>
std::string message_of(const Query& query) {
  try {
    query.encode();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(EncodeSegments, NamesBothRecipesOfAMismatch) {
  Query query;
  query.descriptors.recipe = "channels=shot:0.13";
  EXPECT_EQ(message_of<MismatchError>(query),
            "descriptors were made with 'channels=shot:0.13', the model needs "
            "'channels=fine,coarse'");
  query = Query();
  query.cloud.recipe = "spacing=2";
  EXPECT_EQ(message_of<MismatchError>(query),
            "points were made with 'spacing=2', the model needs 'spacing=1'");
  query = Query();
  query.descriptors.channels[1].name = "other";
  EXPECT_THAT(message_of<MismatchError>(query), HasSubstr("'other'"));
  query = Query();
  query.descriptors.channels.pop_back();
  EXPECT_THAT(message_of<MismatchError>(query), HasSubstr("1 descriptor channels"));
}

TEST(EncodeSegments, RefusesInconsistentInput) {
  Query query;
  query.cloud.dense_index.pop_back();
  EXPECT_THROW(query.encode(), InputError);
  query = Query();
  query.cloud.dense_index[3] = 1000;
  EXPECT_THROW(query.encode(), InputError);
  query = Query();
  query.segments.of_point[3] = 2;
  EXPECT_THROW(query.encode(), InputError);
  query = Query();
  query.descriptors.channels[0].keypoint[3] = 1000;
  EXPECT_THROW(query.encode(), InputError);
  query = Query();
  query.descriptors.channels[0].value[3] = std::nanf("");
  EXPECT_THROW(query.encode(), InputError);
}

}  // namespace
}  // namespace cosegraph::fisher
