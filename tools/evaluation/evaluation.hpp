// The evaluation protocol of the paper (Araslanov et al., GCPR 2016, section 4.1) on a benchmark
// folder, by direct calls of the algorithms.
//
// Within a category every shape is the one labelled reference for the views of all others: one
// model per reference from up to `train_views` valid views of maximum spread, and the first
// `query_views` of them as queries. A pair is compatible if the query view shows no label that the
// reference's views lack; only those are evaluated, and none of a shape with its own views. A
// query is seen as a sensor would: its scale, too, comes from the visible points.
//
// The figures do not depend on the number of threads nor on what else is evaluated in the same
// run: all random numbers derive from (seed, category, shape, view).
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

namespace cosegraph::evaluation {

struct Protocol {
  std::filesystem::path data;                          // see benchmark.hpp
  std::vector<std::string> configurations{"fpfh+fv"};  // see pipeline::config_from_name
  std::vector<std::string> params;                     // "STAGE.NAME=VALUE", for all of them
  std::vector<std::string> categories;                 // none: all
  int shapes = 0;                                      // per category, the first ones; 0: all
  int query_views = 2;                                 // per shape
  int train_views = 8;                                 // per reference
  std::uint64_t seed = 1;
  int jobs = 0;           // threads; 0: as many as there are cores
  camera::Params camera;  // count and seed are set by the protocol
};

// What a pair's milliseconds are given for, in order. All are the wall time of the one thread that
// did the work, in full: those of the view, which all of its pairs share, and the training of the
// reference, too.
constexpr std::array<std::string_view, 9> kStages{
    "source", "descriptors", "spectra", "supervoxels", "cpc", "fisher", "svm", "astar", "training"};

struct Pair {
  int configuration = 0;  // index into Report::configurations
  int category = 0;       // index into Report::categories
  std::string reference;  // shapes
  std::string query;
  int view = 0;
  double accuracy = 0.0;  // of the view's points with a true label, as in sink::Evaluation
  double majority_floor = 0.0;
  double oracle = 0.0;
  std::int32_t segments = 0;
  std::int64_t expansions = 0;
  bool proven_optimal = false;
  std::array<double, kStages.size()> ms{};
};

struct CategoryCounts {
  std::string name;
  std::int64_t compatible = 0;    // pairs of a reference and another shape's view
  std::int64_t incompatible = 0;  // left out
};

struct Report {
  Protocol protocol;
  std::vector<std::string> configurations;
  std::vector<CategoryCounts> categories;  // that are finished
  std::vector<Pair> pairs;                 // by category, configuration, query, view, reference
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
Report evaluate(const Protocol& protocol, const Progress& progress = {});

}  // namespace cosegraph::evaluation
