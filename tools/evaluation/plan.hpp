// Configurations, and what they have in common. Internal to evaluation.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/pipeline.hpp"
#include "tools/evaluation/evaluation.hpp"

namespace cosegraph::evaluation {

// What labels a query's segments.
enum class Labeller {
  method,    // the pipeline
  majority,  // the reference's most frequent label, everywhere: the floor
  oracle,    // the most frequent true label in each segment: the ceiling of the segmentation
};

// A configuration with a text for every part of its work: configurations with the same text share
// the result.
struct Entry {
  std::string name;
  Labeller labeller = Labeller::method;
  pipeline::Config config;
  std::string source;
  std::string descriptors;  // empty: none
  std::string spectra;      // empty: none
  std::string segments;
  std::string appearance;  // what is learned; empty: nothing
  std::string relations;   // empty: nothing
  std::string all;         // of everything
};

// "majority", "oracle", "oracle:cpc", or what pipeline::config_from_name knows. Throws
// ParameterError for an unknown or repeated configuration or a bad parameter.
std::vector<Entry> entries_of(const Protocol& protocol);

// "majority", "oracle" or "oracle:cpc": no method, but what methods lie between.
bool is_bound(std::string_view configuration);

// Throws ParameterError for numbers that make no sense.
void check_numbers(const Protocol& protocol);

// A seed for one shape of one category, from their names.
std::uint64_t shape_seed(std::uint64_t seed, std::string_view category, std::string_view shape);

// The seeds of everything random after the choice of views.
void seed_training(std::uint64_t shape_seed, training::Params& params);
void seed_query(std::uint64_t shape_seed, int view, fisher::Params& params);

// Of the choice of views.
std::uint64_t camera_seed(std::uint64_t shape_seed);

}  // namespace cosegraph::evaluation
