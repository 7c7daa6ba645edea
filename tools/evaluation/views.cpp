#include "tools/evaluation/views.hpp"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "idl/codec.hpp"

namespace cosegraph::evaluation {
namespace {

std::set<std::string> labels_of(const Cloud& cloud) {
  std::set<std::string> names;
  for (const std::int32_t label : cloud.label)
    if (label != kNoLabel) names.insert(cloud.label_names[static_cast<std::size_t>(label)]);
  return names;
}

// -- kept parts: the times, then the values as on the wire --------------------------------------

std::string text_of(const pipeline::Times& ms) {
  return nlohmann::json(ms).dump();
}

template <class Value>
std::string packed(const Value& value) {
  const idl::Bytes bytes = idl::encode({}, value);
  return {bytes.begin(), bytes.end()};
}

template <class Value>
Value unpacked(const std::string& bytes) {
  return idl::decode<Value>(
      std::span(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()));
}

std::vector<std::string> pack(const Made<source::Frame>& frame) {
  return {text_of(frame.ms), packed(frame.value->input), packed(frame.value->cloud)};
}

void unpack(const std::vector<std::string>& record, source::Frame& frame) {
  frame.input = unpacked<Cloud>(record.at(1));
  frame.cloud = unpacked<Cloud>(record.at(2));
}

template <class Value>
std::vector<std::string> pack(const Made<Value>& made) {
  return {text_of(made.ms), packed(*made.value)};
}

template <class Value>
void unpack(const std::vector<std::string>& record, Value& value) {
  value = unpacked<Value>(record.at(1));
}

// Makes the parts of one view, each once.
class Maker {
 public:
  Maker(const std::function<Cloud()>& input, bool query, const std::string& key, Store& store)
      : input_(input), query_(query), key_(key), store_(store) {}

  std::set<std::string> labels() {
    if (const auto record = store_.read(key_ + "labels")) return {record->begin(), record->end()};
    const auto names = labels_of(rendered());
    store_.write(key_ + "labels", std::vector<std::string>(names.begin(), names.end()));
    return names;
  }

  Made<source::Frame> frame(const Entry& entry) {
    return kept<source::Frame>((query_ ? "query frame\n" : "frame\n") + entry.source, [&] {
      Made<source::Frame> made = whole_frame(entry);
      if (!made.value) return made;
      made.value->dense = {};
      if (!query_) made.value->input = {};
      return made;
    });
  }

  Made<Descriptors> descriptors(const Cloud& cloud, const Entry& entry) {
    return kept<Descriptors>("descriptors\n" + entry.descriptors, [&] {
      return make([&](pipeline::Times& ms) {
        return timed(ms, "descriptors",
                     [&] { return descriptors::compute(cloud, entry.config.descriptors); });
      });
    });
  }

  Made<Spectrum> spectrum(const Cloud& cloud, const Entry& entry) {
    return kept<Spectrum>("spectrum\n" + entry.spectra, [&] {
      return make([&](pipeline::Times& ms) {
        return timed(ms, "spectra", [&] { return spectra::compute(cloud, entry.config.spectra); });
      });
    });
  }

  Made<Segments> segments(const Entry& entry) {
    return kept<Segments>("segments\n" + entry.segments, [&] {
      return make([&](pipeline::Times& ms) {
        const pipeline::Features features{.frame = {.dense = whole_frame(entry).value->dense}};
        Supervoxels supervoxels;
        return pipeline::presegment(features, entry.config, supervoxels, &ms);
      });
    });
  }

 private:
  // What the store has, else what `work()` makes; failures are not kept.
  template <class Value, class Work>
  Made<Value> kept(const std::string& part, Work&& work) {
    Made<Value> made;
    if (const auto record = store_.read(key_ + part)) {
      unpack(*record, made.value.emplace());
      made.ms = nlohmann::json::parse(record->at(0)).get<pipeline::Times>();
      return made;
    }
    made = work();
    if (made.value) store_.write(key_ + part, pack(made));
    return made;
  }

  const Cloud& rendered() {
    if (!rendered_) rendered_ = input_();
    return *rendered_;
  }

  const Made<source::Frame>& whole_frame(const Entry& entry) {
    auto& made = whole_[entry.source];
    if (!made.value && made.failure.empty())
      made = make([&](pipeline::Times& ms) {
        return timed(ms, "source", [&] {
          return source::prepare(rendered(), entry.config.extraction, entry.config.source);
        });
      });
    return made;
  }

  const std::function<Cloud()>& input_;
  bool query_;
  const std::string& key_;
  Store& store_;
  std::optional<Cloud> rendered_;
  std::map<std::string, Made<source::Frame>> whole_;
};

template <class MadeParts, class Use>
void visit(const char* stage, const MadeParts& made_parts, const std::string& key, Use& use) {
  if (const auto at = made_parts.find(key); at != made_parts.end()) use(stage, at->second);
}

// Calls use(stage, made) for every part that `entry` uses, as far as they were begun.
template <class Use>
void for_each_feature(const ViewParts& parts, const Entry& entry, Use&& use) {
  visit("source", parts.frames, entry.source, use);
  visit("descriptors", parts.descriptors, entry.descriptors, use);
  visit("spectra", parts.spectra, entry.spectra, use);
}

template <class Use>
void for_each_part(const ViewParts& parts, const Entry& entry, Use&& use) {
  for_each_feature(parts, entry, use);
  visit("segments", parts.segments, entry.segments, use);
}

// For for_each_part().
auto adding_to(pipeline::Times& ms) {
  return [&ms](const std::string&, const auto& made) {
    for (const auto& [stage, time] : made.ms) ms[stage] += time;
  };
}

}  // namespace

ViewParts make_parts(const std::function<Cloud()>& input, std::span<const Entry> entries,
                     bool query, const std::string& key, Store& store) {
  Maker maker(input, query, key, store);
  ViewParts parts{.labels = maker.labels()};
  const auto add = [](auto& made_parts, const std::string& text, const auto& work) {
    if (!text.empty() && !made_parts.contains(text)) made_parts[text] = work();
  };
  for (const Entry& entry : entries) {
    add(parts.frames, entry.source, [&] { return maker.frame(entry); });
    const Made<source::Frame>& frame = parts.frames[entry.source];
    if (!frame.value) continue;
    const Cloud& cloud = frame.value->cloud;
    add(parts.descriptors, entry.descriptors, [&] { return maker.descriptors(cloud, entry); });
    add(parts.spectra, entry.spectra, [&] { return maker.spectrum(cloud, entry); });
    if (query) add(parts.segments, entry.segments, [&] { return maker.segments(entry); });
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
  if (!entry.spectra.empty()) features.spectrum = parts.spectra.at(entry.spectra).value;
  return features;
}

void add_times(const ViewParts& parts, const Entry& entry, pipeline::Times& ms) {
  for_each_part(parts, entry, adding_to(ms));
}

void add_feature_times(const ViewParts& parts, const Entry& entry, pipeline::Times& ms) {
  for_each_feature(parts, entry, adding_to(ms));
}

}  // namespace cosegraph::evaluation
