#include "astar/astar.hpp"

#include <optional>

#include "graph/stage.hpp"

namespace cosegraph::stages {
namespace {

class AstarStage final : public graph::Stage {
 public:
  std::string summary() const override { return "the labelling of minimal energy (A*)"; }
  Fields parameters() override { return describe(params_); }

  void start() override {
    if (params_.spatial == astar::Spatial::none) return;
    if (!spectrum_.connected() || !relations_.connected())
      throw ParameterError("spatial: " + std::string(to_name(params_.spatial)) +
                           " needs the inputs 'spectrum' and 'relations'");
  }

  void process(graph::Frame& frame) override {
    std::optional<Spectrum> spectrum;
    if (spectrum_.connected()) spectrum = spectrum_.get(frame);
    std::shared_ptr<const RelationModel> relations;
    if (relations_.connected()) relations = relations_.get(frame);
    out_.put(frame, astar::infer(scores_.get(frame), segments_.get(frame),
                                 spectrum ? &*spectrum : nullptr, relations.get(), params_));
  }

 private:
  graph::Input<Scores> scores_{*this, "scores", "the unary terms"};
  graph::Input<Segments> segments_{*this, "segments", "what is labelled"};
  graph::Input<Spectrum> spectrum_{*this, "spectrum", "for the pairwise terms",
                                   graph::Need::optional};
  graph::LatchedInput<RelationModel> relations_{*this, "relations", "the reference's part pairs",
                                                graph::Need::optional};
  graph::Output<Labelling> out_{*this, "labelling", "labels per segment and dense point"};
  astar::Params params_;
};

}  // namespace

std::unique_ptr<graph::Stage> make_astar_stage() {
  return std::make_unique<AstarStage>();
}

}  // namespace cosegraph::stages
