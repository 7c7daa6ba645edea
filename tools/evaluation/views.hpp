// What depends on one view of one shape alone, made once for all configurations. Internal to
// evaluation.
#pragma once

#include <chrono>
#include <exception>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>

#include "core/values.hpp"
#include "pipeline/pipeline.hpp"
#include "tools/evaluation/plan.hpp"
#include "tools/evaluation/store.hpp"

namespace cosegraph::evaluation {

// A result with the time that it took, or why there is none.
template <class T>
struct Made {
  std::optional<T> value;
  std::string failure;
  pipeline::Times ms;
};

// The value of `work(ms)`; what it throws becomes the failure.
template <class Work>
auto make(Work&& work) {
  using Value = decltype(work(std::declval<pipeline::Times&>()));
  Made<Value> made;
  try {
    made.value = work(made.ms);
  } catch (const std::exception& error) {
    made.failure = error.what();
  }
  return made;
}

// `work()`, its wall time added to ms[stage].
template <class Work>
auto timed(pipeline::Times& ms, const std::string& stage, Work&& work) {
  const auto start = std::chrono::steady_clock::now();
  auto value = work();
  const std::chrono::duration<double, std::milli> spent = std::chrono::steady_clock::now() - start;
  ms[stage] += spent.count();
  return value;
}

// The parts, by the text that Entry has for each.
struct ViewParts {
  std::set<std::string> labels;                       // names that the view shows
  std::map<std::string, Made<source::Frame>> frames;  // `dense` emptied, `input` too if no query
  std::map<std::string, Made<Descriptors>> descriptors;
  std::map<std::string, Made<Spectrum>> spectra;
  std::map<std::string, Made<Segments>> segments;  // queries only
};

// `input` gives the labelled cloud that the camera sees; it is asked only if a part that `entries`
// need is not in `store`, where the parts of this view are under keys that begin with `key`. Only
// queries are segmented. Failures are kept in the parts.
ViewParts make_parts(const std::function<Cloud()>& input, std::span<const Entry> entries,
                     bool query, const std::string& key, Store& store);

// What failed for the needs of `entries`, each once, as "STAGE: REASON".
std::vector<std::string> failures_of(const ViewParts& parts, std::span<const Entry> entries);

// The features of one entry, which has descriptors, without `input` and `dense`; nothing if the
// frame or the descriptors failed, no spectrum if that failed or is not used.
std::optional<pipeline::Features> features_of(const ViewParts& parts, const Entry& entry);

// The milliseconds of everything in `parts` that `entry` uses, added to `ms`.
void add_times(const ViewParts& parts, const Entry& entry, pipeline::Times& ms);

// The same of what features_of() gives.
void add_feature_times(const ViewParts& parts, const Entry& entry, pipeline::Times& ms);

}  // namespace cosegraph::evaluation
