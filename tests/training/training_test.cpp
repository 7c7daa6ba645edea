#include "training/training.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.hpp"
#include "core/random.hpp"
#include "fisher/fisher.hpp"
#include "model/model.hpp"
#include "svm/svm.hpp"

namespace cosegraph::training {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

constexpr int kDimension = 8;

// Smaller than the defaults, for speed. Fewer components than parts: a Fisher vector tells where in
// a component the descriptors lie, and nothing of parts that have a component each.
Params small_params() {
  Params params;
  params.mixture.components = 2;
  params.draw = {.clusters = 12, .packets = 8};
  params.encoding.cluster_points = 8;
  params.encoding.packet_clusters = 3;
  return params;
}

// A descriptor typical of its part, in noise.
void add_descriptor(DescriptorChannel& channel, int part, double noise, Random& random) {
  for (int d = 0; d < channel.dimension; ++d)
    channel.value.push_back(
        static_cast<float>(3.0 * std::sin(1.0 + 7.0 * part + d) + noise * random.normal()));
}

// Parts are boxes of unit length, side by side along x: "body" from 0, "handle" from 1, "rim" from
// 2. Points at the very end of the rim are unlabelled.
View synthetic_view(std::uint64_t seed, int parts = 3) {
  Random random(seed);
  View view;
  Cloud& cloud = view.cloud;
  cloud.recipe = "spacing=0.014";
  const std::vector<std::string> names = {"body", "handle", "rim"};
  cloud.label_names.assign(names.begin(), names.begin() + parts);
  view.descriptors.recipe = "channels=fine,coarse";
  view.descriptors.channels = {{.name = "fine", .dimension = kDimension},
                               {.name = "coarse", .dimension = 2 * kDimension}};
  for (int i = 0; i < 120 * parts; ++i) {
    const double x = random.uniform(0.0, parts);
    const int part = static_cast<int>(x);
    for (const double v : {x, random.uniform(0.0, 0.3), random.uniform(0.0, 0.3)})
      cloud.xyz.push_back(static_cast<float>(v));
    cloud.label.push_back(x > parts - 0.05 ? kNoLabel : part);
    for (std::size_t c = 0; c < 2; ++c)
      if (i % (c + 1) == 0) {
        view.descriptors.channels[c].keypoint.push_back(i);
        add_descriptor(view.descriptors.channels[c], part, 1.0, random);
      }
  }
  cloud.width = static_cast<std::uint32_t>(cloud.size());
  return view;
}

// Eigenfunctions cos(i x): the distance of two samples grows with that of their x.
void add_spectrum(View& view) {
  Spectrum spectrum{.recipe = "eigenpairs=3"};
  for (int e = 1; e <= 3; ++e) spectrum.eigenvalue.push_back(static_cast<float>(e * e));
  for (std::size_t i = 0; i < view.cloud.size(); i += 4) {
    spectrum.sample.push_back(static_cast<std::int32_t>(i));
    spectrum.sample_dense.push_back(static_cast<std::int32_t>(i));
    spectrum.component.push_back(0);
    for (int e = 1; e <= 3; ++e)
      spectrum.eigenfunction.push_back(std::cos(static_cast<float>(e) * view.cloud.xyz[3 * i]));
  }
  for (std::size_t i = 0; i < view.cloud.size(); ++i)
    spectrum.nearest_sample.push_back(
        static_cast<std::int32_t>(std::min(i / 4, spectrum.sample.size() - 1)));
  view.spectrum = std::move(spectrum);
}

std::vector<View> synthetic_views(bool with_spectra = false) {
  std::vector<View> views;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    views.push_back(synthetic_view(seed));
    if (with_spectra) add_spectrum(views.back());
  }
  return views;
}

template <class Error>
std::string refusal(const std::vector<View>& views, const Params& params = small_params()) {
  try {
    train(views, params);
  } catch (const Error& error) {
    return error.what();
  }
  return "learned";
}

// Labels of the true parts of an unseen view, taken as its segments.
std::vector<std::string> labels_of_parts(const Model& model, View query) {
  Segments segments{.count = 3};
  for (std::size_t i = 0; i < query.cloud.size(); ++i) {
    query.cloud.dense_index.push_back(static_cast<std::int32_t>(i));
    segments.of_point.push_back(static_cast<std::int32_t>(query.cloud.xyz[3 * i]));
  }
  const Scores scores = svm::score(
      fisher::encode_segments(query.cloud, query.descriptors, segments, model.appearance, {}),
      model.appearance);
  std::vector<std::string> result;
  for (auto row = scores.probability.begin(); row != scores.probability.end(); row += 3)
    result.push_back(scores.label_names[std::max_element(row, row + 3) - row]);
  return result;
}

TEST(Training, LearnsPartsThatLookDifferent) {
  for (const auto method : {fisher::Method::fv, fisher::Method::bow}) {
    Params params = small_params();
    params.encoding.method = method;
    const Model model = train(synthetic_views(), params);
    EXPECT_THAT(labels_of_parts(model, synthetic_view(99)), ElementsAre("body", "handle", "rim"));
    EXPECT_EQ(model.appearance.classifier.kernel, method == fisher::Method::fv ? "linear" : "rbf");
  }
}

TEST(Training, MakesAModelThatPassesTheChecksAndRoundTrips) {
  for (const bool with_spectra : {false, true}) {
    const Model model = train(synthetic_views(with_spectra), small_params());
    EXPECT_NO_THROW(model::check(model.appearance));
    EXPECT_NO_THROW(model::check(model.relation));
    const std::string bytes = model::to_bytes(model);
    EXPECT_EQ(model::to_bytes(model::from_bytes(bytes, "x")), bytes);
  }
}

TEST(Training, RecordsWhatItsViewsWere) {
  const Model model = train(synthetic_views(true), small_params());
  const AppearanceModel& a = model.appearance;
  EXPECT_THAT(a.label_names, ElementsAre("body", "handle", "rim"));
  EXPECT_EQ(a.label_names, model.relation.label_names);
  EXPECT_EQ(a.cloud_recipe, "spacing=0.014");
  EXPECT_EQ(a.descriptor_recipe, "channels=fine,coarse");
  fisher::Encoding encoding = small_params().encoding;
  EXPECT_EQ(a.encoding_recipe, recipe(fisher::describe(encoding)));
  EXPECT_EQ(model.relation.spectrum_recipe, "eigenpairs=3");
  EXPECT_EQ(a.id, model.relation.id);
  EXPECT_EQ(a.id, model::content_id(model));
  ASSERT_THAT(a.channels, SizeIs(2));
  EXPECT_EQ(a.channels[1].name, "coarse");
  EXPECT_EQ(a.channels[1].dimension, 2 * kDimension);
}

TEST(Training, CountsTheLabelledPoints) {
  std::vector<View> views = {synthetic_view(1)};
  const auto& label = views[0].cloud.label;
  const auto labelled = std::ranges::count_if(label, [](auto l) { return l != kNoLabel; });
  const Model model = train(views, small_params());
  for (int l = 0; l < 3; ++l)
    EXPECT_FLOAT_EQ(
        model.appearance.label_share[l],
        static_cast<float>(std::ranges::count(label, l)) / static_cast<float>(labelled));
}

TEST(Training, IsTheSameTwice) {
  const auto views = synthetic_views(true);
  EXPECT_EQ(model::to_bytes(train(views, small_params())),
            model::to_bytes(train(views, small_params())));
}

TEST(Training, ItsHalvesAreLearnedIndependently) {
  const auto views = synthetic_views(true);
  const Model model = train(views, small_params());
  auto without_spectra = views;
  without_spectra[1].spectrum.reset();  // appearance does not look at them
  Model halves{.appearance = learn_appearance(without_spectra, small_params()),
               .relation = learn_relations(views, small_params())};
  EXPECT_EQ(halves.appearance.id, 0U);
  halves.appearance.id = halves.relation.id = model.appearance.id;
  EXPECT_EQ(model::to_bytes(halves), model::to_bytes(model));
  EXPECT_THROW(learn_relations(without_spectra, small_params()), MismatchError);
}

TEST(Training, DoesNotDependOnTheOrderOfLabelNames) {
  auto views = synthetic_views(true);
  const std::string before = model::to_bytes(train(views, small_params()));
  views[1].cloud.label_names = {"rim", "body", "handle"};
  for (auto& label : views[1].cloud.label)
    if (label != kNoLabel) label = (label + 1) % 3;
  EXPECT_EQ(model::to_bytes(train(views, small_params())), before);
}

TEST(Training, LeavesUnlabelledPointsOut) {
  auto views = synthetic_views(true);
  const Model before = train(views, small_params());
  for (View& view : views)
    for (DescriptorChannel& channel : view.descriptors.channels)
      for (std::size_t row = 0; row < channel.keypoint.size(); ++row)
        if (view.cloud.label[channel.keypoint[row]] == kNoLabel)
          std::fill_n(channel.value.begin() + static_cast<std::ptrdiff_t>(row) * channel.dimension,
                      channel.dimension, 1e6F);
  EXPECT_EQ(model::to_bytes(train(views, small_params())), model::to_bytes(before));
}

TEST(Training, BringsEveryBlockToUnitMeanNorm) {
  const auto views = synthetic_views();
  const Params params = small_params();
  const Model model = train(views, params);
  const auto& channels = model.appearance.channels;
  std::vector<double> sum(2, 0.0);
  std::size_t packets = 0;
  for (std::size_t v = 0; v < views.size(); ++v)
    for (std::int32_t part = 0; part < 3; ++part) {  // the packets that training drew
      fisher::Draw draw = params.draw;
      draw.seed = derive_seed(params.draw.seed, v, part);
      const auto drawn = fisher::draw_packets(views[v].cloud.xyz, views[v].cloud.label, part,
                                              views[v].descriptors.channels, params.encoding, draw);
      const std::vector<std::vector<float>> values = {views[v].descriptors.channels[0].value,
                                                      views[v].descriptors.channels[1].value};
      const auto vectors = fisher::encode_packets(drawn, values, channels, params.encoding);
      const std::size_t first = fisher::block_size(channels[0].mixture, params.encoding);
      const std::size_t stride = first + fisher::block_size(channels[1].mixture, params.encoding);
      for (std::size_t at = 0; at < vectors.size(); at += stride, ++packets) {
        double norm[2] = {};
        for (std::size_t i = 0; i < stride; ++i)
          norm[i < first ? 0 : 1] += std::pow(vectors[at + i], 2);
        for (int c = 0; c < 2; ++c) sum[c] += std::sqrt(norm[c]);
      }
    }
  ASSERT_EQ(packets, 72U);
  for (int c = 0; c < 2; ++c) EXPECT_NEAR(sum[c] / 72.0, 1.0, 1e-4);
}

TEST(Training, ProjectsLongDescriptorsOnly) {
  Params params = small_params();
  params.projection = kDimension;
  const Model model = train(synthetic_views(), params);
  EXPECT_EQ(model.appearance.channels[0].projection.output, 0);
  EXPECT_EQ(model.appearance.channels[1].projection.output, kDimension);
  EXPECT_EQ(model.appearance.channels[1].mixture.dimension, kDimension);
  EXPECT_THAT(labels_of_parts(model, synthetic_view(99)), ElementsAre("body", "handle", "rim"));
}

TEST(Training, FitsMixturesToASubsetOfTheDescriptors) {
  Params params = small_params();
  params.mixture_samples = 200;
  const Model model = train(synthetic_views(), params);
  EXPECT_NE(model::to_bytes(model), model::to_bytes(train(synthetic_views(), small_params())));
  EXPECT_THAT(labels_of_parts(model, synthetic_view(99)), ElementsAre("body", "handle", "rim"));
}

TEST(Training, KnowsWhichPartsTouch) {
  Params params = small_params();
  params.neighbour_radius = 0.1;
  const Model model = train(synthetic_views(), params);
  EXPECT_THAT(model.relation.neighbours, ElementsAre(1, 1, 0, 1, 1, 1, 0, 1, 1));
}

TEST(Training, WithoutSpectraHasNoRelations) {
  const Model model = train(synthetic_views(false), small_params());
  EXPECT_TRUE(model.relation.pairs.empty());
  EXPECT_TRUE(model.relation.spectrum_recipe.empty());
  EXPECT_THAT(model.relation.neighbours, SizeIs(9));
}

TEST(Training, WithSpectraKnowsThatDistantPartsAreDistant) {
  const Model model = train(synthetic_views(true), small_params());
  ASSERT_THAT(model.relation.pairs, SizeIs(6));
  const auto mean_distance = [&](std::size_t a, std::size_t b) {
    const DistanceMixture& m = model.relation.pairs[pair_index(a, b)];
    double sum = 0.0;
    for (std::size_t k = 0; k < m.mean.size(); ++k) sum += m.weight[k] * m.mean[k];
    return sum;
  };
  EXPECT_GT(mean_distance(0, 2), mean_distance(0, 1));
  EXPECT_GT(mean_distance(0, 1), mean_distance(0, 0));
}

TEST(Training, TakesAPartThatOnlyOneViewShows) {
  auto views = synthetic_views();
  for (std::size_t v = 1; v < 3; ++v)
    for (auto& label : views[v].cloud.label)
      if (label == 2) label = kNoLabel;
  EXPECT_THAT(labels_of_parts(train(views, small_params()), synthetic_view(99)),
              ElementsAre("body", "handle", "rim"));
}

TEST(Training, ReportsRisingProgressPerStep) {
  std::vector<std::pair<std::string, double>> reports;
  train(synthetic_views(), small_params(),
        [&](std::string_view step, double done) { reports.emplace_back(step, done); });
  ASSERT_GE(reports.size(), 4U);
  EXPECT_EQ(reports.front().first, "mixtures");
  EXPECT_EQ(reports.back(), (std::pair<std::string, double>("relations", 1.0)));
  for (std::size_t i = 1; i < reports.size(); ++i)
    if (reports[i].first == reports[i - 1].first) {
      EXPECT_GT(reports[i].second, reports[i - 1].second);
    }
}

TEST(Training, RefusesViewsItCannotLearnFrom) {
  EXPECT_THAT(refusal<InputError>({}), HasSubstr("no view"));

  auto views = synthetic_views();
  views[1].cloud.label.clear();
  views[1].cloud.label_names.clear();
  EXPECT_EQ(refusal<InputError>(views), "view 1 has no labels");

  views = synthetic_views();
  std::ranges::fill(views[2].cloud.label, kNoLabel);
  EXPECT_EQ(refusal<InputError>(views), "view 2 has no labels");

  views = synthetic_views();
  views[1].cloud.xyz[4] = std::nanf("");
  EXPECT_EQ(refusal<InputError>(views), "view 1 has a point that is not finite, or too far out");

  EXPECT_THAT(refusal<InputError>({synthetic_view(1, 1)}), HasSubstr("single part, 'body'"));

  views = synthetic_views();
  views[0].cloud.label_names.push_back("spout");
  EXPECT_EQ(refusal<InputError>(views), "no view shows the part 'spout'");

  views = {synthetic_view(1)};
  auto& coarse = views[0].descriptors.channels[1];
  for (const std::int32_t point : coarse.keypoint)
    if (views[0].cloud.label[point] == 1) views[0].cloud.label[point] = 0;
  EXPECT_THAT(refusal<InputError>(views), HasSubstr("'handle' has no view with a keypoint"));
}

TEST(Training, RefusesInconsistentViews) {
  auto views = synthetic_views();
  views[1].cloud.label.pop_back();
  EXPECT_THAT(refusal<InputError>(views), HasSubstr("view 1: "));
  views = synthetic_views();
  views[1].descriptors.channels[0].value.pop_back();
  EXPECT_THAT(refusal<InputError>(views), HasSubstr("values do not fit keypoints"));
  views = synthetic_views();
  views[1].descriptors.channels[0].keypoint[0] = 100000;
  EXPECT_THAT(refusal<InputError>(views), HasSubstr("not a point of the cloud"));
  views = synthetic_views();
  views[1].descriptors.channels[0].value[40] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(refusal<InputError>(views), HasSubstr("not finite"));
  views = synthetic_views();
  views[1].descriptors.channels.clear();
  EXPECT_THAT(refusal<InputError>(views), HasSubstr("no descriptors"));
  views = synthetic_views(true);
  views[1].spectrum->sample[0] = 100000;
  EXPECT_THAT(refusal<InputError>(views), HasSubstr("spectrum sample"));
}

TEST(Training, RefusesViewsOfDifferentRecipes) {
  auto views = synthetic_views();
  views[2].cloud.recipe = "spacing=0.02";
  EXPECT_EQ(refusal<MismatchError>(views),
            "view 2: points were made with 'spacing=0.02', view 0 has 'spacing=0.014'");
  views = synthetic_views();
  views[1].descriptors.recipe = "channels=fpfh:0.1";
  EXPECT_THAT(refusal<MismatchError>(views), HasSubstr("'channels=fpfh:0.1'"));
  views = synthetic_views();
  views[1].descriptors.channels[0].name = "other";
  EXPECT_THAT(refusal<MismatchError>(views), HasSubstr("other[8]"));
  views = synthetic_views(true);
  views[1].spectrum->recipe = "eigenpairs=9";
  EXPECT_THAT(refusal<MismatchError>(views), HasSubstr("'eigenpairs=9'"));
  views = synthetic_views(true);
  views[1].spectrum.reset();
  EXPECT_EQ(refusal<MismatchError>(views), "view 1 lacks a spectrum, unlike view 0");
}

TEST(TrainingParams, NameEveryFieldOnceAndRoundTrip) {
  Params a;
  a.encoding.alpha = 0.25;
  a.mixture.components = 7;
  a.draw.packets = 3;
  a.svm.cost = 2.0;
  a.relations.mixture = 5;
  a.projection = 0;
  Params b;
  apply_recipe(describe(b), recipe(describe(a)));
  EXPECT_EQ(recipe(describe(b)), recipe(describe(a)));
  EXPECT_EQ(b.mixture.components, 7);
  EXPECT_EQ(b.relations.mixture, 5);
  for (const char* name : {"encoding.alpha", "mixture.components", "draw.packets", "svm.cost",
                           "relations.samples_per_pair", "neighbour_radius"})
    EXPECT_NE(find(describe(a), name), nullptr) << name;
  std::vector<std::string> names;
  for (const Field& field : describe(a)) names.push_back(field.name);
  std::ranges::sort(names);
  EXPECT_EQ(std::ranges::adjacent_find(names), names.end());
}

}  // namespace
}  // namespace cosegraph::training
