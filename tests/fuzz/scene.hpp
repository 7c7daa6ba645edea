// One small frame with everything that the stages make of it: what corpus and tests spoil.
#pragma once

#include "core/values.hpp"
#include "training/training.hpp"

namespace cosegraph::fuzz {

struct Scene {
  Cloud cloud;  // labelled "body" and "handle"; its own dense cloud
  Supervoxels supervoxels;
  Segments segments;
  Descriptors descriptors;
  Spectrum spectrum;
  Model model;
  Encodings encodings;
  Scores scores;
  Labelling labelling;
};

training::Params small_training();

// Half a ball with a rod to its side, computed anew by the algorithms themselves.
Scene make_scene(const training::Params& params);

}  // namespace cosegraph::fuzz
