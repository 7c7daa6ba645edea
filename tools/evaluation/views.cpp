#include "tools/evaluation/views.hpp"

#include <algorithm>

namespace cosegraph::evaluation {
namespace {

std::set<std::string> labels_of(const Cloud& cloud) {
  std::set<std::string> names;
  for (const std::int32_t label : cloud.label)
    if (label != kNoLabel) names.insert(cloud.label_names[static_cast<std::size_t>(label)]);
  return names;
}

Made<source::Frame> make_frame(const Cloud& input, const pipeline::Config& config) {
  return make([&](pipeline::Times& ms) {
    return timed(ms, "source",
                 [&] { return source::prepare(input, config.extraction, config.source); });
  });
}

Made<Segments> make_segments(const source::Frame& frame, const pipeline::Config& config) {
  return make([&](pipeline::Times& ms) {
    const pipeline::Features features{.frame = {.dense = frame.dense}};
    Supervoxels supervoxels;
    return pipeline::presegment(features, config, supervoxels, &ms);
  });
}

void make_features(const Cloud& cloud, const Entry& entry, ViewParts& parts) {
  if (!parts.descriptors.contains(entry.descriptors))
    parts.descriptors[entry.descriptors] = make([&](pipeline::Times& ms) {
      return timed(ms, "descriptors",
                   [&] { return descriptors::compute(cloud, entry.config.descriptors); });
    });
  if (entry.spectra.empty() || parts.spectra.contains(entry.spectra)) return;
  parts.spectra[entry.spectra] = make([&](pipeline::Times& ms) {
    return timed(ms, "spectra", [&] { return spectra::compute(cloud, entry.config.spectra); });
  });
}

// Calls use(stage, made) for every part that `entry` uses, as far as they were begun.
template <class Use>
void for_each_part(const ViewParts& parts, const Entry& entry, Use&& use) {
  const auto visit = [&](const char* stage, const auto& made_parts, const std::string& key) {
    if (const auto at = made_parts.find(key); at != made_parts.end()) use(stage, at->second);
  };
  visit("source", parts.frames, entry.source);
  visit("descriptors", parts.descriptors, entry.descriptors);
  visit("spectra", parts.spectra, entry.spectra);
  visit("segments", parts.segments, entry.segments);
}

}  // namespace

ViewParts make_parts(const Cloud& input, std::span<const Entry> entries, bool query) {
  ViewParts parts{.labels = labels_of(input)};
  for (const Entry& entry : entries) {
    if (!parts.frames.contains(entry.source))
      parts.frames[entry.source] = make_frame(input, entry.config);
    const Made<source::Frame>& frame = parts.frames[entry.source];
    if (!frame.value) continue;
    make_features(frame.value->cloud, entry, parts);
    if (query && !parts.segments.contains(entry.segments))
      parts.segments[entry.segments] = make_segments(*frame.value, entry.config);
  }
  for (auto& [key, frame] : parts.frames) {
    if (!frame.value) continue;
    frame.value->dense = {};
    if (!query) frame.value->input = {};
  }
  return parts;
}

std::vector<std::string> failures_of(const ViewParts& parts, std::span<const Entry> entries) {
  std::vector<std::string> failures;
  for (const Entry& entry : entries)
    for_each_part(parts, entry, [&](const std::string& stage, const auto& made) {
      if (made.value) return;
      const std::string failure = stage + ": " + made.failure;
      if (std::ranges::find(failures, failure) == failures.end()) failures.push_back(failure);
    });
  return failures;
}

std::optional<pipeline::Features> features_of(const ViewParts& parts, const Entry& entry) {
  const Made<source::Frame>& frame = parts.frames.at(entry.source);
  if (!frame.value) return std::nullopt;
  const Made<Descriptors>& descriptors = parts.descriptors.at(entry.descriptors);
  if (!descriptors.value) return std::nullopt;
  pipeline::Features features{.frame = {.cloud = frame.value->cloud},
                              .descriptors = *descriptors.value};
  if (entry.spectra.empty()) return features;
  const Made<Spectrum>& spectrum = parts.spectra.at(entry.spectra);
  if (!spectrum.value) return std::nullopt;
  features.spectrum = *spectrum.value;
  return features;
}

void add_times(const ViewParts& parts, const Entry& entry, pipeline::Times& ms) {
  for_each_part(parts, entry, [&](const std::string&, const auto& made) {
    for (const auto& [stage, time] : made.ms) ms[stage] += time;
  });
}

}  // namespace cosegraph::evaluation
