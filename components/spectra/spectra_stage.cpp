#include "spectra/spectra.hpp"

#include "graph/stage.hpp"

namespace cosegraph::stages {
namespace {

class SpectraStage final : public graph::Stage {
 public:
  std::string summary() const override { return "Laplace-Beltrami eigenpairs of the cloud"; }
  Fields parameters() override { return describe(params_); }
  std::string recipe() override { return cosegraph::recipe(describe(params_)); }
  void process(graph::Frame& frame) override {
    out_.put(frame, spectra::compute(cloud_.get(frame), params_));
  }

 private:
  graph::Input<Cloud> cloud_{*this, "cloud", "the source's cloud with normals"};
  graph::Output<Spectrum> out_{*this, "spectrum", "eigenvalues and sampled eigenfunctions"};
  spectra::Params params_;
};

}  // namespace

std::unique_ptr<graph::Stage> make_spectra_stage() {
  return std::make_unique<SpectraStage>();
}

}  // namespace cosegraph::stages
