// Learns both halves of a model from labelled views of one reference shape.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string_view>

#include "astar/relations.hpp"
#include "core/fields.hpp"
#include "core/values.hpp"
#include "fisher/fisher.hpp"
#include "svm/svm.hpp"

namespace cosegraph::training {

struct Params {
  fisher::Encoding encoding;
  fisher::MixtureParams mixture;
  fisher::Draw draw;
  svm::TrainParams svm;
  astar::RelationParams relations;
  int projection = 64;             // channels of more dimensions are reduced to this many; 0: never
  int mixture_samples = 20000;     // descriptors per channel for projection and mixture, at most
  double neighbour_radius = 0.03;  // observed neighbourhoods
  int neighbour_pairs = 5;
};

// All fields, those of the parts prefixed: "encoding.alpha", "mixture.components", ...
Fields describe(Params& params);

struct View {
  Cloud cloud;  // labelled
  Descriptors descriptors;
  std::optional<Spectrum> spectrum;
};

// Throws what train() would throw because of that view alone, the one of that index among views
// that begin with `first`.
void check_view(const View& view, std::size_t index, const View& first);

// Called with a step's name and the fraction done.
using Progress = std::function<void(std::string_view step, double done)>;

// Views may name their labels in different orders; the model's names are sorted. Throws InputError
// for no view, a view without labels, a reference with a single part, a part that no view shows;
// MismatchError if the views' recipes differ. The id is a hash of everything else in the model.
Model train(std::span<const View> views, const Params& params, const Progress& progress = {});

// The two halves of train(), which do not depend on each other; without ids. The first one does not
// look at spectra.
AppearanceModel learn_appearance(std::span<const View> views, const Params& params,
                                 const Progress& progress = {});
RelationModel learn_relations(std::span<const View> views, const Params& params);

}  // namespace cosegraph::training
