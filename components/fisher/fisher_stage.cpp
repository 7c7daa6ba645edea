#include "fisher/fisher.hpp"

#include "graph/stage.hpp"

namespace cosegraph::stages {
namespace {

class FisherStage final : public graph::Stage {
 public:
  std::string summary() const override { return "packet vectors per segment (Fisher, BoW)"; }
  Fields parameters() override { return describe(params_); }
  void process(graph::Frame& frame) override {
    out_.put(frame, fisher::encode_segments(cloud_.get(frame), descriptors_.get(frame),
                                            segments_.get(frame), *model_.get(frame), params_));
  }

 private:
  graph::Input<Cloud> cloud_{*this, "cloud", "the cloud the descriptors are of"};
  graph::Input<Descriptors> descriptors_{*this, "descriptors", "made as the model's were"};
  graph::Input<Segments> segments_{*this, "segments", "what is encoded"};
  graph::LatchedInput<AppearanceModel> model_{*this, "model", "mixtures and encoding"};
  graph::Output<Encodings> out_{*this, "encodings", "packet vectors per segment"};
  fisher::Params params_;
};

}  // namespace

std::unique_ptr<graph::Stage> make_fisher_stage() {
  return std::make_unique<FisherStage>();
}

}  // namespace cosegraph::stages
