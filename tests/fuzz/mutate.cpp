// Mutations that know what is in a message.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <type_traits>

#include "fuzz/target.hpp"

namespace cosegraph::fuzz {
namespace {

// -- members of the values, for the mutations -----------------------------------------------------

template <class F>
void members(Cloud& v, F f) {
  f(v.xyz, v.normal, v.rgb, v.label, v.label_names, v.origin, v.scale, v.recipe, v.dense_index,
    v.notes, v.width, v.height);
}
template <class F>
void members(Supervoxels& v, F f) {
  f(v.of_point, v.centroid, v.normal, v.point_count, v.adjacency, v.seed_resolution);
}
template <class F>
void members(Segments& v, F f) {
  f(v.of_supervoxel, v.of_point, v.count, v.adjacency, v.concavity);
}
template <class F>
void members(DescriptorChannel& v, F f) {
  f(v.name, v.dimension, v.keypoint, v.value);
}
template <class F>
void members(Descriptors& v, F f) {
  f(v.recipe, v.channels);
}
template <class F>
void members(Encodings& v, F f) {
  f(v.segment_count, v.dimension, v.segment, v.value);
}
template <class F>
void members(Scores& v, F f) {
  f(v.label_names, v.majority, v.segment_count, v.probability);
}
template <class F>
void members(Spectrum& v, F f) {
  f(v.recipe, v.sample, v.sample_dense, v.eigenvalue, v.eigenfunction, v.component,
    v.nearest_sample);
}
template <class F>
void members(Labelling& v, F f) {
  f(v.label_names, v.majority, v.segment_label, v.segment_confidence, v.point_label,
    v.point_confidence, v.energy, v.gap, v.violations, v.expansions);
}
template <class F>
void members(AppearanceChannel& v, F f) {
  f(v.name, v.dimension, v.projection.output, v.projection.mean, v.projection.basis,
    v.mixture.components, v.mixture.dimension, v.mixture.weight, v.mixture.mean, v.mixture.sigma,
    v.block_scale);
}
template <class F>
void members(AppearanceModel& v, F f) {
  f(v.label_names, v.label_share, v.cloud_recipe, v.descriptor_recipe, v.encoding_recipe,
    v.channels, v.classifier.kernel, v.classifier.dimension, v.classifier.weight,
    v.classifier.support, v.classifier.coefficient, v.classifier.bias, v.classifier.gamma,
    v.classifier.sharpness);
}
template <class F>
void members(DistanceMixture& v, F f) {
  f(v.weight, v.mean, v.sigma);
}
template <class F>
void members(RelationModel& v, F f) {
  f(v.label_names, v.spectrum_recipe, v.pairs, v.neighbours);
}
template <class F>
void members(idl::StreamEnd& v, F f) {
  f(v.count);
}
template <class F>
void members(idl::FrameFailure& v, F f) {
  f(v.reason);
}
template <class F>
void members(idl::FrameDone& v, F f) {
  f(v.failed_stage, v.reason);
}
template <class F>
void members(idl::PortTraffic& v, F f) {
  f(v.name, v.topic, v.messages, v.bytes);
}
template <class F>
void members(idl::StageStatus& v, F f) {
  f(v.kind, v.host, v.replica, v.activity, v.progress, v.settled, v.latency_sum, v.ports);
}
template <class F>
void members(idl::Command& v, F f) {
  f(v.id, v.host, v.stage, v.generation, v.verb, v.words);
}
template <class F>
void members(idl::Reply& v, F f) {
  f(v.id, v.host, v.text);
}
template <class F>
void members(idl::AgentProcess& v, F f) {
  f(v.stage, v.replica, v.generation, v.text);
}
template <class F>
void members(idl::AgentStatus& v, F f) {
  f(v.host, v.address, v.pid, v.processes);
}
template <class F>
void members(idl::LogLines& v, F f) {
  f(v.host, v.stage, v.replica, v.lines);
}

// -- changes --------------------------------------------------------------------------------------

template <class T>
T odd_number(Random& random) {
  using Limits = std::numeric_limits<T>;
  if constexpr (std::is_floating_point_v<T>) {
    const T all[] = {Limits::quiet_NaN(),
                     Limits::infinity(),
                     -Limits::infinity(),
                     Limits::max(),
                     Limits::lowest(),
                     Limits::min(),
                     Limits::denorm_min(),
                     T{1e20},
                     T{-1e9},
                     T{1e-9},
                     T{0},
                     T{1}};
    return all[random.below(std::size(all))];
  } else {
    const T all[] = {Limits::max(), Limits::min(), T(Limits::max() / 2), T(-1), T{0}, T{1}, T{100}};
    return all[random.below(std::size(all))];
  }
}

class Change {
 public:
  explicit Change(Random& random) : random_(random) {}

  template <class T>
  requires std::is_arithmetic_v<T>
  void operator()(T& number) {
    const bool is_last = number == std::numeric_limits<T>::max();
    const T near[] = {is_last ? T{0} : static_cast<T>(number + T{1}), static_cast<T>(number / T{2}),
                      odd_number<T>(random_)};
    number = near[random_.below(3)];
  }

  void operator()(std::string& text) {
    switch (random_.below(4)) {
      case 0:
        text.clear();
        break;
      case 1:
        text += text + "x";
        break;
      case 2:
        text = "../\xff";
        break;
      default:
        if (!text.empty()) text[random_.below(text.size())] = static_cast<char>(random_.below(256));
    }
  }

  void operator()(std::array<std::int32_t, 2>& pair) { (*this)(pair[random_.below(2)]); }

  void operator()(std::array<float, 3>& vector) { (*this)(vector[random_.below(3)]); }

  template <class T>
  void operator()(std::vector<T>& list) {
    if (random_.below(3) == 0 || list.empty()) return resize(list);
    if constexpr (std::is_arithmetic_v<T>)
      if (random_.below(2) == 0) return change_all(list);
    switch (random_.below(3)) {
      case 0:
        std::swap(list[random_.below(list.size())], list[random_.below(list.size())]);
        break;
      case 1:
        list[random_.below(list.size())] = list[random_.below(list.size())];
        break;
      default:
        (*this)(list[random_.below(list.size())]);
    }
  }

  // Anything with members: one of them.
  template <class T>
  requires std::is_class_v<T>
  void operator()(T& value) {
    members(value, [this](auto&... member) {
      const std::size_t chosen = random_.below(sizeof...(member));
      std::size_t at = 0;
      ((at++ == chosen ? (*this)(member) : void()), ...);
    });
  }

 private:
  template <class T>
  void resize(std::vector<T>& list) {
    switch (random_.below(4)) {
      case 0:
        list.clear();
        break;
      case 1:
        list.resize(random_.below(list.size() + 1));
        break;
      case 2:
        if (!list.empty())
          list.erase(list.begin() + static_cast<std::ptrdiff_t>(random_.below(list.size())));
        break;
      default:
        if (list.size() < 2000) list.resize(list.size() + 1 + random_.below(list.size() + 1));
    }
  }

  template <class T>
  void change_all(std::vector<T>& list) {
    const T number = odd_number<T>(random_);
    if constexpr (std::is_floating_point_v<T>) {
      const double factor = std::pow(10.0, random_.uniform(-40.0, 40.0));
      switch (random_.below(3)) {
        case 0:
          std::ranges::fill(list, number);
          break;
        case 1:
          for (T& value : list) value = static_cast<T>(value * factor);
          break;
        default:
          for (T& value : list) value += number;
      }
    } else {
      std::ranges::fill(list, random_.below(2) == 0 ? number : list[random_.below(list.size())]);
    }
  }

  Random& random_;
};

// -- changes that keep a message's sizes in step --------------------------------------------------

template <class T>
void keep(std::vector<T>& list, const std::vector<std::int32_t>& chosen, std::size_t width = 1) {
  if (list.empty()) return;
  std::vector<T> kept;
  for (const std::int32_t i : chosen)
    for (std::size_t d = 0; d < width; ++d)
      kept.push_back(list[static_cast<std::size_t>(i) * width + d]);
  list = std::move(kept);
}

// Some of `size` things, in order; sometimes one of them many times.
std::vector<std::int32_t> subset(std::size_t size, Random& random) {
  auto chosen = random.sample(size, random.below(size + 1));
  std::ranges::sort(chosen);
  if (size > 0 && random.below(4) == 0)
    chosen.insert(chosen.end(), 1 + random.below(64),
                  static_cast<std::int32_t>(random.below(size)));
  return chosen;
}

void reshape(Cloud& cloud, Random& random) {
  const auto chosen = subset(cloud.size(), random);
  keep(cloud.xyz, chosen, 3);
  keep(cloud.normal, chosen, 3);
  keep(cloud.rgb, chosen, 3);
  keep(cloud.label, chosen);
  if (chosen.empty()) cloud.label_names.clear();
  keep(cloud.dense_index, chosen);
  cloud.width = static_cast<std::uint32_t>(chosen.size());
  cloud.height = 1;
}

void reshape(Segments& segments, Random& random) {
  if (random.below(2) == 0)
    return keep(segments.of_point, subset(segments.of_point.size(), random));
  const auto count = static_cast<std::int32_t>(random.below(segments.of_supervoxel.size() + 1));
  if (count == 0) segments.of_point.clear(), segments.of_supervoxel.clear();
  for (auto* ids : {&segments.of_supervoxel, &segments.of_point})
    for (auto& id : *ids) id %= count;
  segments.count = count;
  segments.adjacency.clear();
  for (std::int32_t a = 0; a + 1 < count; a += 1 + static_cast<std::int32_t>(random.below(3)))
    segments.adjacency.push_back({a, a + 1});
  segments.concavity.assign(segments.adjacency.size(), 0.5F);
}

void reshape(Supervoxels& supervoxels, Random& random) {
  keep(supervoxels.of_point, subset(supervoxels.of_point.size(), random));
}

void reshape(Labelling& labelling, Random& random) {
  const auto chosen = subset(labelling.point_label.size(), random);
  keep(labelling.point_label, chosen);
  keep(labelling.point_confidence, chosen);
}

void reshape(Descriptors& descriptors, Random& random) {
  for (auto& channel : descriptors.channels) {
    const auto chosen = subset(channel.keypoint.size(), random);
    keep(channel.keypoint, chosen);
    keep(channel.value, chosen, static_cast<std::size_t>(channel.dimension));
  }
}

void reshape(Encodings& encodings, Random& random) {
  const auto chosen = subset(encodings.segment.size(), random);
  keep(encodings.segment, chosen);
  keep(encodings.value, chosen, static_cast<std::size_t>(encodings.dimension));
}

void reshape(Scores& scores, Random& random) {
  scores.segment_count = static_cast<std::int32_t>(random.below(8));
  scores.probability.assign(
      static_cast<std::size_t>(scores.segment_count) * scores.label_names.size(),
      static_cast<float>(random.uniform()));
}

void reshape(Spectrum& spectrum, Random& random) {
  if (random.below(2) == 0)
    return keep(spectrum.nearest_sample, subset(spectrum.nearest_sample.size(), random));
  const std::size_t width = spectrum.eigenvalue.size();
  const auto chosen = subset(spectrum.sample.size(), random);
  keep(spectrum.sample, chosen);
  keep(spectrum.sample_dense, chosen);
  keep(spectrum.component, chosen);
  keep(spectrum.eigenfunction, chosen, width);
  const auto count = static_cast<std::int32_t>(chosen.size());
  if (count == 0) spectrum.nearest_sample.clear();
  for (auto& sample : spectrum.nearest_sample) sample %= count;
}

template <class Value>
void reshape(Value& value, Random& random) {
  Change change(random);
  change(value);
}

// -- by the name of a type ------------------------------------------------------------------------

template <class Value>
idl::Bytes changed(const idl::Bytes& bytes, Random& random) {
  Value value = idl::decode<Value>(bytes);
  Change change(random);
  const bool keeps_sizes = random.below(4) == 0;
  if (keeps_sizes) reshape(value, random);
  for (std::size_t i = random.below(3) + (keeps_sizes ? 0 : 1); i > 0; --i) change(value);
  return idl::encode(idl::decode_header(bytes), value);
}

using Changer = idl::Bytes (*)(const idl::Bytes&, Random&);

template <class... Values>
Changer find_changer(std::string_view type) {
  Changer found = nullptr;
  ((idl::type_name<Values>() == type ? void(found = changed<Values>) : void()), ...);
  return found;
}

}  // namespace

void mutate(Bundle& bundle, Random& random) {
  const auto types = types_of(bundle.choice);
  const std::size_t count = std::min(types.size(), bundle.messages.size());
  if (count == 0) return;
  const std::size_t at = random.below(count);
  const Changer change =
      find_changer<Cloud, Supervoxels, Segments, Descriptors, Encodings, Scores, Spectrum,
                   Labelling, AppearanceModel, RelationModel, idl::StreamEnd, idl::FrameFailure,
                   idl::FrameDone, idl::StageStatus, idl::Command, idl::Reply, idl::AgentStatus,
                   idl::LogLines>(types[at]);
  if (change == nullptr) throw Error("no mutation for the type " + std::string(types[at]));
  try {
    bundle.messages[at] = change(bundle.messages[at], random);
  } catch (const Error&) {
    // It does not decode: there is nothing to know about it.
  }
}

}  // namespace cosegraph::fuzz
