#include "fisher/fisher.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

extern "C" {
#include <vl/fisher.h>
}

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/error.hpp"
#include "fisher/samples.hpp"

namespace cosegraph::fisher {
namespace {

using test::normal_values;
using test::random_mixture;
using test::relative_difference;
using test::Values;

Encoding bag_of_words(BowForm form) {
  return {.method = Method::bow, .bow = form};
}

Values vlfeat_fisher(const GaussianMixture& m, const Values& samples) {
  Values covariance;
  for (const float s : m.sigma) covariance.push_back(s * s);
  Values result(2 * m.mean.size());
  vl_fisher_encode(result.data(), VL_TYPE_FLOAT, m.mean.data(), m.dimension, m.components,
                   covariance.data(), m.weight.data(), samples.data(), samples.size() / m.dimension,
                   0);
  return result;
}

long double density(const GaussianMixture& m, int k, const float* x) {
  long double p = m.weight[k];
  for (int d = 0; d < m.dimension; ++d) {
    const long double sigma = m.sigma[k * m.dimension + d];
    const long double u = (x[d] - static_cast<long double>(m.mean[k * m.dimension + d])) / sigma;
    p *= std::exp(-0.5L * u * u) / (sigma * std::sqrt(2.0L * std::numbers::pi_v<long double>));
  }
  return p;
}

TEST(FisherVector, AgreesWithVlfeats) {
  for (const auto& [components, dimension, count] :
       {std::tuple{1, 1, 5}, {32, 33, 75}, {7, 35, 20}, {16, 64, 1}}) {
    const auto m = random_mixture(components, dimension, 5);
    const Values samples = normal_values(count * dimension, 6);
    const Values ours = encode(m, samples, {});
    ASSERT_EQ(ours.size(), 2U * components * dimension);
    EXPECT_LT(relative_difference(ours, vlfeat_fisher(m, samples)), 1e-4)
        << components << " x " << dimension;
  }
}

TEST(FisherVector, OfOneGaussianIsTheNormalisedMoments) {
  const GaussianMixture m{1, 1, {1.0F}, {2.0F}, {0.5F}};
  const Values v = encode(m, Values{2.5F, 3.0F}, {});  // deviations 1 and 2
  EXPECT_THAT(v, testing::ElementsAre(testing::FloatNear(1.5F, 1e-6F),
                                      testing::FloatNear(1.5F / std::sqrt(2.0F), 1e-6F)));
}

TEST(FisherVector, VanishesOverTheSamplesItsMixtureIsTheOptimumFor) {
  const Values samples = test::clustered_samples(4000, 3, 5, 4.0, 2);
  const auto m =
      fit_mixture(samples, 3, {.components = 5, .iterations = 200, .variance_floor = 1e-6});
  for (const float z : encode(m, samples, {})) EXPECT_NEAR(z, 0.0F, 2e-3F);
}

TEST(FisherVector, DoesNotDependOnTheOrderOfSamples) {
  const auto m = random_mixture(8, 10, 5);
  const Values samples = normal_values(60 * 10, 6);
  std::vector<std::int32_t> order(60);
  std::iota(order.begin(), order.end(), 0);
  Random(3).shuffle(std::span(order));
  Values shuffled;
  for (const auto i : order)
    shuffled.insert(shuffled.end(), &samples[10 * i], &samples[10 * i] + 10);
  for (const Encoding& encoding :
       {Encoding{}, bag_of_words(BowForm::posterior), bag_of_words(BowForm::literal)})
    EXPECT_LT(relative_difference(encode(m, shuffled, encoding), encode(m, samples, encoding)),
              1e-5);
}

TEST(FisherVector, DoesNotCountDuplicates) {
  const auto m = random_mixture(8, 10, 5);
  const Values samples = normal_values(30 * 10, 6);
  Values twice = samples;
  twice.insert(twice.end(), samples.begin(), samples.end());
  for (const Encoding& encoding :
       {Encoding{}, bag_of_words(BowForm::posterior), bag_of_words(BowForm::literal)})
    EXPECT_LT(relative_difference(encode(m, twice, encoding), encode(m, samples, encoding)), 1e-5);
}

TEST(FisherVector, DoesNotDependOnTheUnitOfTheDescriptors) {
  auto m = random_mixture(8, 10, 5);
  Values samples = normal_values(30 * 10, 6);
  const Values before = encode(m, samples, {});
  for (auto* values : {&samples, &m.mean, &m.sigma})
    for (float& v : *values) v *= 8.0F;
  EXPECT_LT(relative_difference(encode(m, samples, {}), before), 1e-5);
}

TEST(BagOfWords, IsTheMeanPosterior) {
  const auto m = random_mixture(6, 4, 5);
  const Values samples = normal_values(25 * 4, 6);
  const Values words = encode(m, samples, bag_of_words(BowForm::posterior));
  ASSERT_EQ(words.size(), 6U);
  const Values gamma = posteriors(m, samples);
  for (int k = 0; k < 6; ++k) {
    double sum = 0.0;
    for (int t = 0; t < 25; ++t) sum += gamma[6 * t + k];
    EXPECT_NEAR(words[k], sum / 25.0, 1e-6);
  }
}

TEST(BagOfWords, LiteralIsEquationThreeUpToItsLargestComponent) {
  const auto m = random_mixture(6, 20, 5);
  const Values samples = normal_values(25 * 20, 6);
  std::vector<long double> f(6, 0.0L);
  for (int k = 0; k < 6; ++k)
    for (int t = 0; t < 25; ++t) f[k] += density(m, k, &samples[20 * t]) / 25.0L;
  const long double largest = *std::ranges::max_element(f);
  const Values words = encode(m, samples, bag_of_words(BowForm::literal));
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(words[k], static_cast<double>(f[k] / largest), 1e-4);
}

TEST(BagOfWords, LiteralNeitherOverflowsNorVanishesInManyDimensions) {
  auto m = random_mixture(4, 352, 5);
  Values samples = normal_values(5 * 352, 6);
  for (const float unit : {1e-4F, 1.0F, 1e4F}) {  // densities from e^+2000 to e^-3000
    GaussianMixture scaled = m;
    Values values = samples;
    for (auto* v : {&scaled.mean, &scaled.sigma, &values})
      for (float& x : *v) x *= unit;
    const Values words = encode(scaled, values, bag_of_words(BowForm::literal));
    EXPECT_THAT(words, testing::Contains(1.0F));
    EXPECT_THAT(words, testing::Each(testing::AllOf(testing::Ge(0.0F), testing::Le(1.0F))));
  }
}

TEST(Encode, RefusesWhatItCannotEncode) {
  const auto m = random_mixture(4, 3, 5);
  EXPECT_THROW(encode(m, {}, {}), InputError);
  EXPECT_THROW(encode(m, Values(4), {}), InputError);
  EXPECT_THROW(encode(m, Values(3, std::nanf("")), {}), InputError);
}

TEST(EncodingNames, RoundTrip) {
  for (const auto& [value, text] : names<Method>()) EXPECT_EQ(from_name<Method>(text), value);
  for (const auto& [value, text] : names<Pool>()) EXPECT_EQ(from_name<Pool>(text), value);
  for (const auto& [value, text] : names<BowForm>()) EXPECT_EQ(from_name<BowForm>(text), value);
}

TEST(EncodingRecipe, RoundTrips) {
  Encoding a{Method::bow, BowForm::literal, Pool::cluster, 0.25, true, 7, 3};
  Encoding b;
  apply_recipe(describe(b), recipe(describe(a)));
  EXPECT_EQ(recipe(describe(b)), recipe(describe(a)));
  EXPECT_EQ(b.cluster_points, 7);
  EXPECT_EQ(b.pool, Pool::cluster);
}

}  // namespace
}  // namespace cosegraph::fisher
