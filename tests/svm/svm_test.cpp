#include "svm/svm.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/error.hpp"
#include "core/random.hpp"
#include "svm/gram.hpp"
#include "svm/oracles.hpp"

namespace cosegraph::svm {
namespace {

using test::Problem;
using testing::Each;
using testing::FloatNear;

// Unequally many noisy vectors around a centre per label, `spread` apart.
Problem blobs(int count, int dimension, int labels, double spread, std::uint64_t seed = 1) {
  Random random(seed);
  std::vector<double> centre(static_cast<std::size_t>(labels) * dimension);
  for (double& c : centre) c = spread * random.normal();
  Problem problem{.dimension = dimension, .label_count = labels};
  for (int i = 0; i < count; ++i) {
    const auto label = static_cast<std::int32_t>(
        i < labels ? i : std::min(random.below(labels), random.below(labels)));
    problem.label.push_back(label);
    for (int d = 0; d < dimension; ++d)
      problem.vectors.push_back(
          static_cast<float>(centre[label * dimension + d] + random.normal()));
  }
  return problem;
}

Classifier train(const Problem& p, const TrainParams& params) {
  return svm::train(p.vectors, p.dimension, p.label, p.label_count, params);
}

double accuracy(const Classifier& classifier, const Problem& p) {
  const auto margin = margins(classifier, p.vectors);
  int right = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const auto row = margin.begin() + static_cast<std::ptrdiff_t>(i) * p.label_count;
    right += std::max_element(row, row + p.label_count) - row == p.label[i];
  }
  return static_cast<double>(right) / static_cast<double>(p.size());
}

// Ours against the oracle's margins, by the largest difference.
double worst_difference(const Classifier& classifier, const Problem& p, std::int32_t label,
                        const std::vector<double>& expected) {
  const auto margin = margins(classifier, p.vectors);
  double worst = 0.0;
  for (std::size_t i = 0; i < p.size(); ++i)
    worst = std::max(worst, std::abs(margin[i * p.label_count + label] - expected[i]));
  return worst;
}

test::OracleParams oracle_params(const Problem& p, std::int32_t label, const TrainParams& params,
                                 double gamma) {
  const auto total = static_cast<double>(p.size());
  const auto positive = static_cast<double>(std::ranges::count(p.label, label));
  if (!params.balance) return {gamma, params.cost, params.cost};
  return {gamma, params.cost * total / (2.0 * positive),
          params.cost * total / (2.0 * (total - positive))};
}

TEST(GramMatrix, HoldsTheInnerProducts) {
  for (const int count : {1, 3, 17, 40})
    for (const int dimension : {1, 7, 513, 1030}) {
      const Problem p = blobs(count, dimension, 1, 0.0);
      const auto gram = gram_matrix(p.vectors, dimension);
      ASSERT_EQ(gram.size(), static_cast<std::size_t>(count) * count);
      for (int i = 0; i < count; ++i)
        for (int j = 0; j < count; ++j) {
          const float* a = &p.vectors[i * dimension];
          const double expected =
              std::inner_product(a, a + dimension, &p.vectors[j * dimension], 0.0);
          EXPECT_NEAR(gram[i * count + j], expected, 1e-5 * dimension);
          EXPECT_EQ(gram[i * count + j], gram[j * count + i]);
        }
    }
}

void expect_libsvm_agrees(const Problem& p, const TrainParams& params, double tolerance) {
  const Classifier classifier = train(p, params);
  for (std::int32_t label = 0; label < p.label_count; ++label)
    EXPECT_LT(worst_difference(classifier, p, label,
                               test::libsvm_margins(
                                   p, label, oracle_params(p, label, params, classifier.gamma))),
              tolerance)
        << to_name(params.kernel) << " cost " << params.cost << " balance " << params.balance
        << " label " << label;
}

// Both stop within a tolerance of the optimum; margins are the less determined the higher the cost.
TEST(Train, AgreesWithLibsvm) {
  for (const double spread : {0.1, 0.6, 3.0}) {  // inseparable, overlapping, separable
    SCOPED_TRACE(spread);
    const Problem p = blobs(120, 6, 3, spread);
    for (const Kernel kernel : {Kernel::linear, Kernel::rbf})
      for (const bool balance : {false, true}) {
        expect_libsvm_agrees(p, {.kernel = kernel, .cost = 1.0, .balance = balance}, 5e-3);
        expect_libsvm_agrees(p, {.kernel = kernel, .cost = 5.0, .balance = balance}, 3e-2);
      }
    expect_libsvm_agrees(p, {.kernel = Kernel::rbf, .cost = 0.1, .balance = false}, 5e-3);
  }
}

// liblinear has no bias or penalises it; the best bias of a point-symmetric problem is 0.
TEST(Train, AgreesWithLiblinear) {
  Problem p = blobs(80, 5, 2, 0.8);
  const std::size_t half = p.size();
  for (std::size_t i = 0; i < half; ++i) p.label.push_back(1 - p.label[i]);
  for (std::size_t i = 0; i < half * 5; ++i) p.vectors.push_back(-p.vectors[i]);
  const TrainParams params{.kernel = Kernel::linear, .cost = 0.5};
  EXPECT_LT(worst_difference(train(p, params), p, 1,
                             test::liblinear_margins(p, 1, oracle_params(p, 1, params, 0.0))),
            5e-3);
}

TEST(Train, SeparatesWhatIsSeparable) {
  const Problem p = blobs(200, 40, 4, 2.0);
  EXPECT_EQ(accuracy(train(p, {.kernel = Kernel::linear}), p), 1.0);
  EXPECT_EQ(accuracy(train(p, {.kernel = Kernel::rbf}), p), 1.0);
}

TEST(Train, RbfSeparatesARingFromItsCentre) {
  Random random(4);
  Problem p{.dimension = 2, .label_count = 2};
  for (int i = 0; i < 200; ++i) {
    const double radius = i % 2 == 0 ? 0.5 * random.uniform() : 2.0;
    const double angle = random.uniform(0.0, 6.28);
    p.vectors.push_back(static_cast<float>(radius * std::cos(angle)));
    p.vectors.push_back(static_cast<float>(radius * std::sin(angle)));
    p.label.push_back(i % 2);
  }
  EXPECT_EQ(accuracy(train(p, {.kernel = Kernel::rbf}), p), 1.0);
  EXPECT_LT(accuracy(train(p, {.kernel = Kernel::linear}), p), 0.9);
}

TEST(Train, OfTwoLabelsGivesOppositeMargins) {
  const Problem p = blobs(60, 3, 2, 0.5);
  for (const Kernel kernel : {Kernel::linear, Kernel::rbf}) {
    const auto margin = margins(train(p, {.kernel = kernel}), p.vectors);
    for (std::size_t i = 0; i < p.size(); ++i) EXPECT_NEAR(margin[2 * i], -margin[2 * i + 1], 3e-3);
  }
}

TEST(Train, DoesNotDependOnTheOrderOfVectors) {
  const Problem p = blobs(90, 4, 3, 0.7);
  std::vector<std::int32_t> order(p.size());
  std::iota(order.begin(), order.end(), 0);
  Random(2).shuffle(std::span(order));
  Problem shuffled{.dimension = 4, .label_count = 3};
  for (const std::int32_t i : order) {
    shuffled.vectors.insert(shuffled.vectors.end(), &p.vectors[4 * i], &p.vectors[4 * i] + 4);
    shuffled.label.push_back(p.label[i]);
  }
  for (const Kernel kernel : {Kernel::linear, Kernel::rbf}) {
    const auto a = margins(train(p, {.kernel = kernel}), p.vectors);
    const auto b = margins(train(shuffled, {.kernel = kernel}), p.vectors);
    EXPECT_THAT(b, testing::Pointwise(FloatNear(5e-3F), a));
  }
}

TEST(Train, IsTheSameTwice) {
  const Problem p = blobs(90, 40, 3, 0.7);
  for (const Kernel kernel : {Kernel::linear, Kernel::rbf}) {
    const Classifier a = train(p, {.kernel = kernel});
    const Classifier b = train(p, {.kernel = kernel});
    EXPECT_EQ(a.weight, b.weight);
    EXPECT_EQ(a.support, b.support);
    EXPECT_EQ(a.coefficient, b.coefficient);
    EXPECT_EQ(a.bias, b.bias);
  }
}

TEST(Train, BalancedClassesIgnoreHowOftenEachIsRepeated) {
  const Problem p = blobs(40, 3, 2, 0.6);
  Problem repeated = p;
  for (int time = 0; time < 4; ++time)
    for (std::size_t i = 0; i < p.size(); ++i)
      if (p.label[i] == 1) {
        repeated.label.push_back(1);
        repeated.vectors.insert(repeated.vectors.end(), &p.vectors[3 * i], &p.vectors[3 * i] + 3);
      }
  // Costs count all packets, so the total cost stays the same only relative to their number.
  const double ratio = static_cast<double>(p.size()) / static_cast<double>(repeated.size());
  const auto a = margins(train(p, {.kernel = Kernel::linear}), p.vectors);
  const auto b = margins(train(repeated, {.kernel = Kernel::linear, .cost = ratio}), p.vectors);
  EXPECT_THAT(b, testing::Pointwise(FloatNear(5e-3F), a));
}

TEST(Train, WithOneLabelAlwaysAnswersIt) {
  Problem p = blobs(10, 3, 1, 1.0);
  for (const Kernel kernel : {Kernel::linear, Kernel::rbf}) {
    const Classifier classifier = train(p, {.kernel = kernel});
    EXPECT_THAT(margins(classifier, p.vectors), Each(1.0F));
  }
}

TEST(Train, TakesEqualVectorsOfDifferentLabels) {
  const Problem p{.dimension = 2,
                  .vectors = {1.0F, 1.0F, 1.0F, 1.0F, 1.0F, 1.0F},
                  .label = {0, 1, 1},
                  .label_count = 2};
  for (const Kernel kernel : {Kernel::linear, Kernel::rbf})
    EXPECT_THAT(margins(train(p, {.kernel = kernel}), p.vectors),
                Each(testing::Truly([](float m) { return std::isfinite(m); })));
}

TEST(Train, RefusesWhatItCannotLearn) {
  const std::vector<float> vectors = {0.0F, 1.0F, 2.0F};
  const std::vector<std::int32_t> label = {0, 1, 1};
  const TrainParams linear{.kernel = Kernel::linear};
  EXPECT_THROW(svm::train(vectors, 1, label, 3, linear), InputError) << "label 2 has no vector";
  EXPECT_THROW(svm::train(vectors, 2, label, 2, linear), InputError);
  EXPECT_THROW(svm::train(vectors, 1, label, 1, linear), InputError) << "label 1 is unknown";
  EXPECT_THROW(svm::train({}, 1, {}, 1, linear), InputError);
  EXPECT_THROW(svm::train(vectors, 1, label, 2, {}), ParameterError) << "automatic";
  const std::vector<float> broken = {0.0F, std::nanf(""), 2.0F};
  EXPECT_THROW(svm::train(broken, 1, label, 2, linear), InputError);
}

TEST(Margins, RefuseVectorsOfAnotherDimension) {
  const Classifier classifier = train(blobs(10, 3, 2, 1.0), {.kernel = Kernel::linear});
  EXPECT_TRUE(margins(classifier, {}).empty());
  EXPECT_THROW(margins(classifier, std::vector<float>(4)), MismatchError);
}

TEST(Margins, RefuseTablesBeyondAllMeasure) {
  constexpr int kLabels = 1 << 20;
  const Classifier classifier{.kernel = "linear",
                              .dimension = 1,
                              .label_count = kLabels,
                              .weight = std::vector<float>(kLabels),
                              .bias = std::vector<float>(kLabels)};
  EXPECT_THROW(margins(classifier, std::vector<float>(257)), InputError);
}

// A classifier whose margins are the vectors themselves.
AppearanceModel identity_model() {
  AppearanceModel model;
  model.label_names = {"a", "b"};
  model.label_share = {0.3F, 0.7F};
  model.classifier = {.kernel = "linear",
                      .dimension = 2,
                      .label_count = 2,
                      .weight = {1.0F, 0.0F, 0.0F, 1.0F},
                      .bias = {0.0F, 0.0F},
                      .sharpness = 2.0};
  return model;
}

TEST(Score, AveragesTheSoftmaxOfAllPacketsOfASegment) {
  const Encodings encodings{.segment_count = 3,
                            .dimension = 2,
                            .segment = {0, 0, 2},
                            .value = {1.0F, 0.0F, -1.0F, 2.0F, 0.0F, 400.0F}};
  const Scores scores = score(encodings, identity_model());
  EXPECT_THAT(scores.label_names, testing::ElementsAre("a", "b"));
  EXPECT_EQ(scores.majority, 1);
  EXPECT_EQ(scores.segment_count, 3);
  const double first = 1.0 / (1.0 + std::exp(-2.0));
  const double second = 1.0 / (1.0 + std::exp(6.0));
  const auto p = static_cast<float>(0.5 * (first + second));
  EXPECT_THAT(scores.probability,
              testing::Pointwise(FloatNear(1e-6F), {p, 1.0F - p, 0.5F, 0.5F, 0.0F, 1.0F}));
}

TEST(Score, OfNoSegmentIsEmpty) {
  EXPECT_TRUE(score({.segment_count = 0, .dimension = 2}, identity_model()).probability.empty());
}

TEST(Score, RefusesWhatDoesNotFitTheModel) {
  EXPECT_THROW(score({.segment_count = 1, .dimension = 3}, identity_model()), MismatchError);
  const Encodings outside{.segment_count = 1, .dimension = 2, .segment = {1}, .value = {0.F, 0.F}};
  EXPECT_THROW(score(outside, identity_model()), InputError);
  const Encodings missing{.segment_count = 1, .dimension = 2, .segment = {0}, .value = {0.F}};
  EXPECT_THROW(score(missing, identity_model()), InputError);
}

TEST(KernelNames, RoundTrip) {
  for (const auto& [value, text] : names<Kernel>()) EXPECT_EQ(from_name<Kernel>(text), value);
}

TEST(TrainParams, RoundTripAsARecipe) {
  TrainParams a{Kernel::rbf, 0.125, 2.5, false, 7.0};
  TrainParams b;
  apply_recipe(describe(b), recipe(describe(a)));
  EXPECT_EQ(recipe(describe(b)), recipe(describe(a)));
  EXPECT_EQ(b.cost, 0.125);
}

}  // namespace
}  // namespace cosegraph::svm
