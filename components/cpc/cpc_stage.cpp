#include "cpc/cpc.hpp"

#include "graph/stage.hpp"

namespace cosegraph::stages {
namespace {

class CpcStage final : public graph::Stage {
 public:
  std::string summary() const override { return "segments by constrained planar cuts (CPC)"; }
  Fields parameters() override { return describe(params_); }
  void process(graph::Frame& frame) override {
    out_.put(frame, cpc::compute(supervoxels_.get(frame), params_));
  }

 private:
  graph::Input<Supervoxels> supervoxels_{*this, "supervoxels", "what is partitioned"};
  graph::Output<Segments> out_{*this, "segments", "part candidates with concavity scores"};
  cpc::Params params_;
};

}  // namespace

std::unique_ptr<graph::Stage> make_cpc_stage() {
  return std::make_unique<CpcStage>();
}

}  // namespace cosegraph::stages
