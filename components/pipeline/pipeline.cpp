#include "pipeline/pipeline.hpp"

#include <algorithm>
#include <chrono>

#include "svm/svm.hpp"

namespace cosegraph::pipeline {
namespace {

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> words;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    words.emplace_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return words;
}

[[noreturn]] void refuse(std::string_view name, const std::string& why) {
  throw ParameterError("configuration '" + std::string(name) + "': " + why +
                       "; configurations are best, or {fpfh,shot,fused}+{fv,bow}[+iso|+iso*]"
                       "[:cpc][:l2][:literal], as fpfh+fv+iso");
}

// Adds the wall time of a step to `times` when it goes out of scope.
class Timer {
 public:
  Timer(Times* times, const char* stage)
      : times_(times), stage_(stage), start_(std::chrono::steady_clock::now()) {}
  ~Timer() {
    if (times_ == nullptr) return;
    const std::chrono::duration<double, std::milli> spent =
        std::chrono::steady_clock::now() - start_;
    (*times_)[stage_] += spent.count();
  }
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

 private:
  Times* times_;
  const char* stage_;
  std::chrono::steady_clock::time_point start_;
};

void set_descriptors(std::string_view name, const std::string& word, Config& config) {
  if (word == "fpfh")
    config.descriptors.channels = {"fpfh:0.08"};
  else if (word == "shot")
    config.descriptors.channels = {"shot:0.13"};
  else if (word == "fused")
    config.descriptors.channels = {"shot:0.13", "shot:0.24", "fpfh+place:0.08"};
  else
    refuse(name, "'" + word + "' is no descriptor" + did_you_mean(word, {"fpfh", "shot", "fused"}));
}

void set_encoding(std::string_view name, const std::string& word, Config& config) {
  try {
    config.training.encoding.method = from_name<fisher::Method>(word);
  } catch (const ParameterError&) {
    refuse(name, "'" + word + "' is no encoding" + did_you_mean(word, {"fv", "bow"}));
  }
}

void set_spatial(std::string_view name, const std::string& word, Config& config) {
  if (word != "iso" && word != "iso*")
    refuse(name, "'" + word + "' is no spatial term" + did_you_mean(word, {"iso", "iso*"}));
  config.astar.spatial = from_name<astar::Spatial>(word);
  config.with_spectra = true;
}

void set_option(std::string_view name, const std::string& word, Config& config) {
  if (word == "cpc") {
    config.cpc.merge = cpc::Merge::size;
  } else if (word == "l2") {
    config.training.encoding.l2 = true;
  } else if (word == "literal") {
    config.training.encoding.bow = fisher::BowForm::literal;
    config.astar.likelihood = astar::Likelihood::literal;
    config.astar.pairwise_scale = astar::PairwiseScale::none;
  } else {
    refuse(name, "'" + word + "' is no option" + did_you_mean(word, {"cpc", "l2", "literal"}));
  }
}

}  // namespace

Config config_from_name(std::string_view name) {
  Config config;
  const std::vector<std::string> options = split(name, ':');
  const std::string stem = options[0] == "best" ? std::string(kBest) : options[0];
  const std::vector<std::string> words = split(stem, '+');
  if (words.size() < 2 || words.size() > 3) refuse(name, "it has the wrong number of parts");
  set_descriptors(name, words[0], config);
  set_encoding(name, words[1], config);
  if (words.size() == 3) set_spatial(name, words[2], config);
  for (std::size_t i = 1; i < options.size(); ++i) set_option(name, options[i], config);
  return config;
}

void adopt_model(const Model& model, Config& config) {
  apply_recipe(describe(config.source), model.appearance.cloud_recipe);
  descriptors::adopt_recipe(model.appearance.descriptor_recipe, config.descriptors);
  config.with_spectra = !model.relation.spectrum_recipe.empty();
  if (config.with_spectra)
    apply_recipe(spectra::describe(config.spectra), model.relation.spectrum_recipe);
  else
    config.astar.spatial = astar::Spatial::none;
}

Features extract(Cloud input, const Config& config, Times* times) {
  Features features;
  {
    const Timer timer(times, "source");
    features.frame = source::prepare(std::move(input), config.extraction, config.source);
  }
  {
    const Timer timer(times, "descriptors");
    features.descriptors = descriptors::compute(features.frame.cloud, config.descriptors);
  }
  if (config.with_spectra) {
    const Timer timer(times, "spectra");
    features.spectrum = spectra::compute(features.frame.cloud, config.spectra);
  }
  return features;
}

Model train(std::span<const Cloud> labelled_views, const Config& config,
            const training::Progress& progress) {
  std::vector<training::View> views;
  for (const auto& view : labelled_views) {
    if (progress)
      progress("features",
               static_cast<double>(views.size()) / static_cast<double>(labelled_views.size()));
    Features features = extract(view, config);
    views.push_back({.cloud = std::move(features.frame.cloud),
                     .descriptors = std::move(features.descriptors),
                     .spectrum = std::move(features.spectrum)});
  }
  return training::train(views, config.training, progress);
}

Segments presegment(const Features& features, const Config& config, Supervoxels& supervoxels,
                    Times* times) {
  {
    const Timer timer(times, "supervoxels");
    supervoxels = supervoxels::compute(features.frame.dense, config.supervoxels);
  }
  const Timer timer(times, "cpc");
  return cpc::compute(supervoxels, config.cpc);
}

Labelling label(const Features& features, const Segments& segments, const Model& model,
                const Config& config, Scores& scores, Times* times) {
  Encodings encodings;
  {
    const Timer timer(times, "fisher");
    encodings = fisher::encode_segments(features.frame.cloud, features.descriptors, segments,
                                        model.appearance, config.fisher);
  }
  {
    const Timer timer(times, "svm");
    scores = svm::score(encodings, model.appearance);
  }
  const Timer timer(times, "astar");
  return astar::infer(scores, segments, features.spectrum ? &*features.spectrum : nullptr,
                      &model.relation, config.astar);
}

Result segment(Cloud input, const Model& model, const Config& config, Times* times) {
  Result result{.features = extract(std::move(input), config, times)};
  result.segments = presegment(result.features, config, result.supervoxels, times);
  result.labelling = label(result.features, result.segments, model, config, result.scores, times);
  return result;
}

}  // namespace cosegraph::pipeline
