#include "fisher/fisher.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <string>

#include "core/error.hpp"
#include "core/nearest.hpp"
#include "core/random.hpp"
#include "fisher/kernels.hpp"

template <>
cosegraph::Names<cosegraph::fisher::Method> cosegraph::names<cosegraph::fisher::Method>() {
  using enum cosegraph::fisher::Method;
  static constexpr std::pair<fisher::Method, std::string_view> table[] = {{fv, "fv"}, {bow, "bow"}};
  return table;
}

template <>
cosegraph::Names<cosegraph::fisher::Pool> cosegraph::names<cosegraph::fisher::Pool>() {
  using enum cosegraph::fisher::Pool;
  static constexpr std::pair<fisher::Pool, std::string_view> table[] = {{cluster, "cluster"},
                                                                        {packet, "packet"}};
  return table;
}

template <>
cosegraph::Names<cosegraph::fisher::BowForm> cosegraph::names<cosegraph::fisher::BowForm>() {
  using enum cosegraph::fisher::BowForm;
  static constexpr std::pair<fisher::BowForm, std::string_view> table[] = {{posterior, "posterior"},
                                                                           {literal, "literal"}};
  return table;
}

namespace cosegraph::fisher {
namespace {

using Rows = std::vector<std::int32_t>;

constexpr std::size_t kMostNumbers = std::size_t{1} << 28;  // in any of the tables of a frame

bool is_literal(const Encoding& encoding) {
  return encoding.method == Method::bow && encoding.bow == BowForm::literal;
}

// log sum_i exp(value_i), value_i given by `at(i)`.
template <class At>
double log_sum_exp(std::size_t count, const At& at) {
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count; ++i) largest = std::max<double>(largest, at(i));
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) sum += std::exp(at(i) - largest);
  return largest + std::log(sum);
}

// Encodes clusters of one channel's rows. A packet's vector is a weighted sum of what `gather`
// returns for its clusters, so that each cluster, and each row's posterior, is worked on once:
//   Fisher vectors  sum_t gamma_t u_t, then sum_t gamma_t (u_t^2 - 1), u = (m - mu) / sigma
//   posterior BoW   sum_t gamma_t
//   literal BoW     log sum_t w_k N_k(m_t); weighted sums are then of the exponentials
class Encoder {
 public:
  Encoder(const GaussianMixture& mixture, std::span<const float> samples, const Encoding& encoding)
      : mixture_(mixture),
        evaluator_(mixture),
        samples_(samples),
        encoding_(encoding),
        size_(block_size(mixture, encoding)),
        per_component_(is_literal(encoding) ? log_components(mixture, samples)
                                            : posteriors(mixture, samples)) {}

  std::size_t size() const { return size_; }

  std::vector<float> gather(const Rows& rows) const {
    if (is_literal(encoding_)) return gather_literal(rows);
    return encoding_.method == Method::bow ? gather_posteriors(rows) : gather_deviations(rows);
  }

  // The vector of all of `parts`, whose weights include the division by T.
  std::vector<float> combine(std::span<const std::vector<float>* const> parts,
                             std::span<const double> weights) const {
    if (is_literal(encoding_)) return combine_literal(parts, weights);
    std::vector<float> result(size_, 0.0F);
    for (std::size_t p = 0; p < parts.size(); ++p) {
      const auto weight = static_cast<float>(weights[p]);
      const float* part = parts[p]->data();
      for (std::size_t i = 0; i < size_; ++i) result[i] += weight * part[i];
    }
    if (encoding_.method == Method::fv) scale_by_component(result);
    return result;
  }

 private:
  float value(std::int32_t row, std::size_t k) const {
    return per_component_[static_cast<std::size_t>(row) * mixture_.components + k];
  }

  std::vector<float> gather_literal(const Rows& rows) const {
    std::vector<float> result(size_);
    for (std::size_t k = 0; k < size_; ++k)
      result[k] = static_cast<float>(
          log_sum_exp(rows.size(), [&](std::size_t i) { return value(rows[i], k); }));
    return result;
  }

  std::vector<float> gather_posteriors(const Rows& rows) const {
    std::vector<float> result(size_, 0.0F);
    for (const std::int32_t row : rows)
      for (std::size_t k = 0; k < size_; ++k) result[k] += value(row, k);
    return result;
  }

  std::vector<float> gather_deviations(const Rows& rows) const {
    const std::size_t dimension = mixture_.dimension;
    const std::size_t half = size_ / 2;
    std::vector<float> result(size_, 0.0F);
    Rows shared;
    std::vector<float> weight;
    for (std::size_t k = 0; k < static_cast<std::size_t>(mixture_.components); ++k) {
      shared.clear();
      weight.clear();
      float total = 0.0F;
      for (const std::int32_t row : rows) {
        const float g = value(row, k);
        if (g == 0.0F) continue;
        shared.push_back(row);
        weight.push_back(g);
        total += g;
      }
      const std::size_t at = k * dimension;
      accumulate(mixture_.dimension, samples_.data(), shared, weight.data(), &evaluator_.mean[at],
                 &evaluator_.inverse[at], &result[at], &result[half + at]);
      for (std::size_t d = 0; d < dimension; ++d) result[half + at + d] -= total;
    }
    return result;
  }

  std::vector<float> combine_literal(std::span<const std::vector<float>* const> parts,
                                     std::span<const double> weights) const {
    std::vector<double> logs(size_);
    for (std::size_t k = 0; k < size_; ++k)
      logs[k] = log_sum_exp(parts.size(),
                            [&](std::size_t p) { return std::log(weights[p]) + (*parts[p])[k]; });
    const double largest = *std::ranges::max_element(logs);
    std::vector<float> result(size_);
    for (std::size_t k = 0; k < size_; ++k)
      result[k] = static_cast<float>(std::exp(logs[k] - largest));
    return result;
  }

  // The factors 1 / sqrt(w_k) of (4) and 1 / sqrt(2 w_k) of (5).
  void scale_by_component(std::vector<float>& vector) const {
    const std::size_t dimension = mixture_.dimension;
    const std::size_t half = size_ / 2;
    for (std::size_t k = 0; k < static_cast<std::size_t>(mixture_.components); ++k) {
      const auto first = static_cast<float>(1.0 / std::sqrt(double{mixture_.weight[k]}));
      const auto second = static_cast<float>(1.0 / std::sqrt(2.0 * mixture_.weight[k]));
      for (std::size_t d = 0; d < dimension; ++d) {
        vector[k * dimension + d] *= first;
        vector[half + k * dimension + d] *= second;
      }
    }
  }

  const GaussianMixture& mixture_;
  Evaluator evaluator_;
  std::span<const float> samples_;
  const Encoding& encoding_;
  std::size_t size_;
  std::vector<float> per_component_;
};

void power_normalise(std::span<float> block, double alpha) {
  if (alpha == 1.0) return;
  if (alpha == 0.5) {
    for (float& z : block) z = std::copysign(std::sqrt(std::abs(z)), z);
    return;
  }
  const auto exponent = static_cast<float>(alpha);
  for (float& z : block) z = std::copysign(std::pow(std::abs(z), exponent), z);
}

void scale_to_unit_length(std::span<float> block) {
  double sum = 0.0;
  for (const float z : block) sum += double{z} * z;
  if (sum <= 0.0) return;
  const auto factor = static_cast<float>(1.0 / std::sqrt(sum));
  for (float& z : block) z *= factor;
}

// Weight of each cluster's sums in the vector of a packet: the mean over its clusters of means
// over their rows, or the mean over all rows.
std::vector<double> cluster_weights(const std::vector<const Rows*>& clusters, Pool pool) {
  std::size_t rows = 0;
  for (const Rows* cluster : clusters) rows += cluster->size();
  std::vector<double> result;
  for (const Rows* cluster : clusters)
    result.push_back(pool == Pool::packet
                         ? 1.0 / static_cast<double>(rows)
                         : 1.0 / static_cast<double>(clusters.size() * cluster->size()));
  return result;
}

// Points that clusters may be centred at, and per channel the rows they may consist of.
struct Group {
  std::vector<std::int32_t> points;
  std::vector<Rows> rows;
};

// The `count` rows of `channel` nearest to `centre`, ties by row.
Rows nearest_rows(std::span<const float> xyz, const DescriptorChannel& channel, const Rows& rows,
                  std::int32_t centre, std::size_t count) {
  std::vector<std::pair<float, std::int32_t>> found;
  found.reserve(rows.size());
  const float* c = &xyz[3 * static_cast<std::size_t>(centre)];
  for (const std::int32_t row : rows) {
    const float* p = &xyz[3 * static_cast<std::size_t>(channel.keypoint[row])];
    const float x = p[0] - c[0];
    const float y = p[1] - c[1];
    const float z = p[2] - c[2];
    found.emplace_back(x * x + y * y + z * z, row);
  }
  const auto end = found.begin() + static_cast<std::ptrdiff_t>(std::min(count, found.size()));
  std::partial_sort(found.begin(), end, found.end());
  Rows result;
  for (auto it = found.begin(); it != end; ++it) result.push_back(it->second);
  return result;
}

// `count` centres without repetition, as long as there are enough points.
std::vector<std::int32_t> draw_centres(const std::vector<std::int32_t>& points, std::size_t count,
                                       Random& random) {
  std::vector<std::int32_t> result;
  while (result.size() < count)
    for (const std::int32_t i : random.sample(points.size(), count - result.size()))
      result.push_back(points[i]);
  return result;
}

std::vector<Packets> draw_from_group(std::span<const float> xyz, const Group& group,
                                     std::span<const DescriptorChannel> channels,
                                     const Encoding& encoding, const Draw& draw) {
  std::vector<Packets> result(channels.size());
  const auto is_empty = [](const auto& list) { return list.empty(); };
  if (draw.clusters < 1 || group.points.empty() || std::ranges::any_of(group.rows, is_empty))
    return result;
  Random random(draw.seed);
  const auto centres = draw_centres(group.points, draw.clusters, random);
  std::vector<std::vector<std::int32_t>> packets(draw.packets);
  for (auto& packet : packets) packet = random.sample(centres.size(), encoding.packet_clusters);
  for (std::size_t c = 0; c < channels.size(); ++c) {
    for (const std::int32_t centre : centres)
      result[c].cluster.push_back(
          nearest_rows(xyz, channels[c], group.rows[c], centre, encoding.cluster_points));
    result[c].packet = packets;
  }
  return result;
}

Rows rows_of_group(const DescriptorChannel& channel, std::span<const std::int32_t> group,
                   std::int32_t which) {
  Rows result;
  for (std::size_t row = 0; row < channel.keypoint.size(); ++row)
    if (group[channel.keypoint[row]] == which) result.push_back(static_cast<std::int32_t>(row));
  return result;
}

void require_same(const char* what, const std::string& have, const std::string& need) {
  if (have != need)
    throw MismatchError(std::string(what) + " made with '" + have + "', the model needs '" + need +
                        "'");
}

void check_channels(const Cloud& cloud, const Descriptors& descriptors,
                    const AppearanceModel& model) {
  if (descriptors.channels.size() != model.channels.size())
    throw MismatchError("there are " + std::to_string(descriptors.channels.size()) +
                        " descriptor channels, the model needs " +
                        std::to_string(model.channels.size()));
  const auto points = static_cast<std::int32_t>(cloud.size());
  for (std::size_t c = 0; c < model.channels.size(); ++c) {
    const DescriptorChannel& have = descriptors.channels[c];
    const AppearanceChannel& need = model.channels[c];
    if (have.name != need.name || have.dimension != need.dimension)
      throw MismatchError("descriptor channel " + std::to_string(c) + " is '" + have.name +
                          "' with " + std::to_string(have.dimension) +
                          " numbers, the model needs '" + need.name + "' with " +
                          std::to_string(need.dimension));
    if (have.value.size() != have.keypoint.size() * have.dimension)
      throw InputError("channel '" + have.name + "': values do not fit keypoints");
    if (std::ranges::any_of(have.keypoint, [=](auto p) { return p < 0 || p >= points; }))
      throw InputError("channel '" + have.name + "': a keypoint is not a point of the cloud");
  }
}

void check_points(const Cloud& cloud) {
  for (std::size_t i = 0; i < cloud.xyz.size(); ++i)
    if (!(std::abs(cloud.xyz[i]) <= NearestNeighbours::kFarthest))
      throw InputError("point " + std::to_string(i / 3) + " is not finite, or too far out");
}

// The tables grow with the product of what different messages hold.
void check_work(const Descriptors& descriptors, const Segments& segments,
                const AppearanceModel& model, const Encoding& encoding, const Params& params) {
  std::size_t stride = 0;
  for (std::size_t c = 0; c < model.channels.size(); ++c) {
    const GaussianMixture& mixture = model.channels[c].mixture;
    const auto components = static_cast<std::size_t>(mixture.components);
    if (descriptors.channels[c].keypoint.size() > kMostNumbers / components)
      throw InputError("channel '" + model.channels[c].name + "' has too many keypoints (" +
                       std::to_string(descriptors.channels[c].keypoint.size()) +
                       ") for a mixture of " + std::to_string(components));
    stride += static_cast<std::size_t>(block_size(mixture, encoding));
  }
  const auto vectors = static_cast<std::size_t>(segments.count) *
                       static_cast<std::size_t>(std::max(params.clusters, params.packets));
  if (vectors > kMostNumbers / stride)
    throw InputError(std::to_string(segments.count) + " segments are too many for vectors of " +
                     std::to_string(stride) + " numbers");
}

// Segment of each point of `cloud`, -1 for a point that stands for none of the dense cloud.
std::vector<std::int32_t> segment_of_points(const Cloud& cloud, const Segments& segments) {
  if (cloud.dense_index.size() != cloud.size())
    throw InputError("the cloud has no indices into the dense cloud");
  std::vector<std::int32_t> result(cloud.size(), -1);
  const auto dense = static_cast<std::int32_t>(segments.of_point.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const std::int32_t point = cloud.dense_index[i];
    if (point == kNoPoint) continue;
    if (point < 0 || point >= dense)
      throw InputError("point " + std::to_string(i) + " stands for dense point " +
                       std::to_string(point) + " of " + std::to_string(dense));
    result[i] = segments.of_point[point];
  }
  return result;
}

// Where each segment finds its points and keypoints.
class SegmentGroups {
 public:
  SegmentGroups(const Cloud& cloud, const Descriptors& descriptors, const Segments& segments)
      : cloud_(cloud), descriptors_(descriptors), segments_(segments) {
    const std::vector<std::int32_t> of_point = segment_of_points(cloud, segments);
    points_.resize(segments.count);
    rows_.assign(descriptors.channels.size(), std::vector<Rows>(segments.count));
    keypoints_.resize(descriptors.channels.size());
    const auto add = [&](std::vector<Rows>& lists, std::int32_t point, std::size_t entry) {
      const std::int32_t segment = of_point[point];
      if (segment < -1 || segment >= segments.count)
        throw InputError("segment " + std::to_string(segment) + " of " +
                         std::to_string(segments.count));
      if (segment >= 0) lists[segment].push_back(static_cast<std::int32_t>(entry));
    };
    for (std::size_t i = 0; i < of_point.size(); ++i) add(points_, static_cast<std::int32_t>(i), i);
    for (std::size_t c = 0; c < rows_.size(); ++c)
      for (std::size_t row = 0; row < descriptors.channels[c].keypoint.size(); ++row)
        add(rows_[c], descriptors.channels[c].keypoint[row], row);
  }

  // A segment too small for a point of its own takes those of its neighbours, or else all; a
  // channel without keypoints in the segment, the keypoints nearest to the points.
  Group of(std::int32_t segment) const {
    Group group{.points = points_[segment]};
    if (group.points.empty()) group.points = neighbouring_points(segment);
    if (group.points.empty()) {
      group.points.resize(cloud_.size());
      std::iota(group.points.begin(), group.points.end(), 0);
    }
    for (std::size_t c = 0; c < rows_.size(); ++c)
      group.rows.push_back(rows_[c][segment].empty() ? nearest_keypoints(c, group.points)
                                                     : rows_[c][segment]);
    return group;
  }

 private:
  std::vector<std::int32_t> neighbouring_points(std::int32_t segment) const {
    std::vector<std::int32_t> result;
    for (const auto& [a, b] : segments_.adjacency)
      if (a == segment || b == segment) {
        const auto& points = points_[a == segment ? b : a];
        result.insert(result.end(), points.begin(), points.end());
      }
    std::ranges::sort(result);
    return result;
  }

  const NearestNeighbours& keypoints_of(std::size_t channel) const {
    auto& tree = keypoints_[channel];
    if (tree) return *tree;
    std::vector<float> xyz;
    for (const std::int32_t point : descriptors_.channels[channel].keypoint)
      for (int axis = 0; axis < 3; ++axis) xyz.push_back(cloud_.xyz[3 * point + axis]);
    return tree.emplace(xyz);
  }

  Rows nearest_keypoints(std::size_t channel, const std::vector<std::int32_t>& points) const {
    const NearestNeighbours& keypoints = keypoints_of(channel);
    Rows result;
    if (keypoints.size() == 0) return result;
    for (const std::int32_t point : points)
      result.push_back(keypoints.nearest_index(&cloud_.xyz[3 * point]));
    std::ranges::sort(result);
    result.erase(std::ranges::unique(result).begin(), result.end());
    return result;
  }

  const Cloud& cloud_;
  const Descriptors& descriptors_;
  const Segments& segments_;
  std::vector<std::vector<std::int32_t>> points_;                    // per segment
  std::vector<std::vector<Rows>> rows_;                              // per channel and segment
  mutable std::vector<std::optional<NearestNeighbours>> keypoints_;  // per channel, once wanted
};

}  // namespace

Fields describe(Encoding& encoding) {
  return {
      choice_field("method", encoding.method, "Fisher vectors or bags of words."),
      choice_field("bow", encoding.bow, "Bags of words: mean posteriors, or eq. (3) as printed."),
      choice_field("pool", encoding.pool,
                   "Average vectors of clusters, or pool all descriptors of a packet."),
      number_field("alpha", encoding.alpha, 0.01, 1.0, "",
                   "Exponent of the power normalisation; 1: none."),
      boolean_field("l2", encoding.l2, "Scale each channel's block to unit length."),
      integer_field("cluster_points", encoding.cluster_points, 1, 10000, "",
                    "Keypoints of a cluster."),
      integer_field("packet_clusters", encoding.packet_clusters, 1, 10000, "",
                    "Clusters of a packet."),
  };
}

Fields describe(Params& params) {
  return {
      integer_field("clusters", params.clusters, 1, 10000, "", "Clusters drawn per segment."),
      integer_field("packets", params.packets, 1, 10000, "", "Packets drawn per segment."),
      seed_field("seed", params.seed, "Seed of the draw."),
  };
}

int block_size(const GaussianMixture& mixture, const Encoding& encoding) {
  return encoding.method == Method::bow ? mixture.components
                                        : 2 * mixture.components * mixture.dimension;
}

std::vector<float> encode(const GaussianMixture& mixture, std::span<const float> samples,
                          const Encoding& encoding) {
  if (samples.empty()) throw InputError("no samples to encode");
  const Encoder encoder(mixture, samples, encoding);
  Rows all(samples.size() / mixture.dimension);
  std::iota(all.begin(), all.end(), 0);
  const std::vector<float> sums = encoder.gather(all);
  const std::vector<float>* parts[] = {&sums};
  const double weights[] = {1.0 / static_cast<double>(all.size())};
  return encoder.combine(parts, weights);
}

std::vector<Packets> draw_packets(std::span<const float> xyz, std::span<const std::int32_t> group,
                                  std::int32_t which, std::span<const DescriptorChannel> channels,
                                  const Encoding& encoding, const Draw& draw) {
  if (xyz.size() != 3 * group.size()) throw InputError("points and their groups do not fit");
  Group members;
  for (std::size_t i = 0; i < group.size(); ++i)
    if (group[i] == which) members.points.push_back(static_cast<std::int32_t>(i));
  for (const DescriptorChannel& channel : channels)
    members.rows.push_back(rows_of_group(channel, group, which));
  return draw_from_group(xyz, members, channels, encoding, draw);
}

void append(Packets& packets, const Packets& more) {
  const auto offset = static_cast<std::int32_t>(packets.cluster.size());
  packets.cluster.insert(packets.cluster.end(), more.cluster.begin(), more.cluster.end());
  for (Rows packet : more.packet) {
    for (std::int32_t& index : packet) index += offset;
    packets.packet.push_back(std::move(packet));
  }
}

std::vector<float> encode_packets(std::span<const Packets> packets,
                                  std::span<const std::vector<float>> projected,
                                  std::span<const AppearanceChannel> channels,
                                  const Encoding& encoding) {
  if (packets.size() != channels.size() || projected.size() != channels.size())
    throw InputError("packets, descriptors and channels differ in number");
  if (channels.empty()) return {};
  const std::size_t count = packets[0].packet.size();
  std::size_t stride = 0;
  for (const AppearanceChannel& channel : channels) stride += block_size(channel.mixture, encoding);
  std::vector<float> result(count * stride);
  std::size_t offset = 0;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    if (packets[c].packet.size() != count)
      throw InputError("channels differ in their number of packets");
    const Encoder encoder(channels[c].mixture, projected[c], encoding);
    std::vector<std::vector<float>> sums;
    for (const Rows& cluster : packets[c].cluster) sums.push_back(encoder.gather(cluster));
    std::vector<const Rows*> clusters;
    std::vector<const std::vector<float>*> parts;
    for (std::size_t p = 0; p < count; ++p) {
      clusters.clear();
      parts.clear();
      for (const std::int32_t index : packets[c].packet[p]) {
        clusters.push_back(&packets[c].cluster[index]);
        parts.push_back(&sums[index]);
      }
      std::vector<float> block = encoder.combine(parts, cluster_weights(clusters, encoding.pool));
      power_normalise(block, encoding.alpha);
      if (encoding.l2) scale_to_unit_length(block);
      float* out = &result[p * stride + offset];
      for (const float z : block) *out++ = z * channels[c].block_scale;
    }
    offset += encoder.size();
  }
  return result;
}

Encodings encode_segments(const Cloud& cloud, const Descriptors& descriptors,
                          const Segments& segments, const AppearanceModel& model,
                          const Params& params) {
  require_same("points were", cloud.recipe, model.cloud_recipe);
  require_same("descriptors were", descriptors.recipe, model.descriptor_recipe);
  check_points(cloud);
  check_channels(cloud, descriptors, model);
  Encoding encoding;
  apply_recipe(describe(encoding), model.encoding_recipe);
  check_work(descriptors, segments, model, encoding, params);

  std::vector<std::vector<float>> projected;
  for (std::size_t c = 0; c < model.channels.size(); ++c)
    projected.push_back(project(model.channels[c].projection, descriptors.channels[c].value));

  Encodings result{.segment_count = segments.count};
  std::vector<Packets> all(model.channels.size());
  const SegmentGroups groups(cloud, descriptors, segments);
  for (std::int32_t segment = 0; segment < segments.count; ++segment) {
    const Draw draw{.clusters = params.clusters,
                    .packets = params.packets,
                    .seed = derive_seed(params.seed, segment)};
    const auto drawn =
        draw_from_group(cloud.xyz, groups.of(segment), descriptors.channels, encoding, draw);
    if (drawn.empty()) continue;
    result.segment.insert(result.segment.end(), drawn[0].packet.size(), segment);
    for (std::size_t c = 0; c < drawn.size(); ++c) append(all[c], drawn[c]);
  }
  result.value = encode_packets(all, projected, model.channels, encoding);
  for (const AppearanceChannel& channel : model.channels)
    result.dimension += block_size(channel.mixture, encoding);
  return result;
}

}  // namespace cosegraph::fisher
