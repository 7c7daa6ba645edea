#include "training/training.hpp"

#include <vector>

#include "graph/stage.hpp"
#include "io/file.hpp"
#include "model/model.hpp"

namespace cosegraph::stages {
namespace {

class TrainingStage final : public graph::Stage {
 public:
  std::string summary() const override { return "learns a model from labelled views"; }
  Fields parameters() override {
    return concatenated({text_field("file", file_, "where the model is written; empty: nowhere")},
                        describe(params_));
  }

  void process(graph::Frame& frame) override {
    if (resumed() && views_.empty() && frame.header().sequence > 0)
      throw Error(
          "training was started again in the middle of the stream, and lacks the frames "
          "before this one: start the graph anew");
    training::View view{.cloud = cloud_.get(frame), .descriptors = descriptors_.get(frame)};
    if (spectrum_.connected()) view.spectrum = spectrum_.get(frame);
    // One that is refused now fails its frame, and not the others with it.
    training::check_view(view, views_.size(), views_.empty() ? view : views_.front());
    views_.push_back(std::move(view));
  }

  void end() override {
    if (resumed() && views_.empty())
      throw Error("training was started again and lacks its views: start the graph anew");
    const Model model = training::train(
        views_, params_, [this](std::string_view step, double done) { report(step, done); });
    if (!file_.empty()) io::write_file(file_, model::to_bytes(model));
    appearance_.put(model.appearance);
    relations_.put(model.relation);
  }

  idl::Outcome leaf_outcome() const override { return idl::Outcome::consumed; }

 private:
  graph::Input<Cloud> cloud_{*this, "cloud", "labelled view of the reference"};
  graph::Input<Descriptors> descriptors_{*this, "descriptors", "of that view"};
  graph::Input<Spectrum> spectrum_{*this, "spectrum", "of that view; for spatial relations",
                                   graph::Need::optional};
  graph::LatchedOutput<AppearanceModel> appearance_{*this, "appearance",
                                                    "mixtures, encoding and classifier"};
  graph::LatchedOutput<RelationModel> relations_{*this, "relations",
                                                 "part pairs and neighbourhoods"};
  training::Params params_;
  std::string file_;
  std::vector<training::View> views_;
};

}  // namespace

std::unique_ptr<graph::Stage> make_training_stage() {
  return std::make_unique<TrainingStage>();
}

}  // namespace cosegraph::stages
