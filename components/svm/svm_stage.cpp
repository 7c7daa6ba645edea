#include "svm/svm.hpp"

#include "graph/stage.hpp"

namespace cosegraph::stages {
namespace {

class SvmStage final : public graph::Stage {
 public:
  std::string summary() const override { return "label probabilities per segment (SVM)"; }
  void process(graph::Frame& frame) override {
    out_.put(frame, svm::score(encodings_.get(frame), *model_.get(frame)));
  }

 private:
  graph::Input<Encodings> encodings_{*this, "encodings", "packet vectors per segment"};
  graph::LatchedInput<AppearanceModel> model_{*this, "model", "the classifier"};
  graph::Output<Scores> out_{*this, "scores", "p(l | T_i) of every segment"};
};

}  // namespace

std::unique_ptr<graph::Stage> make_svm_stage() {
  return std::make_unique<SvmStage>();
}

}  // namespace cosegraph::stages
