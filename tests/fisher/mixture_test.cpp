#include "fisher/mixture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

extern "C" {
#include <vl/generic.h>
#include <vl/gmm.h>
}

#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/lsan_interface.h>
#endif

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <numeric>

#include "core/error.hpp"
#include "fisher/kernels.hpp"
#include "fisher/samples.hpp"

namespace cosegraph::fisher {
namespace {

using test::clustered_samples;
using test::normal_values;
using test::random_mixture;
using test::Values;

double mean(const Values& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// log(w_k N_k(x)) as the textbook has it.
long double log_component(const GaussianMixture& m, int k, const float* x) {
  long double sum = std::log(static_cast<long double>(m.weight[k]));
  for (int d = 0; d < m.dimension; ++d) {
    const long double sigma = m.sigma[k * m.dimension + d];
    const long double u = (x[d] - static_cast<long double>(m.mean[k * m.dimension + d])) / sigma;
    sum -= 0.5L * u * u + std::log(sigma) + 0.5L * std::log(2.0L * std::numbers::pi_v<long double>);
  }
  return sum;
}

void expect_valid(const GaussianMixture& m) {
  EXPECT_NEAR(std::accumulate(m.weight.begin(), m.weight.end(), 0.0), 1.0, 1e-5);
  EXPECT_THAT(m.weight, testing::Each(testing::Gt(0.0F)));
  EXPECT_THAT(m.mean, testing::Each(testing::ResultOf([](float v) { return std::isfinite(v); },
                                                      testing::IsTrue())));
  EXPECT_THAT(m.sigma, testing::Each(testing::AllOf(
                           testing::Gt(0.0F), testing::Lt(std::numeric_limits<float>::max()))));
}

double vlfeat_log_likelihood(const Values& samples, int dimension, const MixtureParams& params) {
#ifdef __SANITIZE_ADDRESS__
  const __lsan::ScopedDisabler vlfeat_leaks;
#endif
  const auto count = samples.size() / dimension;
  vl_set_num_threads(1);
  const std::unique_ptr<VlGMM, decltype(&vl_gmm_delete)> gmm(
      vl_gmm_new(VL_TYPE_FLOAT, dimension, params.components), vl_gmm_delete);
  vl_rand_seed(vl_get_rand(), 1);
  vl_gmm_set_initialization(gmm.get(), VlGMMKMeans);
  vl_gmm_set_max_num_iterations(gmm.get(), params.iterations);
  return vl_gmm_cluster(gmm.get(), samples.data(), count) / static_cast<double>(count);
}

TEST(Mixture, ExplainsTheSamplesAsWellAsVlfeats) {
  const MixtureParams params{.components = 16, .iterations = 30, .variance_floor = 1e-4};
  for (const double spread : {0.5, 1.5, 4.0}) {
    SCOPED_TRACE(spread);
    const Values samples = clustered_samples(4000, 12, 24, spread, 7);
    double best = -std::numeric_limits<double>::infinity();  // both may hit a poor local optimum
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      MixtureParams seeded = params;
      seeded.seed = seed;
      best = std::max(best, mean(log_likelihood(fit_mixture(samples, 12, seeded), samples)));
    }
    EXPECT_GT(best, vlfeat_log_likelihood(samples, 12, params) - 0.15);
  }
}

TEST(Mixture, RecoversSeparatedClusters) {
  constexpr int kDimension = 5;
  const Values samples = clustered_samples(4000, kDimension, 4, 20.0, 3);
  const GaussianMixture m =
      fit_mixture(samples, kDimension, {.components = 4, .variance_floor = 1e-4});
  for (int cluster = 0; cluster < 4; ++cluster) {
    Values centre(kDimension, 0.0F);
    for (int i = cluster; i < 4000; i += 4)
      for (int d = 0; d < kDimension; ++d) centre[d] += samples[i * kDimension + d] / 1000.0F;
    int matches = 0;
    for (int k = 0; k < 4; ++k) {
      const Values found(m.mean.begin() + k * kDimension, m.mean.begin() + (k + 1) * kDimension);
      if (testing::Value(found, testing::Pointwise(testing::FloatNear(0.01F), centre))) {
        ++matches;
        EXPECT_NEAR(m.weight[k], 0.25, 1e-3);
        for (int d = 0; d < kDimension; ++d) EXPECT_NEAR(m.sigma[k * kDimension + d], 1.0, 0.1);
      }
    }
    EXPECT_EQ(matches, 1) << "cluster " << cluster;
  }
}

TEST(Mixture, MoreIterationsNeverExplainLess) {
  const Values samples = clustered_samples(3000, 6, 20, 1.0, 5);
  double before = -std::numeric_limits<double>::infinity();
  for (const int iterations : {0, 1, 2, 4, 8, 16}) {
    const auto m = fit_mixture(samples, 6,
                               {.components = 8, .iterations = iterations, .variance_floor = 1e-6});
    const double now = mean(log_likelihood(m, samples));
    EXPECT_GT(now, before - 1e-4) << iterations;
    before = now;
  }
}

TEST(Mixture, IsTheSameTwice) {
  const Values samples = clustered_samples(1000, 33, 10, 1.0, 5);
  const auto a = fit_mixture(samples, 33, {});
  const auto b = fit_mixture(samples, 33, {});
  EXPECT_EQ(a.weight, b.weight);
  EXPECT_EQ(a.mean, b.mean);
  EXPECT_EQ(a.sigma, b.sigma);
}

TEST(Mixture, FollowsShiftAndScaleOfTheSamples) {
  const Values samples = clustered_samples(2000, 4, 6, 3.0, 5);
  Values moved = samples;
  for (float& v : moved) v = 4.0F * v + 16.0F;
  const auto a = fit_mixture(samples, 4, {.components = 6});
  const auto b = fit_mixture(moved, 4, {.components = 6});
  for (std::size_t i = 0; i < a.mean.size(); ++i) {
    EXPECT_NEAR(b.mean[i], 4.0F * a.mean[i] + 16.0F, 0.02);
    EXPECT_NEAR(b.sigma[i], 4.0F * a.sigma[i], 0.02);
  }
}

TEST(Mixture, KeepsTheVarianceFloor) {
  Values samples = normal_values(600, 2);
  for (std::size_t i = 0; i < samples.size(); i += 2) samples[i] = i % 4 == 0 ? 10.0F : -10.0F;
  const auto m = fit_mixture(samples, 2, {.components = 4, .variance_floor = 0.05});
  for (int k = 0; k < 4; ++k) EXPECT_GE(m.sigma[2 * k], std::sqrt(0.05F) * 10.0F * 0.999F);
}

TEST(Mixture, HasAsManyComponentsAsSamplesAtMost) {
  const auto m = fit_mixture(normal_values(3 * 5, 1), 5, {.components = 32});
  EXPECT_EQ(m.components, 3);
  expect_valid(m);
}

TEST(Mixture, TakesASingleSample) {
  const Values sample = {1.0F, -200.0F, 0.0F};
  const auto m = fit_mixture(sample, 3, {});
  EXPECT_EQ(m.components, 1);
  EXPECT_THAT(m.mean, testing::Pointwise(testing::FloatEq(), sample));
  expect_valid(m);
  EXPECT_THAT(posteriors(m, sample), testing::ElementsAre(1.0F));
}

TEST(Mixture, TakesConstantDimensionsAndEqualSamples) {
  Values samples = normal_values(200 * 3, 4);
  for (std::size_t i = 0; i < samples.size(); i += 3) samples[i] = 7.0F;
  expect_valid(fit_mixture(samples, 3, {.components = 8}));
  expect_valid(fit_mixture(Values(300, 7.0F), 3, {.components = 8}));
  expect_valid(fit_mixture(Values(300, 0.0F), 3, {.components = 8}));
}

TEST(Mixture, GivesStarvedComponentsToOutliers) {
  Values samples = normal_values(500, 1);
  for (float& v : samples) v = v > 0.0F ? 1.0F : -1.0F;  // two different values, eight components
  samples.push_back(50.0F);
  const auto m = fit_mixture(samples, 1, {.components = 8});
  expect_valid(m);
  EXPECT_THAT(m.mean, testing::Contains(testing::FloatNear(50.0F, 0.5F)));
}

TEST(Mixture, RefusesBadSamples) {
  EXPECT_THROW(fit_mixture({}, 3, {}), InputError);
  EXPECT_THROW(fit_mixture(Values(4), 3, {}), InputError);
  Values samples = normal_values(30, 1);
  samples[17] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(fit_mixture(samples, 3, {}), InputError);
  samples[17] = std::numeric_limits<float>::infinity();
  EXPECT_THROW(fit_mixture(samples, 3, {}), InputError);
  EXPECT_THROW(fit_mixture(Values(6), 3, {.components = 0}), ParameterError);
}

TEST(Posteriors, AgreeWithTheFormula) {
  for (const int components : {1, 3, 8, 33}) {
    for (const int dimension : {1, 7, 33}) {
      const auto m = random_mixture(components, dimension, 11);
      const Values samples = normal_values(37 * dimension, 5);
      const Values joint = log_components(m, samples);
      const Values gamma = posteriors(m, samples);
      const Values evidence = log_likelihood(m, samples);
      ASSERT_EQ(gamma.size(), 37U * components);
      for (int t = 0; t < 37; ++t) {
        long double total = 0.0L;
        for (int k = 0; k < components; ++k)
          total += std::exp(log_component(m, k, &samples[t * dimension]));
        EXPECT_NEAR(evidence[t], static_cast<double>(std::log(total)), 2e-4);
        for (int k = 0; k < components; ++k) {
          const long double expected = log_component(m, k, &samples[t * dimension]);
          EXPECT_NEAR(joint[t * components + k], static_cast<double>(expected), 3e-4);
          EXPECT_NEAR(gamma[t * components + k], static_cast<double>(std::exp(expected) / total),
                      2e-4);
        }
      }
    }
  }
}

TEST(Posteriors, SumToOneHoweverFarTheSample) {
  const auto m = random_mixture(5, 352, 3);
  Values samples = normal_values(3 * 352, 8);
  for (int d = 0; d < 352; ++d) samples[d] *= 1e4F;
  for (int d = 0; d < 352; ++d) samples[352 + d] *= 1e25F;
  const Values gamma = posteriors(m, samples);
  for (int t = 0; t < 3; ++t)
    EXPECT_NEAR(std::accumulate(&gamma[5 * t], &gamma[5 * t] + 5, 0.0), 1.0, 1e-5);
}

TEST(Posteriors, DoNotDependOnTheOtherSamples) {
  const auto m = random_mixture(6, 9, 3);
  const Values samples = normal_values(40 * 9, 8);
  const Values all = posteriors(m, samples);
  const Values one = posteriors(m, std::span(samples).subspan(9 * 21, 9));
  EXPECT_TRUE(std::equal(one.begin(), one.end(), all.begin() + 6 * 21));
}

TEST(Posteriors, RefuseWhatDoesNotFit) {
  const auto m = random_mixture(2, 3, 1);
  EXPECT_TRUE(posteriors(m, {}).empty());
  EXPECT_THROW(posteriors(m, Values(4)), InputError);
  EXPECT_THROW(posteriors(m, Values(3, std::nanf(""))), InputError);
}

TEST(Kernels, AccumulateTheMomentsOfTheListedRows) {
  for (const int dimension : {1, 15, 16, 40, 65}) {
    const Values samples = normal_values(20 * dimension, 1);
    const Values mean = normal_values(dimension, 2);
    const Values inverse(dimension, 0.5F);
    const std::vector<std::int32_t> rows = {3, 19, 0, 3};
    const Values weight = {0.5F, 1.0F, 0.25F, 2.0F};
    Values first(dimension, 1.0F);
    Values second(dimension, -1.0F);
    accumulate(dimension, samples.data(), rows, weight.data(), mean.data(), inverse.data(),
               first.data(), second.data());
    for (int d = 0; d < dimension; ++d) {
      double a = 1.0;
      double b = -1.0;
      for (int i = 0; i < 4; ++i) {
        const double u = (samples[rows[i] * dimension + d] - mean[d]) * 0.5;
        a += weight[i] * u;
        b += weight[i] * u * u;
      }
      EXPECT_NEAR(first[d], a, 1e-5);
      EXPECT_NEAR(second[d], b, 1e-5);
    }
  }
}

// Samples with deviation 3 along one slanted axis, 1 along a second and almost none elsewhere.
Values slanted_samples(int count) {
  Random random(9);
  Values result;
  for (int i = 0; i < count; ++i) {
    const double a = 3.0 * random.normal();
    const double b = random.normal();
    for (const double v : {0.6 * a, 0.8 * a, b, 0.01 * random.normal()})
      result.push_back(static_cast<float>(v + 5.0));
  }
  return result;
}

TEST(Projection, FindsTheAxesInOrderOfVariance) {
  const Projection p = fit_projection(slanted_samples(5000), 4, 2);
  EXPECT_EQ(p.input, 4);
  EXPECT_EQ(p.output, 2);
  EXPECT_THAT(p.basis, testing::Pointwise(testing::FloatNear(0.05F),
                                          {0.6F, 0.8F, 0.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F}));
}

TEST(Projection, HasOrthonormalRowsWithPositiveLargestEntry) {
  const Projection p = fit_projection(clustered_samples(300, 40, 9, 2.0, 4), 40, 12);
  for (int a = 0; a < 12; ++a) {
    const float* row = &p.basis[a * 40];
    EXPECT_GT(*std::max_element(row, row + 40,
                                [](float x, float y) { return std::abs(x) < std::abs(y); }),
              0.0F);
    for (int b = 0; b <= a; ++b)
      EXPECT_NEAR(std::inner_product(row, row + 40, &p.basis[b * 40], 0.0), a == b ? 1.0 : 0.0,
                  1e-5);
  }
}

TEST(Projection, OfFullDimensionKeepsDistances) {
  const Values samples = clustered_samples(50, 6, 4, 2.0, 4);
  const Projection p = fit_projection(samples, 6, 99);
  EXPECT_EQ(p.output, 6);
  const Values projected = project(p, samples);
  const auto distance = [](const Values& v, int i, int j) {
    double sum = 0.0;
    for (int d = 0; d < 6; ++d) sum += std::pow(v[6 * i + d] - v[6 * j + d], 2);
    return std::sqrt(sum);
  };
  for (int i = 1; i < 50; ++i)
    EXPECT_NEAR(distance(projected, 0, i), distance(samples, 0, i), 1e-4);
}

TEST(Projection, OfNothingCopies) {
  const Values samples = normal_values(12, 1);
  EXPECT_EQ(project({}, samples), samples);
}

TEST(Projection, RefusesWhatDoesNotFit) {
  EXPECT_THROW(fit_projection({}, 3, 2), InputError);
  EXPECT_THROW(fit_projection(Values(6), 3, 0), ParameterError);
  const Projection p = fit_projection(normal_values(30, 1), 3, 2);
  EXPECT_THROW(project(p, Values(4)), MismatchError);
}

}  // namespace
}  // namespace cosegraph::fisher
