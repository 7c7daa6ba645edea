#include "supervoxels/supervoxels.hpp"

#include "graph/stage.hpp"

namespace cosegraph::stages {
namespace {

class SupervoxelsStage final : public graph::Stage {
 public:
  std::string summary() const override { return "supervoxels of the dense cloud (VCCS)"; }
  Fields parameters() override { return describe(params_); }
  void process(graph::Frame& frame) override {
    out_.put(frame, supervoxels::compute(dense_.get(frame), params_));
  }

 private:
  graph::Input<Cloud> dense_{*this, "cloud", "the source's dense cloud"};
  graph::Output<Supervoxels> out_{*this, "supervoxels", "supervoxels and their adjacency"};
  supervoxels::Params params_;
};

}  // namespace

std::unique_ptr<graph::Stage> make_supervoxels_stage() {
  return std::make_unique<SupervoxelsStage>();
}

}  // namespace cosegraph::stages
