#include "spectra/spectra.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "spectra/laplacian.hpp"
#include "spectra/surfaces.hpp"

namespace cosegraph::spectra {
namespace {

constexpr double kPi = std::numbers::pi;

// Largest relative difference of the leading eigenvalues from `expected`.
double error(const Spectrum& spectrum, const std::vector<double>& expected) {
  double worst = 0.0;
  for (std::size_t e = 0; e < expected.size(); ++e)
    worst = std::max(worst, std::abs(spectrum.eigenvalue.at(e) / expected[e] - 1.0));
  return worst;
}

double error(const Spectrum& spectrum, const Spectrum& expected) {
  return error(spectrum, {expected.eigenvalue.begin(), expected.eigenvalue.end()});
}

// l(l + 1), `multiplicity(l)` times, for l = 1 .. 3.
std::vector<double> spherical(int (*multiplicity)(int)) {
  std::vector<double> result;
  for (int l = 1; l <= 3; ++l) result.insert(result.end(), multiplicity(l), l * (l + 1.0));
  return result;
}

// The coordinates of the samples in multiples of the scale.
std::vector<double> sample_points(const Cloud& cloud, const Spectrum& spectrum) {
  std::vector<double> xyz;
  for (const std::int32_t s : spectrum.sample)
    for (std::size_t axis = 0; axis < 3; ++axis)
      xyz.push_back(double{cloud.xyz[3 * static_cast<std::size_t>(s) + axis]} / cloud.scale);
  return xyz;
}

Eigen::MatrixXd functions(const Spectrum& spectrum) {
  using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(spectrum.eigenfunction.data(),
                                    static_cast<Eigen::Index>(spectrum.sample.size()),
                                    static_cast<Eigen::Index>(spectrum.eigenvalue.size()))
      .cast<double>();
}

TEST(WeakSpectrum, OfASphere) {
  const auto expected = spherical([](int l) { return 2 * l + 1; });
  const auto cloud = test::sphere(6000, -1.0, 1);
  EXPECT_LT(error(compute(cloud, {}), expected), 0.04);
  EXPECT_LT(error(compute(cloud, {.samples = 2000}), expected), 0.015);
}

TEST(WeakSpectrum, OfAHemisphereWithFreeBoundary) {
  const auto expected = spherical([](int l) { return l + 1; });
  const auto cloud = test::sphere(6000, 0.0, 2);
  EXPECT_LT(error(compute(cloud, {}), expected), 0.05);
  EXPECT_LT(error(compute(cloud, {.samples = 2000}), expected), 0.03);
}

TEST(WeakSpectrum, OfASquare) {
  const std::vector<double> expected = {1, 1, 2, 4, 4, 5, 5, 8, 9, 9, 10, 10};
  const auto cloud = test::sheet(6000, kPi, kPi, 0.0, 3);
  EXPECT_LT(error(compute(cloud, {}), expected), 0.06);
  EXPECT_LT(error(compute(cloud, {.samples = 2000}), expected), 0.06);
}

TEST(WeakSpectrum, ChangesLittleWhenASheetIsBent) {
  const auto flat = compute(test::sheet(6000, 2.0, 1.0, 0.0, 4), {});
  const auto bent = compute(test::sheet(6000, 2.0, 1.0, 1.2, 4), {});
  EXPECT_LT(error(bent, flat), 0.06);
}

TEST(WeakSpectrum, IsThatOfADenseSolver) {
  const auto cloud = test::sphere(1000, -0.5, 5);
  const Params params{.samples = 120, .eigenpairs = 20};
  const auto spectrum = compute(cloud, params);
  const auto laplacian = weak_laplacian(sample_points(cloud, spectrum), params.neighbours);
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(120, 120);
  for (const auto& [a, b, weight] : laplacian.edge) {
    stiffness(a, a) += weight;
    stiffness(b, b) += weight;
    stiffness(a, b) -= weight;
    stiffness(b, a) -= weight;
  }
  const Eigen::MatrixXd mass =
      Eigen::Map<const Eigen::VectorXd>(laplacian.mass.data(), 120).asDiagonal();
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> dense(stiffness, mass);
  EXPECT_NEAR(dense.eigenvalues()[0], 0.0, 1e-9);
  for (int e = 0; e < 20; ++e)
    EXPECT_NEAR(spectrum.eigenvalue[static_cast<std::size_t>(e)], dense.eigenvalues()[e + 1],
                1e-5 * dense.eigenvalues()[e + 1]);

  const Eigen::MatrixXd function = functions(spectrum);
  EXPECT_LT((function.transpose() * mass * function - Eigen::MatrixXd::Identity(20, 20)).norm(),
            1e-4);
  EXPECT_LT((Eigen::RowVectorXd::Ones(120) * mass * function).norm(), 1e-4);
  const Eigen::VectorXd value =
      Eigen::Map<const Eigen::VectorXf>(spectrum.eigenvalue.data(), 20).cast<double>();
  EXPECT_LT((stiffness * function - mass * function * value.asDiagonal()).norm(),
            1e-4 * value.maxCoeff());
}

TEST(WeakSpectrum, SignsAreFixedByTheLargestEntry) {
  const auto function = functions(compute(test::sphere(2000, 0.2, 6), {.samples = 300}));
  for (Eigen::Index e = 0; e < function.cols(); ++e)
    EXPECT_GT(function.col(e).maxCoeff(), -function.col(e).minCoeff());
}

TEST(WeakSpectrum, DoesNotDependOnTheUnitOfLength) {
  auto cloud = test::sphere(2000, -0.2, 7);
  const auto expected = compute(cloud, {});
  for (float& coordinate : cloud.xyz) coordinate *= 1024.0F;
  cloud.scale = 1024.0F;
  const auto spectrum = compute(cloud, {});
  EXPECT_EQ(spectrum.sample, expected.sample);
  EXPECT_EQ(spectrum.eigenvalue, expected.eigenvalue);
  EXPECT_EQ(spectrum.eigenfunction, expected.eigenfunction);
}

TEST(WeakSpectrum, ScalesWithTheInverseSquareOfTheSize) {
  auto cloud = test::sphere(2000, -0.2, 7);
  const auto expected = compute(cloud, {});
  cloud.scale = 2.0F;
  const auto spectrum = compute(cloud, {});
  for (std::size_t e = 0; e < expected.eigenvalue.size(); ++e)
    EXPECT_NEAR(spectrum.eigenvalue[e], 4.0F * expected.eigenvalue[e],
                1e-4F * spectrum.eigenvalue[e]);
}

TEST(WeakSpectrum, DoesNotChangeUnderRigidMotion) {
  const auto cloud = test::sphere(2000, -0.2, 8);
  auto turned = cloud;
  for (std::size_t i = 0; i < turned.xyz.size(); i += 3) {
    const float x = turned.xyz[i];
    turned.xyz[i] = 0.6F * x - 0.8F * turned.xyz[i + 1];
    turned.xyz[i + 1] = 0.8F * x + 0.6F * turned.xyz[i + 1];
  }
  turned = test::moved(turned, 0.5, -1.0, 2.0);
  EXPECT_LT(error(compute(turned, {}), compute(cloud, {})), 5e-3);
}

TEST(WeakSpectrum, SamplesDoNotDependOnTheOrderOfThePoints) {
  const auto cloud = test::sphere(1500, 0.0, 9);
  const std::size_t count = cloud.size();
  auto reversed = cloud;
  for (std::size_t i = 0; i < count; ++i)
    std::copy_n(&cloud.xyz[3 * i], 3, &reversed.xyz[3 * (count - 1 - i)]);
  const auto expected = compute(cloud, {.samples = 200});
  auto spectrum = compute(reversed, {.samples = 200});
  for (auto& s : spectrum.sample) s = static_cast<std::int32_t>(count) - 1 - s;
  EXPECT_THAT(spectrum.sample, testing::UnorderedElementsAreArray(expected.sample));
  EXPECT_LT(error(spectrum, expected), 1e-4);
}

TEST(WeakSpectrum, IsTheSameInEveryRun) {
  const auto cloud = test::sphere(1500, 0.0, 10);
  const auto first = compute(cloud, {});
  const auto second = compute(cloud, {});
  EXPECT_EQ(first.eigenvalue, second.eigenvalue);
  EXPECT_EQ(first.eigenfunction, second.eigenfunction);
}

TEST(WeakSpectrum, EveryPointKnowsItsNearestSample) {
  auto cloud = test::sphere(1000, -1.0, 11);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    cloud.dense_index.push_back(static_cast<std::int32_t>(5000 + 2 * i));
  const auto spectrum = compute(cloud, {.samples = 100});
  ASSERT_EQ(spectrum.sample.size(), 100U);
  EXPECT_TRUE(std::ranges::is_sorted(spectrum.sample));
  const auto distance = [&](std::size_t a, std::int32_t sample) {
    const auto b = static_cast<std::size_t>(spectrum.sample[static_cast<std::size_t>(sample)]);
    double sum = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis)
      sum += std::pow(double{cloud.xyz[3 * a + axis]} - cloud.xyz[3 * b + axis], 2.0);
    return std::sqrt(sum);
  };
  for (std::size_t i = 0; i < cloud.size(); ++i)
    for (std::int32_t s = 0; s < 100; ++s)
      ASSERT_LE(distance(i, spectrum.nearest_sample[i]), distance(i, s) + 1e-9);
  for (std::size_t s = 0; s < 100; ++s)
    EXPECT_EQ(spectrum.sample_dense[s], 5000 + 2 * spectrum.sample[s]);
}

TEST(WeakSpectrum, PiecesAreJoinedByBridgesAndNamed) {
  const auto cloud = test::together(test::sphere(600, -1.0, 12),
                                    test::moved(test::sphere(600, -1.0, 13), 4.0, 0.0, 0.0));
  for (const double bridge : {0.01, 0.1}) {
    const auto spectrum = compute(cloud, {.samples = 400, .eigenpairs = 10, .bridge = bridge});
    for (std::size_t s = 0; s < spectrum.sample.size(); ++s)
      EXPECT_EQ(spectrum.component[s], spectrum.sample[s] < 600 ? 0 : 1);
    // Two equal masses and a spring: lambda = bridge (1 / m + 1 / m), and 1 / bridge between them.
    EXPECT_NEAR(spectrum.eigenvalue[0], bridge / (2.0 * kPi), 0.1 * bridge / (2.0 * kPi));
    const double across = std::pow(commute_distance(spectrum, 0, 399), 2.0);
    EXPECT_NEAR(across * bridge, 1.0, 0.3);
  }
}

TEST(WeakSpectrum, OfPointsOnALineIsFinite) {
  Cloud cloud;
  for (int i = 0; i < 50; ++i) test::add_point(cloud, 0.1 * i, 0.0, 0.0);
  const auto spectrum = compute(cloud, {.eigenpairs = 8});
  EXPECT_EQ(spectrum.component.back(), 49);
  for (const float value : spectrum.eigenvalue) EXPECT_GT(value, 0.0F);
  for (const float value : spectrum.eigenfunction) EXPECT_TRUE(std::isfinite(value));
}

TEST(WeakSpectrum, TakesTheFewestPointsPossible) {
  const auto cloud = test::sphere(27, -1.0, 14);
  EXPECT_EQ(compute(cloud, {}).eigenvalue.size(), 25U);
  EXPECT_EQ(compute(test::together(cloud, cloud), {}).sample.size(), 27U);  // copies do not count
}

TEST(MlsSpectrum, OfASphere) {
  const auto expected = spherical([](int l) { return 2 * l + 1; });
  const auto spectrum =
      compute(test::sphere(6000, -1.0, 15), {.op = Operator::mls, .samples = 1000});
  EXPECT_LT(error(spectrum, expected), 0.03);
}

TEST(MlsSpectrum, KeepsOnlyUsableEigenvaluesWhereABoundaryBreaksIt) {
  const auto spectrum = compute(test::sphere(4000, 0.0, 16), {.op = Operator::mls});
  ASSERT_EQ(spectrum.eigenvalue.size(), 25U);
  EXPECT_TRUE(std::ranges::is_sorted(spectrum.eigenvalue));
  EXPECT_GT(spectrum.eigenvalue.front(), 0.0F);
  for (const float value : spectrum.eigenfunction) EXPECT_TRUE(std::isfinite(value));
}

TEST(CommuteDistance, IsAMetricAndThatOfTheEmbedding) {
  const auto spectrum = compute(test::sphere(2000, -0.4, 17), {.samples = 150});
  const auto embedding = commute_embedding(spectrum);
  const std::size_t width = spectrum.eigenvalue.size();
  const auto row = [&](std::int32_t s) {
    return Eigen::Map<const Eigen::VectorXf>(&embedding[static_cast<std::size_t>(s) * width],
                                             static_cast<Eigen::Index>(width));
  };
  Random random(18);
  for (int run = 0; run < 500; ++run) {
    const auto pick = random.sample(150, 3);
    const double ab = commute_distance(spectrum, pick[0], pick[1]);
    const double bc = commute_distance(spectrum, pick[1], pick[2]);
    const double ac = commute_distance(spectrum, pick[0], pick[2]);
    EXPECT_GT(ab, 0.0);
    EXPECT_DOUBLE_EQ(ab, commute_distance(spectrum, pick[1], pick[0]));
    EXPECT_LE(ac, ab + bc + 1e-9);
    EXPECT_NEAR(ab, (row(pick[0]) - row(pick[1])).norm(), 1e-4);
  }
  EXPECT_DOUBLE_EQ(commute_distance(spectrum, 3, 3), 0.0);
}

TEST(CommuteDistance, GrowsAlongAStrip) {
  const auto cloud = test::sheet(3000, 5.0, 0.5, 0.0, 19);
  const auto spectrum = compute(cloud, {});
  const auto at = [&](float x) {
    std::size_t best = 0;
    for (std::size_t i = 0; i < cloud.size(); ++i)
      if (std::abs(cloud.xyz[3 * i] - x) < std::abs(cloud.xyz[3 * best] - x)) best = i;
    return spectrum.nearest_sample[best];
  };
  double last = 0.0;
  for (const float x : {1.0F, 2.0F, 3.0F, 4.0F, 5.0F}) {
    const double distance = commute_distance(spectrum, at(0.0F), at(x));
    EXPECT_GT(distance, last);
    last = distance;
  }
}

TEST(Spectra, RefuseWhatCannotBeUsed) {
  EXPECT_THROW(compute({}, {}), InputError);
  EXPECT_THROW(compute(test::sphere(26, -1.0, 20), {}), InputError);
  EXPECT_THROW(compute(test::sphere(100, -1.0, 20), {.samples = 26}), ParameterError);
  auto cloud = test::sphere(100, -1.0, 20);
  cloud.scale = 0.0F;
  EXPECT_THROW(compute(cloud, {}), InputError);
  cloud.scale = 1.0F;
  cloud.xyz[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(compute(cloud, {}), InputError);
}

TEST(Spectra, RecipeHoldsAllParameters) {
  Params params{.op = Operator::mls, .samples = 77, .eigenpairs = 12, .bridge = 0.5};
  const std::string text = recipe(describe(params));
  Params other;
  apply_recipe(describe(other), text);
  EXPECT_EQ(recipe(describe(other)), text);
  EXPECT_EQ(compute(test::sphere(200, -1.0, 21), params).recipe, text);
}

TEST(Spectra, OperatorNamesRoundTrip) {
  for (const auto& [value, name] : names<Operator>()) EXPECT_EQ(from_name<Operator>(name), value);
}

}  // namespace
}  // namespace cosegraph::spectra
