// The evaluation protocol of the paper (Araslanov et al., GCPR 2016, section 4.1) on a benchmark
// folder, by direct calls of the algorithms.
//
// Within a category every shape is the one labelled reference for the views of all others: one
// model per reference from up to `train_views` valid views of maximum spread, and the first
// `query_views` of them as queries. A pair is compatible if the query view shows no label that the
// reference's views lack; only those are evaluated, and none of a shape with its own views. A
// query is seen as a sensor would: its scale, too, comes from the visible points.
//
// The figures do not depend on the number of threads, on what else is evaluated in the same run,
// nor on a stop and a second start: all random numbers derive from (seed, category, shape, view).
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "camera/camera.hpp"
#include "tools/evaluation/benchmark.hpp"
#include "tools/evaluation/figures.hpp"

namespace cosegraph::evaluation {

struct Protocol {
  std::filesystem::path data;                          // see benchmark.hpp
  std::vector<std::string> configurations{"fpfh+fv"};  // see plan.hpp
  std::vector<std::string> params;                     // "STAGE.NAME=VALUE", for all of them
  std::vector<std::string> categories;                 // none: all
  int shapes = 0;                                      // per category, the first ones; 0: all
  int query_views = 8;                                 // per shape
  int train_views = 8;                                 // per reference
  bool flawed = false;                                 // shapes too that flaws_of() objects to
  std::vector<std::uint64_t> seeds{1};                 // the whole is done once for each
  int jobs = 0;                                        // threads; 0: as many as there are cores
  camera::Params camera;                               // count and seed are set by the protocol
};

// Where finished work is kept; an empty folder: nowhere. See Store.
struct Keep {
  std::filesystem::path results;  // finished pairs: small
  std::filesystem::path views;    // what depends on a view alone: some MB per view
  bool views_after = false;       // keep views when their category is finished
};

// What a pair's milliseconds are given for, in order. All are the wall time of the one thread that
// did the work, in full: those of the query view and of the reference, too, which several pairs
// share. `reference` is everything that was done with the reference's views before training.
constexpr std::array<std::string_view, 10> kStages{
    "source", "descriptors", "spectra", "supervoxels", "cpc",
    "fisher", "svm",         "astar",   "training",    "reference"};

struct Pair {
  int configuration = 0;  // index into Report::configurations
  int category = 0;       // index into Report::categories
  std::uint64_t seed = 0;
  std::string reference;  // shapes
  std::string query;
  int view = 0;
  Figures figures;
  double majority_floor = 0.0;  // accuracy with the reference's most frequent label everywhere
  double oracle = 0.0;          // accuracy with the best label for each segment
  std::int64_t expansions = 0;
  bool proven_optimal = false;
  std::vector<std::int16_t> segment_label;  // indices into CategoryCounts::label_names
  std::array<double, kStages.size()> ms{};
};

struct CategoryCounts {
  std::string name;
  std::vector<std::string> label_names;  // of all its shapes, sorted
  std::int64_t compatible = 0;           // pairs of a reference and another shape's view
  std::int64_t incompatible = 0;         // left out
};

// Of one configuration in one category: the points' share per (true, given) label, summed over the
// pairs, each of which adds 1 in all.
struct Confusion {
  int configuration = 0;
  int category = 0;
  std::vector<double> fraction;  // label_names.size() squared, row by row: true label
};

struct Report {
  Protocol protocol;
  std::vector<std::string> configurations;
  std::vector<CategoryCounts> categories;  // that are finished
  std::vector<Pair> pairs;            // by category, seed, configuration, query, view, reference
  std::vector<Confusion> confusions;  // by category, configuration
  std::vector<Problem> problems;
  bool interrupted = false;  // an unfinished category is left out
};

struct Status {
  std::string category;
  std::size_t categories_done = 0;
  std::size_t categories = 0;
  std::string step;   // "models, fpfh+fv"
  double done = 0.0;  // fraction of the whole run
  double seconds_left = 0.0;
};

// Any of these may be empty. Exceptions end the run.
struct Progress {
  std::function<bool()> stopped;            // asked often, by any thread
  std::function<void(const Status&)> step;  // one call at a time, by any thread
  std::function<void(const Report&, const Status&)> category_done;
};

// Throws ParameterError for a protocol that cannot be carried out, InputError for a data folder
// without categories.
void check(const Protocol& protocol);

// Throws what check() throws, before any work is done, and InputError if nothing could be
// evaluated. Whatever else is wrong with single shapes, views or pairs is in Report::problems.
Report evaluate(const Protocol& protocol, const Progress& progress = {}, const Keep& keep = {});

}  // namespace cosegraph::evaluation
