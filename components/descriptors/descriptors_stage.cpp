#include "descriptors/descriptors.hpp"

#include "graph/stage.hpp"

namespace cosegraph::stages {
namespace {

class DescriptorsStage final : public graph::Stage {
 public:
  std::string summary() const override { return "local shape descriptors (FPFH, SHOT, place)"; }
  Fields parameters() override { return describe(params_); }
  std::string recipe() override { return descriptors::recipe_of(params_); }
  void process(graph::Frame& frame) override {
    out_.put(frame, descriptors::compute(cloud_.get(frame), params_));
  }

 private:
  graph::Input<Cloud> cloud_{*this, "cloud", "the source's cloud with normals"};
  graph::Output<Descriptors> out_{*this, "descriptors", "one block of descriptors per channel"};
  descriptors::Params params_;
};

}  // namespace

std::unique_ptr<graph::Stage> make_descriptors_stage() {
  return std::make_unique<DescriptorsStage>();
}

}  // namespace cosegraph::stages
