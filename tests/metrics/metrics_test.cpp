#include "metrics/metrics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <numeric>
#include <vector>

#include "core/cloud.hpp"
#include "core/error.hpp"
#include "core/random.hpp"
#include "support/data.hpp"

namespace cosegraph::metrics {
namespace {

using LabelList = std::vector<std::int32_t>;

LabelList random_labels(Random& random, std::size_t size, std::size_t labels) {
  LabelList result(size);
  for (auto& label : result) label = static_cast<std::int32_t>(random.below(labels));
  return result;
}

double pairs_that_differ(const LabelList& s, const LabelList& r) {
  double differ = 0.0;
  double all = 0.0;
  for (std::size_t i = 0; i < s.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      all += 1.0;
      differ += (s[i] == s[j]) != (r[i] == r[j]) ? 1.0 : 0.0;
    }
  return differ / all;
}

// E12 of one element by counting.
double local_refinement_error(const LabelList& s, const LabelList& r, std::size_t x) {
  double same = 0.0;
  double both = 0.0;
  for (std::size_t i = 0; i < s.size(); ++i)
    if (s[i] == s[x]) {
      same += 1.0;
      both += r[i] == r[x] ? 1.0 : 0.0;
    }
  return 1.0 - both / same;
}

LabelList read_segments(const std::filesystem::path& file) {
  std::ifstream stream(file);
  LabelList result;
  for (std::int32_t segment = 0; stream >> segment;) result.push_back(segment);
  return result;
}

// Of a plain OFF file of triangles.
std::vector<double> face_areas(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::string keyword;
  std::size_t vertices = 0;
  std::size_t faces = 0;
  std::size_t edges = 0;
  stream >> keyword >> vertices >> faces >> edges;
  Mesh all;
  all.vertex.resize(3 * vertices);
  for (float& coordinate : all.vertex) stream >> coordinate;
  std::vector<double> result;
  for (std::size_t f = 0; f < faces; ++f) {
    int corners = 0;
    all.face.resize(3);
    stream >> corners >> all.face[0] >> all.face[1] >> all.face[2];
    Mesh single{.face = {0, 1, 2}};
    for (const std::int32_t corner : all.face)
      single.vertex.insert(single.vertex.end(), &all.vertex[3 * static_cast<std::size_t>(corner)],
                           &all.vertex[3 * static_cast<std::size_t>(corner)] + 3);
    result.push_back(surface_area(single));
  }
  return result;
}

TEST(Metrics, AgreeWithThePrincetonProgram) {
  COSEGRAPH_NEEDS_DATA("psb/21_human_0.seg");
  COSEGRAPH_NEEDS_DATA("lpsb/Cup/21.off");
  const auto s = read_segments(test::data_folder() / "psb/21_human_0.seg");
  const auto r = read_segments(test::data_folder() / "psb/21_human_1.seg");
  const auto area = face_areas(test::data_folder() / "lpsb/Cup/21.off");
  ASSERT_EQ(s.size(), 30396U);
  EXPECT_NEAR(consistency_error(s, r).global, 0.0188102, 5e-8);
  EXPECT_NEAR(consistency_error(s, r).local, 0.0094051, 5e-8);
  // The program's Rand error is N / (N - 1) times the defined one.
  const auto n = static_cast<double>(s.size());
  EXPECT_NEAR(rand_error(s, r) * n / (n - 1.0), 0.0205774, 5e-8);
  EXPECT_NEAR(hamming_distance(s, r, area).mean(), 0.00976396, 5e-9);
}

TEST(Metrics, AgreeWithBruteForceOverElements) {
  Random random(3);
  for (int run = 0; run < 50; ++run) {
    const std::size_t size = 2 + random.below(30);
    const auto s = random_labels(random, size, 1 + random.below(5));
    const auto r = random_labels(random, size, 1 + random.below(5));
    EXPECT_NEAR(rand_error(s, r), pairs_that_differ(s, r), 1e-12);
    double forward = 0.0;
    double backward = 0.0;
    double local = 0.0;
    for (std::size_t x = 0; x < size; ++x) {
      const double e12 = local_refinement_error(s, r, x);
      const double e21 = local_refinement_error(r, s, x);
      forward += e12;
      backward += e21;
      local += std::min(e12, e21);
    }
    const auto n = static_cast<double>(size);
    EXPECT_NEAR(consistency_error(s, r).global, std::min(forward, backward) / n, 1e-12);
    EXPECT_NEAR(consistency_error(s, r).local, local / n, 1e-12);
  }
}

TEST(Metrics, HammingDistanceOfAHandMadeExample) {
  const LabelList s = {0, 0, 0, 1, 1, 1};
  const LabelList r = {0, 0, 1, 1, 2, 2};
  const auto plain = hamming_distance(s, r);
  EXPECT_NEAR(plain.missing, 1.0 - 5.0 / 6.0, 1e-12);      // 2 + 1 + 2 of R's segments are found
  EXPECT_NEAR(plain.false_alarm, 1.0 - 4.0 / 6.0, 1e-12);  // 2 + 2 of S's
  const std::vector<double> weight = {1, 1, 4, 1, 1, 1};
  EXPECT_NEAR(hamming_distance(s, r, weight).missing, 1.0 - 8.0 / 9.0, 1e-12);
  EXPECT_NEAR(hamming_distance(s, r, weight).false_alarm, 1.0 - 6.0 / 9.0, 1e-12);
}

TEST(Metrics, VanishForEqualPartitionsWhateverTheNames) {
  Random random(5);
  const auto r = random_labels(random, 200, 6);
  LabelList s = r;
  for (auto& label : s) label = 10 - label;
  EXPECT_DOUBLE_EQ(hamming_distance(s, r).mean(), 0.0);
  EXPECT_DOUBLE_EQ(rand_error(s, r), 0.0);
  EXPECT_DOUBLE_EQ(consistency_error(s, r).global, 0.0);
  EXPECT_LT(accuracy(s, r), 1.0);
  EXPECT_DOUBLE_EQ(accuracy(r, r), 1.0);
}

TEST(Metrics, AreSymmetricAndOrdered) {
  Random random(6);
  for (int run = 0; run < 20; ++run) {
    const auto s = random_labels(random, 100, 4);
    const auto r = random_labels(random, 100, 5);
    EXPECT_DOUBLE_EQ(rand_error(s, r), rand_error(r, s));
    EXPECT_NEAR(hamming_distance(s, r).missing, hamming_distance(r, s).false_alarm, 1e-12);
    EXPECT_NEAR(consistency_error(s, r).global, consistency_error(r, s).global, 1e-12);
    EXPECT_LE(consistency_error(s, r).local, consistency_error(s, r).global + 1e-12);
  }
}

TEST(Metrics, ConsistencyErrorsAreZeroAgainstASingleSegment) {
  Random random(7);
  const auto s = random_labels(random, 50, 4);
  const LabelList one(50, 2);
  EXPECT_DOUBLE_EQ(consistency_error(s, one).global, 0.0);
  EXPECT_DOUBLE_EQ(consistency_error(one, s).local, 0.0);
}

TEST(Metrics, WeightsThatAreEqualChangeNothing) {
  Random random(8);
  const auto s = random_labels(random, 60, 3);
  const auto r = random_labels(random, 60, 3);
  const std::vector<double> weight(60, 0.25);
  EXPECT_NEAR(accuracy(s, r, weight), accuracy(s, r), 1e-12);
  EXPECT_NEAR(hamming_distance(s, r, weight).mean(), hamming_distance(s, r).mean(), 1e-12);
}

TEST(Metrics, LeaveOutElementsWithoutAReference) {
  const LabelList s = {0, 1, 1, 0};
  const LabelList r = {0, 1, kNoLabel, kNoLabel};
  EXPECT_DOUBLE_EQ(accuracy(s, r), 1.0);
  EXPECT_DOUBLE_EQ(rand_error(s, r), 0.0);
  const LabelList unlabelled = {0, kNoLabel, 0, 0};
  EXPECT_DOUBLE_EQ(accuracy(unlabelled, r), 0.5);
}

TEST(Metrics, AreZeroForNothing) {
  EXPECT_DOUBLE_EQ(accuracy({}, {}), 0.0);
  EXPECT_DOUBLE_EQ(hamming_distance({}, {}).mean(), 0.0);
  EXPECT_DOUBLE_EQ(rand_error({}, {}), 0.0);
  EXPECT_DOUBLE_EQ(consistency_error({}, {}).global, 0.0);
  const LabelList one = {4};
  EXPECT_DOUBLE_EQ(rand_error(one, one), 0.0);
}

TEST(Metrics, RefuseSizesThatDiffer) {
  const LabelList two = {0, 1};
  const LabelList three = {0, 1, 2};
  const std::vector<double> weight = {1.0};
  EXPECT_THROW(accuracy(two, three), InputError);
  EXPECT_THROW(rand_error(two, three), InputError);
  EXPECT_THROW(consistency_error(three, two), InputError);
  EXPECT_THROW(hamming_distance(two, two, weight), InputError);
}

}  // namespace
}  // namespace cosegraph::metrics
