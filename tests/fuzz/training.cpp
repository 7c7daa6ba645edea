// From labelled views to a model.
#include "training/training.hpp"

#include "fuzz/target.hpp"
#include "model/model.hpp"

namespace cosegraph::fuzz {
namespace {

training::Params params_of(std::uint8_t choice) {
  training::Params params{.projection = 8, .mixture_samples = 100};
  params.mixture.components = 2;
  params.mixture.iterations = 2;
  params.draw.clusters = 4;
  params.draw.packets = 3;
  params.relations.samples_per_pair = 20;
  if (choice % 2 == 0) params.encoding.method = fisher::Method::bow;
  return params;
}

}  // namespace

std::vector<std::string_view> types_of(std::uint8_t choice) {
  if (choice % 4 < 2) return {"Cloud", "Descriptors", "Spectrum"};
  return {"Cloud", "Descriptors", "Spectrum", "Cloud", "Descriptors", "Spectrum"};
}

void run(const Bundle& bundle) {
  const auto& messages = bundle.messages;
  const std::size_t count = types_of(bundle.choice).size();
  if (messages.size() < count) return;
  try {
    std::vector<training::View> views;
    for (std::size_t i = 0; i < count; i += 3)
      views.push_back({.cloud = idl::decode<Cloud>(messages[i]),
                       .descriptors = idl::decode<Descriptors>(messages[i + 1]),
                       .spectrum = idl::decode<Spectrum>(messages[i + 2])});
    const Model model = training::train(views, params_of(bundle.choice));
    idl::decode<AppearanceModel>(idl::encode({}, model.appearance));
    idl::decode<RelationModel>(idl::encode({}, model.relation));
    model::from_bytes(model::to_bytes(model), "model");
  } catch (const Error&) {
    return;
  }
}

}  // namespace cosegraph::fuzz
