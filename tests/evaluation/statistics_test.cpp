#include "tools/evaluation/statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/random.hpp"

namespace cosegraph::evaluation {
namespace {

std::vector<std::int64_t> each_its_own(std::size_t count) {
  std::vector<std::int64_t> cluster(count);
  for (std::size_t i = 0; i < count; ++i) cluster[i] = static_cast<std::int64_t>(i);
  return cluster;
}

TEST(Statistics, SingletonClustersGiveTheUsualStandardErrorOfTheMean) {
  const std::vector<double> values{1.0, 2.0, 4.0, 9.0};
  const Estimate estimate = clustered_mean(values, each_its_own(4));
  EXPECT_DOUBLE_EQ(estimate.mean, 4.0);
  // Deviations -3 -2 0 5: variance 38 / 3, of the mean 38 / 12.
  EXPECT_NEAR(estimate.standard_error, std::sqrt(38.0 / 12.0), 1e-12);
}

TEST(Statistics, RepeatingEveryValueInItsClusterChangesNothing) {
  const std::vector<double> values{0.2, 0.9, 0.4, 0.7, 0.1};
  std::vector<double> repeated;
  std::vector<std::int64_t> cluster;
  for (std::size_t i = 0; i < values.size(); ++i)
    for (int copy = 0; copy < 3; ++copy) {
      repeated.push_back(values[i]);
      cluster.push_back(static_cast<std::int64_t>(i));
    }
  const Estimate once = clustered_mean(values, each_its_own(values.size()));
  const Estimate thrice = clustered_mean(repeated, cluster);
  EXPECT_NEAR(once.mean, thrice.mean, 1e-15);
  EXPECT_NEAR(once.standard_error, thrice.standard_error, 1e-15);
}

// Clusters of two with a common part: the error of the mean over many simulated samples.
TEST(Statistics, ClusteredStandardErrorIsTheSpreadOfTheMeanOverRepeatedSamples) {
  constexpr int kSamples = 4000;
  constexpr int kClusters = 30;
  Random random(5);
  std::vector<double> means;
  double estimated = 0.0;
  for (int sample = 0; sample < kSamples; ++sample) {
    std::vector<double> values;
    std::vector<std::int64_t> cluster;
    for (int c = 0; c < kClusters; ++c) {
      const double common = random.normal();
      for (int i = 0; i < 2; ++i) {
        values.push_back(common + 0.5 * random.normal());
        cluster.push_back(c);
      }
    }
    const Estimate estimate = clustered_mean(values, cluster);
    means.push_back(estimate.mean);
    estimated += estimate.standard_error * estimate.standard_error / kSamples;
  }
  const double spread = clustered_mean(means, each_its_own(kSamples)).standard_error *
                        std::sqrt(static_cast<double>(kSamples));
  const double truth = std::sqrt((1.0 + 0.25 / 2.0) / kClusters);
  EXPECT_NEAR(spread, truth, 0.03 * truth);
  EXPECT_NEAR(std::sqrt(estimated), truth, 0.03 * truth);
}

TEST(Statistics, ASingleClusterHasNoStandardError) {
  const std::vector<double> values{0.5, 0.7};
  const std::vector<std::int64_t> cluster{4, 4};
  const Estimate estimate = clustered_mean(values, cluster);
  EXPECT_DOUBLE_EQ(estimate.mean, 0.6);
  EXPECT_TRUE(std::isnan(estimate.standard_error));
  const std::vector<Estimate> strata{estimate, {.mean = 1.0, .standard_error = 0.1}};
  EXPECT_DOUBLE_EQ(mean_of(strata).mean, 0.8);
  EXPECT_TRUE(std::isnan(mean_of(strata).standard_error));
}

TEST(Statistics, TheMeanOfStrataCountsEachOnceAndAddsVariances) {
  const std::vector<Estimate> strata{{.mean = 0.2, .standard_error = 0.03},
                                     {.mean = 0.8, .standard_error = 0.04}};
  EXPECT_DOUBLE_EQ(mean_of(strata).mean, 0.5);
  EXPECT_NEAR(mean_of(strata).standard_error, 0.025, 1e-15);
}

}  // namespace
}  // namespace cosegraph::evaluation
