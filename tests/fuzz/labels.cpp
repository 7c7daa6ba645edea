// From scores to what a user gets: labelling, figures, pictures, files.
#include "astar/astar.hpp"
#include "fuzz/target.hpp"
#include "sink/results.hpp"
#include "sink/sink.hpp"

namespace cosegraph::fuzz {
namespace {

astar::Params params_of(std::uint8_t choice) {
  astar::Params params{.max_distances = 20, .max_open = 1000};
  constexpr astar::Spatial kSpatial[] = {astar::Spatial::none, astar::Spatial::iso,
                                         astar::Spatial::iso_free};
  params.spatial = kSpatial[choice % 3];
  if (choice % 2 == 0) params.likelihood = astar::Likelihood::literal;
  return params;
}

void infer(const Bundle& bundle) {
  const auto spectrum = idl::decode<Spectrum>(bundle.messages[2]);
  const auto relations = idl::decode<RelationModel>(bundle.messages[3]);
  const Labelling labelling = astar::infer(idl::decode<Scores>(bundle.messages[0]),
                                           idl::decode<Segments>(bundle.messages[1]), &spectrum,
                                           &relations, params_of(bundle.choice / 3));
  idl::decode<Labelling>(idl::encode({}, labelling));
}

void write(const Bundle& bundle, bool picture) {
  const auto input = idl::decode<Cloud>(bundle.messages[0]);
  const auto segments = idl::decode<Segments>(bundle.messages[1]);
  const auto labelling = idl::decode<Labelling>(bundle.messages[2]);
  const auto name = idl::decode_header(bundle.messages[0]).name;
  try {
    sink::to_input(input, labelling);
    sink::ResultsText().add(sink::result_of(name, input, segments, labelling));
  } catch (const Error&) {
    // The picture is drawn all the same: it must not rest on what the others refuse.
  }
  if (picture)
    sink::picture_of(
        {.name = name, .input = &input, .segments = &segments, .labelling = &labelling});
}

}  // namespace

std::vector<std::string_view> types_of(std::uint8_t choice) {
  if (choice % 3 == 0) return {"Scores", "Segments", "Spectrum", "RelationModel"};
  return {"Cloud", "Segments", "Labelling"};
}

void run(const Bundle& bundle) {
  if (bundle.messages.size() < types_of(bundle.choice).size()) return;
  try {
    if (bundle.choice % 3 == 0)
      infer(bundle);
    else
      write(bundle, bundle.choice % 3 == 1);
  } catch (const Error&) {
    return;
  }
}

}  // namespace cosegraph::fuzz
