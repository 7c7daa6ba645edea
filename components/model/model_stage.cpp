#include "model/model.hpp"

#include "graph/stage.hpp"
#include "io/file.hpp"

namespace cosegraph::stages {
namespace {

class ModelStage final : public graph::Stage {
 public:
  std::string summary() const override { return "publishes a model file"; }
  Fields parameters() override {
    return {text_field("file", file_, "model file, as training writes it")};
  }

  void start() override {
    if (file_.empty()) throw ParameterError("file: no model file is given");
    const Model model = model::from_bytes(io::read_file(file_), file_);
    appearance_.put(model.appearance);
    relations_.put(model.relation);
    recipe_ = model.appearance.cloud_recipe + "; " + model.appearance.descriptor_recipe + "; " +
              model.relation.spectrum_recipe;
  }
  // Of what its frames must be made like.
  std::string recipe() override { return recipe_; }

  void process(graph::Frame&) override {}

 private:
  graph::LatchedOutput<AppearanceModel> appearance_{*this, "appearance",
                                                    "mixtures, encoding and classifier"};
  graph::LatchedOutput<RelationModel> relations_{*this, "relations",
                                                 "part pairs and neighbourhoods"};
  std::string file_;
  std::string recipe_;
};

}  // namespace

std::unique_ptr<graph::Stage> make_model_stage() {
  return std::make_unique<ModelStage>();
}

}  // namespace cosegraph::stages
