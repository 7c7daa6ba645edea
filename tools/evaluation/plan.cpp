#include "tools/evaluation/plan.hpp"

#include <algorithm>
#include <array>
#include <sstream>

#include "core/random.hpp"
#include "tools/evaluation/hash.hpp"

namespace cosegraph::evaluation {
namespace {

// What a shape's seed is used for.
enum Use : std::uint64_t { kCamera = 1, kMixture, kDraw, kRelations, kQuery };

// Set by the protocol itself.
constexpr std::array<std::string_view, 5> kOwn{"fisher.seed", "training.draw.seed",
                                               "training.mixture.seed", "training.relations.seed",
                                               "descriptors.threads"};

Fields fields_of(pipeline::Config& config) {
  Fields all;
  const auto add = [&](std::string_view stage, Fields fields) {
    all = concatenated(std::move(all), prefixed(stage, std::move(fields)));
  };
  add("source", describe(config.extraction));
  add("source", describe(config.source));
  add("supervoxels", describe(config.supervoxels));
  add("cpc", describe(config.cpc));
  add("descriptors", describe(config.descriptors));
  add("spectra", describe(config.spectra));
  add("fisher", describe(config.fisher));
  add("astar", describe(config.astar));
  add("training", describe(config.training));
  std::erase_if(
      all, [](const Field& field) { return std::ranges::find(kOwn, field.name) != kOwn.end(); });
  return all;
}

void set_param(const Fields& fields, const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos)
    throw ParameterError("'" + text + "' is not of the form STAGE.NAME=VALUE");
  const std::string name = text.substr(0, equals);
  const std::string value = text.substr(equals + 1);
  const Field* field = find(fields, name);
  std::vector<std::string> values{value};
  if (field != nullptr && field->type == FieldType::list) {
    values.clear();
    std::istringstream words(value);
    for (std::string word; std::getline(words, word, ',');) values.push_back(word);
  }
  set_field(fields, name, values);
}

constexpr std::string_view kPlainMethod = "fpfh+fv";  // whose segmentation the bounds use

Entry named_entry(const std::string& name) {
  if (name == "majority")
    return {.name = name,
            .labeller = Labeller::majority,
            .config = pipeline::config_from_name(kPlainMethod)};
  if (name == "oracle" || name == "oracle:cpc")
    return {.name = name,
            .labeller = Labeller::oracle,
            .config = pipeline::config_from_name(std::string(kPlainMethod) +
                                                 name.substr(std::string("oracle").size()))};
  try {
    return {.name = name, .config = pipeline::config_from_name(name)};
  } catch (const ParameterError& error) {
    throw ParameterError(error.what() + std::string("; and majority, oracle, oracle:cpc"));
  }
}

Entry entry_of(const std::string& name, const std::vector<std::string>& params) {
  Entry entry = named_entry(name);
  pipeline::Config& config = entry.config;
  config.descriptors.threads = 1;
  const Fields fields = fields_of(config);
  for (const auto& param : params) set_param(fields, param);
  const auto join = [](const std::string& a, const std::string& b) { return a + '\n' + b; };
  entry.source = join(recipe(describe(config.extraction)), recipe(describe(config.source)));
  entry.segments =
      join(entry.source, join(recipe(describe(config.supervoxels)), recipe(describe(config.cpc))));
  entry.all = join(name, recipe(fields));
  if (entry.labeller != Labeller::method) return entry;
  entry.descriptors = join(entry.source, descriptors::recipe_of(config.descriptors));
  if (config.with_spectra) entry.spectra = join(entry.source, recipe(describe(config.spectra)));
  entry.appearance = join(entry.descriptors, recipe(describe(config.training)));
  if (config.with_spectra) entry.relations = join(entry.appearance, entry.spectra);
  return entry;
}

}  // namespace

std::vector<Entry> entries_of(const Protocol& protocol) {
  std::vector<Entry> entries;
  for (const auto& name : protocol.configurations) {
    if (std::ranges::count(protocol.configurations, name) > 1)
      throw ParameterError("configuration '" + name + "' is named twice");
    entries.push_back(entry_of(name, protocol.params));
  }
  if (entries.empty()) throw ParameterError("no configuration to evaluate");
  return entries;
}

bool is_bound(std::string_view configuration) {
  return configuration == "majority" || configuration.starts_with("oracle");
}

void check_numbers(const Protocol& protocol) {
  const auto require = [](const char* name, int value, int min) {
    if (value < min)
      throw ParameterError(std::string(name) + " must be at least " + std::to_string(min) +
                           ", not " + std::to_string(value));
  };
  require("the number of query views", protocol.query_views, 1);
  require("the number of training views", protocol.train_views, 1);
  require("the number of threads", protocol.jobs, 0);
  require("the number of shapes", protocol.shapes, 0);
  if (protocol.shapes == 1)
    throw ParameterError("one shape per category makes no pair: at least 2 are needed");
  if (protocol.seeds.empty()) throw ParameterError("no seed to evaluate with");
  for (const std::uint64_t seed : protocol.seeds)
    if (std::ranges::count(protocol.seeds, seed) > 1)
      throw ParameterError("seed " + std::to_string(seed) + " is named twice");
}

std::uint64_t shape_seed(std::uint64_t seed, std::string_view category, std::string_view shape) {
  return derive_seed(seed, hash(category), hash(shape));
}

std::uint64_t camera_seed(std::uint64_t shape_seed) {
  return derive_seed(shape_seed, kCamera);
}

void seed_training(std::uint64_t shape_seed, training::Params& params) {
  params.mixture.seed = derive_seed(shape_seed, kMixture);
  params.draw.seed = derive_seed(shape_seed, kDraw);
  params.relations.seed = derive_seed(shape_seed, kRelations);
}

void seed_query(std::uint64_t shape_seed, int view, fisher::Params& params) {
  params.seed = derive_seed(shape_seed, kQuery, static_cast<std::uint64_t>(view));
}

}  // namespace cosegraph::evaluation
