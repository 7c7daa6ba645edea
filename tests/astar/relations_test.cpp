#include "astar/relations.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "astar/line_spectrum.hpp"
#include "core/error.hpp"
#include "core/random.hpp"
#include "spectra/spectra.hpp"

namespace cosegraph::astar {
namespace {

double density(const DistanceMixture& mixture, double x) {
  double sum = 0.0;
  for (std::size_t k = 0; k < mixture.weight.size(); ++k) {
    const double sigma = mixture.sigma[k];
    const double z = (x - mixture.mean[k]) / sigma;
    sum += mixture.weight[k] * std::exp(-0.5 * z * z) / (sigma * std::sqrt(2.0 * std::numbers::pi));
  }
  return sum;
}

// Two parts on a line, around 0 and around 10, of deviation 1.
struct TwoParts {
  Spectrum spectrum;
  std::vector<std::int32_t> label;

  explicit TwoParts(std::uint64_t seed) {
    Random random(seed);
    std::vector<float> position;
    for (int s = 0; s < 400; ++s) {
      label.push_back(s % 2);
      position.push_back(static_cast<float>(10.0 * (s % 2) + random.normal()));
    }
    spectrum = test::line_spectrum(position);
  }
  RelationView view() const { return {&spectrum, label}; }
};

RelationModel small_model() {
  RelationModel model;
  model.label_names = {"a", "b"};
  model.spectrum_recipe = "line";
  model.pairs = {{{0.4F, 0.6F}, {1.0F, 2.0F}, {0.5F, 0.7F}},
                 {{1.0F}, {5.0F}, {1.0F}},
                 {{0.5F, 0.5F}, {0.5F, 3.0F}, {0.3F, 1.0F}}};
  return model;
}

TEST(FitRelations, RecoversTheDistancesBetweenTwoParts) {
  const TwoParts parts(1);
  const RelationView views[] = {parts.view()};
  const auto pairs = fit_relations(views, 2, {});
  ASSERT_EQ(pairs.size(), 3U);
  const auto& across = pairs[pair_index(0, 1)];
  double mean = 0.0;
  double square = 0.0;
  for (std::size_t k = 0; k < across.weight.size(); ++k) {
    mean += across.weight[k] * across.mean[k];
    square +=
        across.weight[k] * (across.mean[k] * across.mean[k] + across.sigma[k] * across.sigma[k]);
  }
  EXPECT_NEAR(mean, 10.0, 0.2);  // N(10, 2)
  EXPECT_NEAR(std::sqrt(square - mean * mean), std::sqrt(2.0), 0.1);
}

TEST(FitRelations, SeparatesTwoModes) {
  Random random(2);
  std::vector<float> position;
  std::vector<std::int32_t> label;
  for (int s = 0; s < 300; ++s) {  // part 1 has two ends, at 5 and at 20
    label.push_back(s % 2);
    position.push_back(static_cast<float>((s % 2 == 0   ? 0.0
                                           : s % 4 == 1 ? 5.0
                                                        : 20.0) +
                                          0.2 * random.normal()));
  }
  const auto spectrum = test::line_spectrum(position);
  const RelationView views[] = {{&spectrum, label}};
  const auto across = fit_relations(views, 2, {.mixture = 2})[pair_index(0, 1)];
  ASSERT_EQ(across.mean.size(), 2U);
  EXPECT_NEAR(across.mean[0], 5.0, 0.1);
  EXPECT_NEAR(across.mean[1], 20.0, 0.1);
  EXPECT_NEAR(across.weight[0], 0.5, 0.05);
}

TEST(FitRelations, WeightsSumToOneAndDeviationsKeepTheirFloor) {
  const TwoParts parts(3);
  // The third part is a single place: all its distances to itself are zero.
  auto spectrum = parts.spectrum;
  auto label = parts.label;
  for (std::size_t s = 0; s < 20; ++s) {
    label[s] = 2;
    spectrum.eigenfunction[s] = 4.0F;
  }
  const RelationView views[] = {{&spectrum, label}};
  for (const auto& pair : fit_relations(views, 3, {})) {
    EXPECT_NEAR(std::accumulate(pair.weight.begin(), pair.weight.end(), 0.0), 1.0, 1e-5);
    for (const float sigma : pair.sigma) EXPECT_GT(sigma, 0.02 * 2.0);  // mean distance above 2
  }
}

TEST(FitRelations, LikelihoodIsNotBelowThatOfOneGaussian) {
  const TwoParts parts(4);
  const RelationView views[] = {parts.view()};
  const auto one = fit_relations(views, 2, {.mixture = 1});
  const auto many = fit_relations(views, 2, {.mixture = 4});
  for (const std::size_t pair : {0U, 1U, 2U}) {
    double difference = 0.0;
    for (std::size_t i = 0; i < 400; ++i)
      for (std::size_t j = 0; j < i; ++j)
        if (pair_index(static_cast<std::size_t>(parts.label[i]),
                       static_cast<std::size_t>(parts.label[j])) == pair) {
          const double d =
              std::abs(parts.spectrum.eigenfunction[i] - parts.spectrum.eigenfunction[j]);
          difference += std::log(density(many[pair], d)) - std::log(density(one[pair], d));
        }
    EXPECT_GT(difference, 0.0);
  }
}

TEST(FitRelations, IsDeterministicAndHardlyDependsOnTheSeed) {
  const TwoParts parts(5);
  const RelationView views[] = {parts.view(), parts.view()};
  const auto first = fit_relations(views, 2, {});
  const auto again = fit_relations(views, 2, {});
  const auto other = fit_relations(views, 2, {.mixture = 1, .seed = 99});
  const auto single = fit_relations(views, 2, {.mixture = 1});
  for (std::size_t pair = 0; pair < 3; ++pair) {
    EXPECT_EQ(first[pair].mean, again[pair].mean);
    EXPECT_NEAR(other[pair].mean[0], single[pair].mean[0], 0.1);
  }
}

TEST(FitRelations, APairNeverSeenTogetherIsEmpty) {
  const TwoParts parts(6);
  auto only_first = parts.label;
  auto only_second = parts.label;
  for (auto& label : only_first) label = label == 0 ? 0 : kNoLabel;
  for (auto& label : only_second) label = label == 1 ? 1 : kNoLabel;
  const RelationView views[] = {{&parts.spectrum, only_first}, {&parts.spectrum, only_second}};
  const auto pairs = fit_relations(views, 2, {});
  EXPECT_FALSE(pairs[pair_index(0, 0)].weight.empty());
  EXPECT_TRUE(pairs[pair_index(0, 1)].weight.empty());
  EXPECT_FALSE(pairs[pair_index(1, 1)].weight.empty());
}

TEST(FitRelations, OfNoViewsHasEmptyMixtures) {
  const auto pairs = fit_relations({}, 3, {});
  EXPECT_EQ(pairs.size(), 6U);
  for (const auto& pair : pairs) EXPECT_TRUE(pair.weight.empty());
}

TEST(FitRelations, RefusesViewsThatDoNotFit) {
  const TwoParts parts(7);
  auto view = parts.view();
  view.label[3] = 2;
  EXPECT_THROW(fit_relations(std::span(&view, 1), 2, {}), InputError);
  view.label.pop_back();
  EXPECT_THROW(fit_relations(std::span(&view, 1), 3, {}), InputError);
  view.spectrum = nullptr;
  EXPECT_THROW(fit_relations(std::span(&view, 1), 3, {}), InputError);
}

TEST(LogPairPosterior, IsEquationsEightAndNine) {
  const auto model = small_model();
  const auto spectrum = test::line_spectrum({0.0F, 0.5F, 2.0F, 3.5F, 4.0F});
  const std::vector<std::int32_t> a = {0, 1};
  const std::vector<std::int32_t> b = {2, 3, 4};
  for (const auto likelihood : {Likelihood::literal, Likelihood::geomean}) {
    double expected[2][2];
    double evidence = 0.0;
    for (const std::size_t i : {0U, 1U})
      for (const std::size_t j : {0U, 1U}) {
        double sum = 0.0;
        double log_sum = 0.0;
        for (const auto s : a)
          for (const auto t : b) {
            const double p = density(model.pairs[pair_index(i, j)],
                                     spectrum.eigenfunction[static_cast<std::size_t>(t)] -
                                         spectrum.eigenfunction[static_cast<std::size_t>(s)]);
            sum += p;
            log_sum += std::log(p + 1e-3);
          }
        expected[i][j] = likelihood == Likelihood::literal ? sum : std::exp(log_sum / 6.0);
        evidence += expected[i][j];
      }
    const auto posterior = log_pair_posterior(spectrum, a, b, model, likelihood, 400);
    for (const std::size_t i : {0U, 1U})
      for (const std::size_t j : {0U, 1U})
        EXPECT_NEAR(posterior[2 * i + j], std::log(expected[i][j] / evidence), 1e-4);
  }
}

TEST(LogPairPosterior, IsAPosteriorAndSymmetric) {
  const TwoParts parts(8);
  const RelationView views[] = {parts.view()};
  RelationModel model = small_model();
  model.pairs = fit_relations(views, 2, {});
  std::vector<std::int32_t> a, b;
  for (std::int32_t s = 0; s < 100; ++s) (s % 2 == 0 ? a : b).push_back(s);
  for (const auto likelihood : {Likelihood::literal, Likelihood::geomean}) {
    const auto ab = log_pair_posterior(parts.spectrum, a, b, model, likelihood, 10000);
    const auto ba = log_pair_posterior(parts.spectrum, b, a, model, likelihood, 10000);
    double sum = 0.0;
    for (const double value : ab) sum += std::exp(value);
    EXPECT_NEAR(sum, 1.0, 1e-9);
    EXPECT_NEAR(ab[1], ba[2], 1e-4);
    EXPECT_NEAR(ab[1], ab[2], 1e-9);  // distances do not tell which is which
    EXPECT_GT(ab[1], ab[0]);
    EXPECT_GT(ab[1], ab[3]);
  }
}

TEST(LogPairPosterior, OfFewerDistancesIsNearlyTheSame) {
  const TwoParts parts(9);
  RelationModel model = small_model();
  const RelationView views[] = {parts.view()};
  model.pairs = fit_relations(views, 2, {});
  std::vector<std::int32_t> a, b;
  for (std::int32_t s = 0; s < 400; ++s) (s % 2 == 0 ? a : b).push_back(s);
  const auto all = log_pair_posterior(parts.spectrum, a, b, model, Likelihood::geomean, 40000);
  const auto few = log_pair_posterior(parts.spectrum, a, b, model, Likelihood::geomean, 200);
  EXPECT_NEAR(std::exp(few[1]), std::exp(all[1]), 0.02);
}

TEST(LogPairPosterior, StaysFiniteFarFromEverything) {
  const auto model = small_model();
  const auto spectrum = test::line_spectrum({0.0F, 1e4F});
  for (const auto likelihood : {Likelihood::literal, Likelihood::geomean})
    for (const double value :
         log_pair_posterior(spectrum, std::vector{0}, std::vector{1}, model, likelihood, 400))
      EXPECT_TRUE(std::isfinite(value));
}

TEST(LogPairPosterior, AnUnseenPairIsAsUnlikelyAsTheLeastLikely) {
  auto model = small_model();
  const auto spectrum = test::line_spectrum({0.0F, 1.0F, 2.2F});
  model.pairs[pair_index(0, 1)] = {};
  const auto posterior = log_pair_posterior(spectrum, std::vector{0}, std::vector{1, 2}, model,
                                            Likelihood::geomean, 400);
  EXPECT_DOUBLE_EQ(posterior[1], posterior[2]);
  EXPECT_DOUBLE_EQ(posterior[1], std::min(posterior[0], posterior[3]));
}

TEST(LogPairPosterior, HasNoOpinionWithoutSamplesOrPairs) {
  auto model = small_model();
  const auto spectrum = test::line_spectrum({0.0F, 1.0F});
  const auto zero = testing::Each(0.0);
  const std::vector<std::int32_t> none, one = {0}, other = {1};
  EXPECT_THAT(log_pair_posterior(spectrum, none, one, model, Likelihood::geomean, 400), zero);
  EXPECT_THAT(log_pair_posterior(spectrum, one, none, model, Likelihood::geomean, 400), zero);
  EXPECT_THAT(log_pair_posterior(spectrum, one, one, model, Likelihood::geomean, 400), zero);
  model.pairs.clear();
  EXPECT_THAT(log_pair_posterior(spectrum, one, other, model, Likelihood::geomean, 400), zero);
}

// Points of three labels along the x axis, one per millimetre: 0 .. 99, 100 .. 199, 200 .. 299.
Cloud striped_line() {
  Cloud cloud;
  for (int i = 0; i < 300; ++i) {
    cloud.xyz.insert(cloud.xyz.end(), {0.001F * static_cast<float>(i), 0.0F, 0.0F});
    cloud.label.push_back(i / 100);
  }
  cloud.label_names = {"a", "b", "c"};
  cloud.width = 300;
  return cloud;
}

TEST(ObservedNeighbours, AreThePartsThatTouch) {
  const Cloud cloud = striped_line();
  const Cloud* views[] = {&cloud};
  EXPECT_THAT(observed_neighbours(views, 3, 0.0055, 5),
              testing::ElementsAre(1, 1, 0, 1, 1, 1, 0, 1, 1));
}

TEST(ObservedNeighbours, NeedEnoughPairsInOneView) {
  const Cloud cloud = striped_line();
  const Cloud* views[] = {&cloud, &cloud};
  // Within 5.5 steps of each other across a border: 1 + 2 + 3 + 4 + 5 pairs.
  EXPECT_EQ(observed_neighbours(views, 3, 0.0055, 15)[1], 1);
  EXPECT_EQ(observed_neighbours(views, 3, 0.0055, 16)[1], 0);
}

TEST(ObservedNeighbours, MeasureInMultiplesOfTheScale) {
  Cloud cloud = striped_line();
  for (float& coordinate : cloud.xyz) coordinate *= 50.0F;
  cloud.scale = 50.0F;
  const Cloud* views[] = {&cloud};
  EXPECT_EQ(observed_neighbours(views, 3, 0.0055, 15)[1], 1);
}

TEST(ObservedNeighbours, OfNoViewsAreTheLabelsThemselves) {
  EXPECT_THAT(observed_neighbours({}, 2, 0.1, 1), testing::ElementsAre(1, 0, 0, 1));
}

TEST(ObservedNeighbours, RefuseUnlabelledViews) {
  Cloud cloud = striped_line();
  const Cloud* views[] = {&cloud};
  EXPECT_THROW(observed_neighbours(views, 2, 0.1, 1), InputError);
  cloud.label.clear();
  EXPECT_THROW(observed_neighbours(views, 3, 0.1, 1), InputError);
}

TEST(Relations, LikelihoodNamesRoundTrip) {
  for (const auto& [value, name] : names<Likelihood>())
    EXPECT_EQ(from_name<Likelihood>(name), value);
}

}  // namespace
}  // namespace cosegraph::astar
