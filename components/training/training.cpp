#include "training/training.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "core/error.hpp"
#include "core/nearest.hpp"
#include "core/random.hpp"
#include "model/model.hpp"

namespace cosegraph::training {
namespace {

using Labels = std::vector<std::int32_t>;

constexpr std::size_t kMostPoints = 200'000;  // of a view
constexpr std::size_t kMostParts = 1000;

// The views' labels in the model's terms.
struct Parts {
  std::vector<std::string> names;  // sorted
  std::vector<Labels> of_point;    // per view and point of `cloud`, index into names
  std::vector<float> share;        // per part, of all labelled points
};

std::vector<std::string> union_of_names(std::span<const View> views) {
  std::set<std::string> names;
  for (const View& view : views)
    names.insert(view.cloud.label_names.begin(), view.cloud.label_names.end());
  return {names.begin(), names.end()};
}

Labels renamed(const Cloud& cloud, const std::vector<std::string>& names) {
  Labels to;
  for (const std::string& name : cloud.label_names)
    to.push_back(static_cast<std::int32_t>(std::ranges::lower_bound(names, name) - names.begin()));
  Labels result;
  for (const std::int32_t label : cloud.label)
    result.push_back(label == kNoLabel ? kNoLabel : to[label]);
  return result;
}

std::string view_name(std::size_t view) {
  return "view " + std::to_string(view);
}

Parts parts_of(std::span<const View> views) {
  Parts parts{.names = union_of_names(views)};
  std::vector<std::size_t> shown(parts.names.size(), 0);
  std::size_t total = 0;
  for (const View& view : views) {
    parts.of_point.push_back(renamed(view.cloud, parts.names));
    for (const std::int32_t label : parts.of_point.back()) {
      if (label == kNoLabel) continue;
      ++shown[label];
      ++total;
    }
  }
  if (parts.names.size() < 2)
    throw InputError("the reference has a single part, '" + parts.names[0] +
                     "': there is nothing to tell apart");
  if (parts.names.size() > kMostParts)
    throw InputError("the reference has " + std::to_string(parts.names.size()) +
                     " parts, more than " + std::to_string(kMostParts));
  for (std::size_t l = 0; l < shown.size(); ++l) {
    if (shown[l] == 0) throw InputError("no view shows the part '" + parts.names[l] + "'");
    parts.share.push_back(static_cast<float>(shown[l]) / static_cast<float>(total));
  }
  return parts;
}

void require_same(std::size_t view, const std::string& what, const std::string& have,
                  const std::string& first) {
  if (have != first)
    throw MismatchError(view_name(view) + ": " + what + " '" + have + "', view 0 has '" + first +
                        "'");
}

std::string channel_names(const Descriptors& descriptors) {
  std::string result;
  for (const DescriptorChannel& channel : descriptors.channels)
    result +=
        (result.empty() ? "" : ",") + channel.name + "[" + std::to_string(channel.dimension) + "]";
  return result;
}

void check_channels(const View& view, std::size_t index) {
  const auto points = static_cast<std::int32_t>(view.cloud.size());
  if (view.descriptors.channels.empty()) throw InputError(view_name(index) + ": no descriptors");
  for (const DescriptorChannel& channel : view.descriptors.channels) {
    if (channel.dimension < 1 ||
        channel.value.size() != channel.keypoint.size() * channel.dimension)
      throw InputError(view_name(index) + ", channel '" + channel.name +
                       "': values do not fit keypoints");
    if (std::ranges::any_of(channel.keypoint, [=](auto p) { return p < 0 || p >= points; }))
      throw InputError(view_name(index) + ", channel '" + channel.name +
                       "': a keypoint is not a point of the cloud");
  }
}

void check_cloud(const View& view, std::size_t index) {
  try {
    check_sizes(view.cloud);
  } catch (const InputError& error) {
    throw InputError(view_name(index) + ": " + error.what());
  }
  if (view.cloud.size() > kMostPoints)
    throw InputError(view_name(index) + " has " + std::to_string(view.cloud.size()) +
                     " points, more than " + std::to_string(kMostPoints));
  const auto usable = [](float x) { return std::abs(x) <= NearestNeighbours::kFarthest; };
  if (!std::ranges::all_of(view.cloud.xyz, usable))
    throw InputError(view_name(index) + " has a point that is not finite, or too far out");
  if (std::ranges::all_of(view.cloud.label, [](auto label) { return label == kNoLabel; }))
    throw InputError(view_name(index) + " has no labels");
}

void check_appearance(const View& view, std::size_t index, const View& first) {
  check_cloud(view, index);
  check_channels(view, index);
  require_same(index, "points were made with", view.cloud.recipe, first.cloud.recipe);
  require_same(index, "descriptors were made with", view.descriptors.recipe,
               first.descriptors.recipe);
  require_same(index, "descriptor channels are", channel_names(view.descriptors),
               channel_names(first.descriptors));
}

void check_spectrum(const View& view, std::size_t index, const View& first) {
  if (view.spectrum.has_value() != first.spectrum.has_value())
    throw MismatchError(view_name(index) + (view.spectrum ? " has" : " lacks") +
                        " a spectrum, unlike view 0");
  if (!view.spectrum) return;
  const auto points = static_cast<std::int32_t>(view.cloud.size());
  if (std::ranges::any_of(view.spectrum->sample, [=](auto p) { return p < 0 || p >= points; }))
    throw InputError(view_name(index) + ": a spectrum sample is not a point of the cloud");
  require_same(index, "the spectrum was made with", view.spectrum->recipe, first.spectrum->recipe);
}

void check_views(std::span<const View> views) {
  if (views.empty()) throw InputError("no view to learn from");
  for (std::size_t v = 0; v < views.size(); ++v) check_appearance(views[v], v, views[0]);
}

void check_spectra(std::span<const View> views) {
  for (std::size_t v = 0; v < views.size(); ++v) check_spectrum(views[v], v, views[0]);
}

// Descriptors of channel `c` at labelled points of all views; a seeded subset if there are more
// than `most`, in the views' order.
std::vector<float> labelled_samples(std::span<const View> views, const Parts& parts, std::size_t c,
                                    std::size_t most, std::uint64_t seed) {
  std::vector<const float*> rows;
  const std::size_t dimension = views[0].descriptors.channels[c].dimension;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const DescriptorChannel& channel = views[v].descriptors.channels[c];
    for (std::size_t row = 0; row < channel.keypoint.size(); ++row)
      if (parts.of_point[v][channel.keypoint[row]] != kNoLabel)
        rows.push_back(&channel.value[row * dimension]);
  }
  auto chosen = Random(seed).sample(rows.size(), most);
  std::ranges::sort(chosen);
  std::vector<float> result;
  result.reserve(chosen.size() * dimension);
  for (const std::int32_t i : chosen) result.insert(result.end(), rows[i], rows[i] + dimension);
  return result;
}

AppearanceChannel fit_channel(std::span<const View> views, const Parts& parts, std::size_t c,
                              const Params& params) {
  const DescriptorChannel& source = views[0].descriptors.channels[c];
  AppearanceChannel channel{.name = source.name, .dimension = source.dimension};
  const std::uint64_t seed = derive_seed(params.mixture.seed, c);
  std::vector<float> samples =
      labelled_samples(views, parts, c, params.mixture_samples, derive_seed(seed, 1));
  if (samples.empty())
    throw InputError("channel '" + source.name + "' has no keypoint on a labelled point");
  int dimension = source.dimension;
  if (params.projection > 0 && dimension > params.projection) {
    channel.projection = fisher::fit_projection(samples, dimension, params.projection);
    samples = fisher::project(channel.projection, samples);
    dimension = channel.projection.output;
  }
  fisher::MixtureParams mixture = params.mixture;
  mixture.seed = seed;
  channel.mixture = fisher::fit_mixture(samples, dimension, mixture);
  return channel;
}

struct Packets {
  std::vector<float> value;  // packets x dimension
  Labels label;
};

// Equally many packets of every part in every view that shows it.
Packets encode_view(const View& view, const Labels& part, std::size_t index, std::size_t part_count,
                    std::span<const AppearanceChannel> channels, const Params& params) {
  std::vector<std::vector<float>> projected;
  for (std::size_t c = 0; c < channels.size(); ++c)
    projected.push_back(
        fisher::project(channels[c].projection, view.descriptors.channels[c].value));
  std::vector<fisher::Packets> packets(channels.size());
  Packets result;
  for (std::size_t l = 0; l < part_count; ++l) {
    fisher::Draw draw = params.draw;
    draw.seed = derive_seed(params.draw.seed, index, l);
    const auto drawn = fisher::draw_packets(view.cloud.xyz, part, static_cast<std::int32_t>(l),
                                            view.descriptors.channels, params.encoding, draw);
    result.label.insert(result.label.end(), drawn[0].packet.size(), static_cast<std::int32_t>(l));
    for (std::size_t c = 0; c < drawn.size(); ++c) fisher::append(packets[c], drawn[c]);
  }
  result.value = fisher::encode_packets(packets, projected, channels, params.encoding);
  return result;
}

double norm(std::span<const float> values) {
  double sum = 0.0;
  for (const float v : values) sum += double{v} * v;
  return std::sqrt(sum);
}

// Brings each channel's block to unit norm in the mean over all packets.
void scale_blocks(std::vector<AppearanceChannel>& channels, const fisher::Encoding& encoding,
                  std::size_t stride, std::vector<float>& vectors) {
  std::size_t offset = 0;
  for (AppearanceChannel& channel : channels) {
    const std::size_t size = fisher::block_size(channel.mixture, encoding);
    double sum = 0.0;
    for (std::size_t at = offset; at < vectors.size(); at += stride)
      sum += norm(std::span(vectors).subspan(at, size));
    const double mean = sum * static_cast<double>(stride) / static_cast<double>(vectors.size());
    if (mean > 0.0) channel.block_scale = static_cast<float>(1.0 / mean);
    for (std::size_t at = offset; at < vectors.size(); at += stride)
      for (std::size_t i = at; i < at + size; ++i) vectors[i] *= channel.block_scale;
    offset += size;
  }
}

void require_all_parts(const Labels& label, const std::vector<std::string>& names) {
  for (std::size_t l = 0; l < names.size(); ++l)
    if (!std::ranges::count(label, static_cast<std::int32_t>(l)))
      throw InputError("the part '" + names[l] +
                       "' has no view with a keypoint of every descriptor channel on it");
}

Classifier fit_classifier(std::vector<AppearanceChannel>& channels, Packets packets,
                          const Parts& parts, const Params& params) {
  require_all_parts(packets.label, parts.names);
  const std::size_t stride = packets.value.size() / packets.label.size();
  scale_blocks(channels, params.encoding, stride, packets.value);
  svm::TrainParams classifier = params.svm;
  if (classifier.kernel == svm::Kernel::automatic)
    classifier.kernel =
        params.encoding.method == fisher::Method::fv ? svm::Kernel::linear : svm::Kernel::rbf;
  return svm::train(packets.value, static_cast<int>(stride), packets.label,
                    static_cast<int>(parts.names.size()), classifier);
}

RelationModel fit_relations(std::span<const View> views, const Parts& parts, const Params& params) {
  const int label_count = static_cast<int>(parts.names.size());
  RelationModel model{.label_names = parts.names};
  std::vector<Cloud> clouds;
  std::vector<astar::RelationView> relations;
  for (std::size_t v = 0; v < views.size(); ++v) {
    clouds.push_back({.xyz = views[v].cloud.xyz,
                      .label = parts.of_point[v],
                      .label_names = parts.names,
                      .scale = views[v].cloud.scale,
                      .width = static_cast<std::uint32_t>(views[v].cloud.size())});
    if (!views[v].spectrum) continue;
    astar::RelationView relation{.spectrum = &*views[v].spectrum};
    for (const std::int32_t point : views[v].spectrum->sample)
      relation.label.push_back(parts.of_point[v][point]);
    relations.push_back(std::move(relation));
  }
  std::vector<const Cloud*> pointers;
  for (const Cloud& cloud : clouds) pointers.push_back(&cloud);
  model.neighbours = astar::observed_neighbours(pointers, label_count, params.neighbour_radius,
                                                params.neighbour_pairs);
  if (relations.empty()) return model;
  model.spectrum_recipe = views[0].spectrum->recipe;
  model.pairs = astar::fit_relations(relations, label_count, params.relations);
  return model;
}

Fields describe(fisher::MixtureParams& params) {
  return {
      integer_field("components", params.components, 1, 1024, "", "Gaussians per channel."),
      integer_field("iterations", params.iterations, 0, 1000, "",
                    "Steps of expectation maximisation."),
      number_field("variance_floor", params.variance_floor, 1e-6, 1.0, "",
                   "Least variance, as a share of the variance of all samples per dimension."),
      seed_field("seed", params.seed, "Seed of the k-means++ start."),
  };
}

Fields describe(fisher::Draw& draw) {
  return {
      integer_field("clusters", draw.clusters, 1, 10000, "", "Clusters drawn per part and view."),
      integer_field("packets", draw.packets, 1, 10000, "", "Packets drawn per part and view."),
      seed_field("seed", draw.seed, "Seed of the draw."),
  };
}

Fields describe(astar::RelationParams& params) {
  return {
      integer_field("mixture", params.mixture, 1, 64, "",
                    "Gaussians of the distances of a pair of parts."),
      integer_field("samples_per_pair", params.samples_per_pair, 1, 1000000, "",
                    "Distances per pair of parts and view."),
      seed_field("seed", params.seed, "Seed of the choice of distances and of the mixtures."),
  };
}

}  // namespace

Fields describe(Params& params) {
  Fields fields = prefixed("encoding", fisher::describe(params.encoding));
  fields = concatenated(std::move(fields), prefixed("mixture", describe(params.mixture)));
  fields = concatenated(std::move(fields), prefixed("draw", describe(params.draw)));
  fields = concatenated(std::move(fields), prefixed("svm", svm::describe(params.svm)));
  fields = concatenated(std::move(fields), prefixed("relations", describe(params.relations)));
  return concatenated(
      std::move(fields),
      {integer_field("projection", params.projection, 0, 100000, "",
                     "Descriptors with more numbers are reduced to this many; 0: never."),
       integer_field("mixture_samples", params.mixture_samples, 1, 10000000, "",
                     "Most descriptors per channel that projection and mixture are fitted to."),
       number_field("neighbour_radius", params.neighbour_radius, 0.0, 10.0, "scale",
                    "Distance within which points of two parts count as neighbours."),
       integer_field("neighbour_pairs", params.neighbour_pairs, 1, 1000000, "",
                     "Pairs of such points that make two parts neighbours.")});
}

void check_view(const View& view, std::size_t index, const View& first) {
  check_appearance(view, index, first);
  check_spectrum(view, index, first);
}

AppearanceModel learn_appearance(std::span<const View> views, const Params& params,
                                 const Progress& progress) {
  const auto report = [&](std::string_view step, double done) {
    if (progress) progress(step, done);
  };
  check_views(views);
  const Parts parts = parts_of(views);

  AppearanceModel appearance;
  appearance.label_names = parts.names;
  appearance.label_share = parts.share;
  appearance.cloud_recipe = views[0].cloud.recipe;
  appearance.descriptor_recipe = views[0].descriptors.recipe;
  fisher::Encoding encoding = params.encoding;
  appearance.encoding_recipe = recipe(fisher::describe(encoding));

  const std::size_t channels = views[0].descriptors.channels.size();
  for (std::size_t c = 0; c < channels; ++c) {
    report("mixtures", static_cast<double>(c) / static_cast<double>(channels));
    appearance.channels.push_back(fit_channel(views, parts, c, params));
  }
  Packets packets;
  for (std::size_t v = 0; v < views.size(); ++v) {
    report("packets", static_cast<double>(v) / static_cast<double>(views.size()));
    const Packets more = encode_view(views[v], parts.of_point[v], v, parts.names.size(),
                                     appearance.channels, params);
    packets.value.insert(packets.value.end(), more.value.begin(), more.value.end());
    packets.label.insert(packets.label.end(), more.label.begin(), more.label.end());
  }
  report("classifier", 0.0);
  appearance.classifier = fit_classifier(appearance.channels, std::move(packets), parts, params);
  return appearance;
}

RelationModel learn_relations(std::span<const View> views, const Params& params) {
  check_views(views);
  check_spectra(views);
  return fit_relations(views, parts_of(views), params);
}

Model train(std::span<const View> views, const Params& params, const Progress& progress) {
  check_spectra(views);
  Model model{.appearance = learn_appearance(views, params, progress)};
  if (progress) progress("relations", 0.0);
  model.relation = learn_relations(views, params);
  model.appearance.id = model.relation.id = model::content_id(model);
  model::check(model.appearance);
  model::check(model.relation);
  if (progress) progress("relations", 1.0);
  return model;
}

}  // namespace cosegraph::training
