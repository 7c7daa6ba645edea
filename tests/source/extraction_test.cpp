#include <gmock/gmock.h>

#include "io/cloud_io.hpp"
#include "source/shapes.hpp"
#include "source/source.hpp"
#include "support/data.hpp"

namespace cosegraph::source {
namespace {

using test::board;
using test::half_sphere;

constexpr std::size_t kTablePoints = 200 * 200;
constexpr std::size_t kBallPoints = 4000;
constexpr std::size_t kSmallPoints = 1500;

// A table of 1 m, a ball of 10 cm radius and one of 5 cm above it, and stray points.
Cloud scene() {
  Cloud small = half_sphere(kSmallPoints, 0.05, 1.8);
  for (std::size_t i = 0; i < small.size(); ++i) small.xyz[3 * i] += 0.3F;
  Cloud cloud = test::joined(board(200, 1.0, 0.0, 2.0), half_sphere(kBallPoints, 0.1, 1.9));
  cloud = test::with_noise(test::joined(cloud, small), 0.001, 3);
  Random random(8);
  for (int i = 0; i < 100; ++i)
    test::add_point(cloud, random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0),
                    random.uniform(0.5, 1.5));
  return cloud;
}

std::size_t kept_between(const Frame& frame, std::size_t begin, std::size_t end) {
  std::size_t kept = 0;
  for (std::size_t i = begin; i < end; ++i) kept += frame.input.dense_index[i] != kNoPoint;
  return kept;
}

TEST(Extraction, FindsTheLargestObjectOnATable) {
  const Frame frame = prepare(scene(), {.enabled = true}, {});
  const std::size_t ball_end = kTablePoints + kBallPoints;
  EXPECT_EQ(kept_between(frame, 0, kTablePoints), 0U);
  EXPECT_GT(kept_between(frame, kTablePoints, ball_end), kBallPoints * 85 / 100);
  EXPECT_EQ(kept_between(frame, ball_end, ball_end + kSmallPoints), 0U);
  EXPECT_LE(kept_between(frame, ball_end + kSmallPoints, frame.input.size()), 1U);
  EXPECT_THAT(frame.notes, testing::Contains(testing::HasSubstr("stands on the dominant plane")));
}

// A wall behind the table is larger than anything on it.
TEST(Extraction, LeavesAWallBehindTheTableOut) {
  Cloud with_wall = scene();
  const std::size_t before = with_wall.size();
  for (int i = 0; i < 150; ++i)
    for (int j = 0; j < 60; ++j) test::add_point(with_wall, -0.75 + 0.01 * i, 0.8, 1.97 - 0.01 * j);
  const Frame frame = prepare(with_wall, {.enabled = true}, {});
  EXPECT_EQ(kept_between(frame, before, frame.input.size()), 0U);
  EXPECT_GT(kept_between(frame, kTablePoints, kTablePoints + kBallPoints), kBallPoints * 85 / 100);
  const Frame all = prepare(with_wall, {.enabled = true, .standing = false}, {});
  EXPECT_GT(kept_between(all, before, all.input.size()), 8000U) << "the wall is the largest";
}

TEST(Extraction, KeepsTheClusterThatIsAskedFor) {
  const Frame frame = prepare(scene(), {.enabled = true, .cluster = 1}, {});
  const std::size_t ball_end = kTablePoints + kBallPoints;
  EXPECT_EQ(kept_between(frame, 0, ball_end), 0U);
  EXPECT_GT(kept_between(frame, ball_end, ball_end + kSmallPoints), kSmallPoints * 85 / 100);
}

TEST(Extraction, KeepsExactlyWhatTheCropBoxHolds) {
  const Extraction crop{.enabled = true,
                        .crop = {"-0.2", "-0.2", "1.7", "0.2", "0.2", "1.85"},
                        .outlier_neighbours = 0,
                        .plane_tolerance = 0.0,
                        .cluster_tolerance = 0.0};
  const Frame frame = prepare(scene(), crop, {});
  for (std::size_t i = 0; i < frame.input.size(); ++i) {
    const float* p = &frame.input.xyz[3 * i];
    const bool inside = p[0] >= -0.2F && p[0] <= 0.2F && p[1] >= -0.2F && p[1] <= 0.2F &&
                        p[2] >= 1.7F && p[2] <= 1.85F;
    ASSERT_EQ(frame.input.dense_index[i] != kNoPoint, inside) << i;
  }
}

TEST(Extraction, LeavesAPlaneAloneThatDoesNotDominate) {
  const Cloud ball = half_sphere(20000, 0.3, 2.0);
  const Extraction plane{.enabled = true, .outlier_neighbours = 0, .plane_tolerance = 0.002};
  const Frame frame = prepare(ball, plane, {});
  EXPECT_EQ(kept_between(frame, 0, ball.size()), ball.size());
}

TEST(Extraction, GivesTheSameBytesEveryTime) {
  const Frame first = prepare(scene(), {.enabled = true}, {});
  const Frame second = prepare(scene(), {.enabled = true}, {});
  EXPECT_EQ(first.input.dense_index, second.input.dense_index);
  EXPECT_EQ(first.cloud.xyz, second.cloud.xyz);
}

TEST(Extraction, RefusesAnEmptyTable) {
  EXPECT_THROW(prepare(board(200, 1.0, 0.3, 2.0), {.enabled = true}, {}), InputError);
}

TEST(Extraction, RefusesAClusterThatIsNotThere) {
  EXPECT_THROW(prepare(scene(), {.enabled = true, .cluster = 50}, {}), InputError);
}

TEST(Extraction, RefusesAMalformedCropBox) {
  const auto with_crop = [](std::vector<std::string> crop) {
    prepare(scene(), {.enabled = true, .crop = std::move(crop)}, {});
  };
  EXPECT_THROW(with_crop({"1", "2", "3"}), ParameterError);
  EXPECT_THROW(with_crop({"1", "0", "0", "0", "1", "1"}), ParameterError);
  EXPECT_THROW(with_crop({"0", "0", "0", "1", "1", "far"}), ParameterError);
  EXPECT_THROW(with_crop({"10", "10", "10", "11", "11", "11"}), InputError);
  Extraction extraction;
  EXPECT_THROW(set_field(describe(extraction), "crop", {"0", "x"}), ParameterError);
}

TEST(Extraction, FindsTheMugInARealDepthImage) {
  const char* file = "pcl/table_scene_mug_stereo_textured.pcd";
  COSEGRAPH_NEEDS_DATA(file);
  const Cloud image = io::read_cloud(test::data_folder() / file);
  const Extraction near{.enabled = true, .crop = {"-1", "-1", "0", "1", "1", "1.5"}};
  const Frame frame = prepare(image, near, {});
  ASSERT_GT(frame.dense.size(), 5000U);
  for (int axis = 0; axis < 3; ++axis) {
    float low = 1e9F;
    float high = -1e9F;
    for (std::size_t i = axis; i < frame.dense.xyz.size(); i += 3) {
      low = std::min(low, frame.dense.xyz[i]);
      high = std::max(high, frame.dense.xyz[i]);
    }
    EXPECT_GT(high - low, 0.05F) << "axis " << axis;
    EXPECT_LT(high - low, 0.16F) << "axis " << axis;
  }
}

}  // namespace
}  // namespace cosegraph::source
