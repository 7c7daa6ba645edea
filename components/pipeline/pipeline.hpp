// The whole method as plain function calls, without DDS: what the graph computes, for libraries,
// evaluation loops and benchmarks. The graph gives the same labels bit for bit.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "astar/astar.hpp"
#include "cpc/cpc.hpp"
#include "descriptors/descriptors.hpp"
#include "fisher/fisher.hpp"
#include "source/source.hpp"
#include "spectra/spectra.hpp"
#include "supervoxels/supervoxels.hpp"
#include "training/training.hpp"

namespace cosegraph::pipeline {

struct Config {
  source::Extraction extraction;
  source::Params source;
  supervoxels::Params supervoxels;
  cpc::Params cpc;
  descriptors::Params descriptors;
  fisher::Params fisher;
  spectra::Params spectra;
  astar::Params astar;
  training::Params training;
  bool with_spectra = false;  // compute spectra at all (training and query)
};

constexpr std::string_view kBest = "fused+fv+iso";  // the configuration that is called "best"

// A configuration by name, in the paper's manner: DESCRIPTORS+ENCODING[+iso|+iso*][:OPTION]...
//   DESCRIPTORS  fpfh | shot | fused
//   ENCODING     fv | bow
//   OPTION       cpc (original merging) | l2 | literal (eq. 3 and 8 as printed)
// or "best". Throws ParameterError that lists what is possible.
Config config_from_name(std::string_view name);

// Sets the parameters of source, descriptors and spectra to what the model was trained with.
// Without part relations in the model the spatial term is switched off.
void adopt_model(const Model& model, Config& config);

struct Features {
  source::Frame frame;
  Descriptors descriptors;
  std::optional<Spectrum> spectrum;
};

// Wall milliseconds per stage name.
using Times = std::map<std::string, double>;

Features extract(Cloud input, const Config& config, Times* times = nullptr);

Model train(std::span<const Cloud> labelled_views, const Config& config,
            const training::Progress& progress = {});

// The two halves of segment(), for loops that label the same view with many models.
Segments presegment(const Features& features, const Config& config, Supervoxels& supervoxels,
                    Times* times = nullptr);
Labelling label(const Features& features, const Segments& segments, const Model& model,
                const Config& config, Scores& scores, Times* times = nullptr);

struct Result {
  Features features;
  Supervoxels supervoxels;
  Segments segments;
  Scores scores;
  Labelling labelling;
};

Result segment(Cloud input, const Model& model, const Config& config, Times* times = nullptr);

}  // namespace cosegraph::pipeline
