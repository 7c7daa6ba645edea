#include "pipeline/pipeline.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "camera/camera.hpp"
#include "sample/shapes.hpp"

namespace cosegraph::pipeline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

std::vector<Cloud> views_of(const Mesh& mesh, int count) {
  camera::Params params;
  params.count = count;
  std::vector<Cloud> views;
  for (const auto& view : camera::choose_views(mesh, params))
    views.push_back(camera::render(mesh, view.direction, view.roll, params));
  return views;
}

double accuracy(const Result& result) {
  const Cloud& dense = result.features.frame.dense;
  std::size_t right = 0;
  for (std::size_t i = 0; i < dense.size(); ++i)
    right += dense.label_names[dense.label[i]] ==
             result.labelling.label_names[result.labelling.point_label[i]];
  return static_cast<double>(right) / static_cast<double>(dense.size());
}

class Trained : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    config_ = new Config(config_from_name("fpfh+fv+iso"));
    model_ = new Model(train(views_of(sample::make(sample::Kind::mug, 1), 4), *config_));
  }
  static void TearDownTestSuite() {
    delete model_;
    delete config_;
  }
  static Model* model_;
  static Config* config_;
};
Model* Trained::model_ = nullptr;
Config* Trained::config_ = nullptr;

TEST_F(Trained, UnseenShapeIsLabelledBetterThanByTheMajority) {
  for (const auto& view : views_of(sample::make(sample::Kind::mug, 2), 2)) {
    const Result result = segment(view, *model_, *config_);
    const auto share = *std::ranges::max_element(model_->appearance.label_share);
    EXPECT_GT(accuracy(result), 0.9) << "floor about " << share;
    EXPECT_TRUE(result.labelling.proven_optimal);
  }
}

TEST_F(Trained, SameInputGivesSameLabels) {
  const Cloud view = views_of(sample::make(sample::Kind::mug, 3), 1)[0];
  const Result first = segment(view, *model_, *config_);
  Config one_thread = *config_;
  one_thread.descriptors.threads = 1;
  const Result second = segment(view, *model_, one_thread);
  EXPECT_EQ(first.labelling.point_label, second.labelling.point_label);
  EXPECT_EQ(first.labelling.point_confidence, second.labelling.point_confidence);
  EXPECT_EQ(first.scores.probability, second.scores.probability);
}

TEST_F(Trained, TrueLabelsOfTheQueryHaveNoInfluence) {
  Cloud view = views_of(sample::make(sample::Kind::mug, 4), 1)[0];
  const Result with = segment(view, *model_, *config_);
  view.label.clear();
  view.label_names.clear();
  const Result without = segment(view, *model_, *config_);
  EXPECT_EQ(with.labelling.point_label, without.labelling.point_label);
}

TEST_F(Trained, SizeOfTheQueryHasNoInfluence) {
  const Cloud view = views_of(sample::make(sample::Kind::mug, 4), 1)[0];
  Cloud large = view;
  for (float& x : large.xyz) x *= 8.0F;  // a power of two: no rounding
  EXPECT_EQ(segment(view, *model_, *config_).labelling.point_label,
            segment(large, *model_, *config_).labelling.point_label);
}

TEST_F(Trained, QueryMadeWithOtherParametersIsRefused) {
  Config other = *config_;
  other.descriptors.channels = {"fpfh:0.1"};
  EXPECT_THROW(segment(views_of(sample::make(sample::Kind::mug, 2), 1)[0], *model_, other),
               MismatchError);
}

TEST_F(Trained, ParametersCanBeTakenFromTheModel) {
  Config fresh;
  fresh.astar.spatial = astar::Spatial::iso;
  fresh.source.spacing = 0.02;
  adopt_model(*model_, fresh);
  EXPECT_EQ(fresh.source.spacing, config_->source.spacing);
  const Cloud view = views_of(sample::make(sample::Kind::mug, 2), 1)[0];
  EXPECT_EQ(segment(view, *model_, fresh).labelling.point_label,
            segment(view, *model_, *config_).labelling.point_label);
}

TEST(ConfigFromName, PaperRows) {
  for (const char* name : {"shot+bow", "fpfh+bow", "shot+bow+iso", "shot+bow+iso*", "fpfh+fv",
                           "fpfh+fv:cpc", "fpfh+fv:l2", "shot+fv", "fpfh+fv+iso", "best"})
    EXPECT_NO_THROW(config_from_name(name)) << name;
  EXPECT_EQ(config_from_name("fpfh+fv:cpc").cpc.merge, cpc::Merge::size);
  EXPECT_EQ(config_from_name("fpfh+fv").cpc.merge, cpc::Merge::concavity);
  EXPECT_TRUE(config_from_name("fpfh+fv:l2").training.encoding.l2);
  EXPECT_EQ(config_from_name("shot+bow").training.encoding.method, fisher::Method::bow);
  EXPECT_EQ(config_from_name("shot+bow+iso*").astar.spatial, astar::Spatial::iso_free);
  EXPECT_FALSE(config_from_name("fpfh+fv").with_spectra);
  EXPECT_TRUE(config_from_name("fpfh+fv+iso").with_spectra);
  EXPECT_THAT(config_from_name("best").descriptors.channels, SizeIs(3));
}

TEST(ConfigFromName, RefusalsSayWhatIsPossible) {
  const auto message = [](const char* name) -> std::string {
    try {
      config_from_name(name);
    } catch (const ParameterError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(message("fphf+fv"), HasSubstr("did you mean 'fpfh'"));
  EXPECT_THAT(message("fpfh+fw"), HasSubstr("did you mean 'fv'"));
  EXPECT_THAT(message("fpfh"), HasSubstr("wrong number of parts"));
  EXPECT_THAT(message("fpfh+fv+iso+iso"), HasSubstr("wrong number of parts"));
  EXPECT_THAT(message("fpfh+fv+is"), HasSubstr("did you mean 'iso'"));
  EXPECT_THAT(message("fpfh+fv:cpx"), HasSubstr("did you mean 'cpc'"));
  EXPECT_THAT(message(""), HasSubstr("configurations are"));
}

}  // namespace
}  // namespace cosegraph::pipeline
