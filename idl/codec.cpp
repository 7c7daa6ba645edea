#include "idl/codec.hpp"

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastcdr/exceptions/Exception.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "coseg_cloud.h"
#include "coseg_control.h"
#include "coseg_descriptors.h"
#include "coseg_frame.h"
#include "coseg_labels.h"
#include "coseg_model.h"
#include "coseg_segments.h"
#include "idl/layout.hpp"
#include "idl/sparse.hpp"
#include "model/model.hpp"

template <>
cosegraph::Names<cosegraph::idl::Outcome> cosegraph::names<cosegraph::idl::Outcome>() {
  using enum idl::Outcome;
  static constexpr std::pair<idl::Outcome, std::string_view> kTable[] = {
      {labelled, "labelled"}, {consumed, "consumed"}, {failed, "failed"}, {ended, "ended"}};
  return kTable;
}

template <>
cosegraph::Names<cosegraph::idl::State> cosegraph::names<cosegraph::idl::State>() {
  using enum idl::State;
  static constexpr std::pair<idl::State, std::string_view> kTable[] = {
      {starting, "starting"},     {standby, "standby"}, {waiting, "waiting"},
      {working, "working"},       {drained, "drained"}, {finished, "finished"},
      {restarting, "restarting"}, {failed, "failed"},   {stopped, "stopped"}};
  return kTable;
}

template <>
cosegraph::Names<cosegraph::idl::ReplyState> cosegraph::names<cosegraph::idl::ReplyState>() {
  using enum idl::ReplyState;
  static constexpr std::pair<idl::ReplyState, std::string_view> kTable[] = {
      {accepted, "accepted"}, {progress, "progress"}, {done, "done"}, {refused, "refused"}};
  return kTable;
}

template <>
cosegraph::Names<cosegraph::idl::ProcessState> cosegraph::names<cosegraph::idl::ProcessState>() {
  using enum idl::ProcessState;
  static constexpr std::pair<idl::ProcessState, std::string_view> kTable[] = {
      {running, "running"}, {restarting, "restarting"}, {stopped, "stopped"}, {failed, "failed"}};
  return kTable;
}

namespace cosegraph::idl {
namespace {

using Pairs = std::vector<std::array<std::int32_t, 2>>;

void require(bool fine, const char* what) {
  if (!fine) throw InputError(what);
}

// Every index in `values` lies in low .. size-1.
void require_indices(const std::vector<std::int32_t>& values, std::size_t size, const char* what,
                     std::int32_t low = 0) {
  const auto end = static_cast<std::int64_t>(size);
  require(std::ranges::all_of(values, [&](std::int32_t i) { return i >= low && i < end; }), what);
}

std::vector<std::int32_t> flatten(const Pairs& pairs) {
  std::vector<std::int32_t> flat;
  flat.reserve(2 * pairs.size());
  for (const auto& [a, b] : pairs) flat.insert(flat.end(), {a, b});
  return flat;
}

Pairs unflatten(const std::vector<std::int32_t>& flat, std::size_t size) {
  require(flat.size() % 2 == 0, "adjacency is not a list of pairs");
  require_indices(flat, size, "adjacency names an index that does not exist");
  Pairs pairs(flat.size() / 2);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    pairs[i] = {flat[2 * i], flat[2 * i + 1]};
    require(pairs[i][0] < pairs[i][1] && (i == 0 || pairs[i - 1] < pairs[i]),
            "adjacency is not a sorted list of different pairs a < b");
  }
  return pairs;
}

bool all_finite(const std::vector<float>& values) {
  return std::ranges::all_of(values, [](float x) { return std::isfinite(x); });
}

// Finite, and large enough that 1 / x is finite too.
bool is_positive(float x) {
  return std::isnormal(x) && x > 0.0F;
}

void require_segment_count(std::int32_t count) {
  require(count >= 0, "the number of segments is negative");
  require(count <= kMostSegments, "there are too many segments");
}

// -- header --------------------------------------------------------------------------------------

msg::FrameHeader to_message(const FrameHeader& header) {
  msg::FrameHeader message;
  message.graph(header.graph);
  message.stage(header.stage);
  message.generation(header.generation);
  message.source(header.source);
  message.epoch(header.epoch);
  message.sequence_number(header.sequence);
  message.stamp(header.stamp);
  message.model_id(header.model_id);
  message.name(header.name);
  return message;
}

FrameHeader to_header(const msg::FrameHeader& message) {
  return {.graph = message.graph(),
          .stage = message.stage(),
          .generation = message.generation(),
          .source = message.source(),
          .epoch = message.epoch(),
          .sequence = message.sequence_number(),
          .stamp = message.stamp(),
          .model_id = message.model_id(),
          .name = message.name()};
}

// -- values --------------------------------------------------------------------------------------
// For each type: its message with the layout of what follows the header (see layout.hpp),
// fill(message, value) and take(message) -> value.

template <class Value>
struct MessageOf;

template <>
struct MessageOf<Cloud> {
  using Type = msg::Cloud;
  static constexpr std::string_view kLayout = "ffffS4444sfS44s8";
};

void fill(msg::Cloud& message, const Cloud& value) {
  message.xyz(value.xyz);
  message.normal(value.normal);
  message.rgb(value.rgb);
  message.label(value.label);
  message.label_names(value.label_names);
  message.origin(value.origin);
  message.scale(value.scale);
  message.recipe(value.recipe);
  message.dense_index(value.dense_index);
  message.notes(value.notes);
  message.width(value.width);
  message.height(value.height);
  message.frame_id(value.frame_id);
  message.stamp(value.stamp);
}

Cloud take(msg::Cloud& message) {
  Cloud value{.xyz = std::move(message.xyz()),
              .normal = std::move(message.normal()),
              .rgb = std::move(message.rgb()),
              .label = std::move(message.label()),
              .label_names = std::move(message.label_names()),
              .origin = message.origin(),
              .scale = message.scale(),
              .recipe = std::move(message.recipe()),
              .dense_index = std::move(message.dense_index()),
              .notes = std::move(message.notes()),
              .width = message.width(),
              .height = message.height(),
              .frame_id = std::move(message.frame_id()),
              .stamp = message.stamp()};
  check_sizes(value);
  require(is_positive(value.scale), "scale is not positive");
  require(std::ranges::all_of(value.dense_index, [](std::int32_t i) { return i >= kNoPoint; }),
          "dense_index is negative");
  return value;
}

template <>
struct MessageOf<Supervoxels> {
  using Type = msg::Supervoxels;
  static constexpr std::string_view kLayout = "fffff4";
};

void fill(msg::Supervoxels& message, const Supervoxels& value) {
  message.of_point(value.of_point);
  message.centroid(value.centroid);
  message.normal(value.normal);
  message.point_count(value.point_count);
  message.adjacency(flatten(value.adjacency));
  message.seed_resolution(value.seed_resolution);
}

Supervoxels take(msg::Supervoxels& message) {
  Supervoxels value{.of_point = std::move(message.of_point()),
                    .centroid = std::move(message.centroid()),
                    .normal = std::move(message.normal()),
                    .point_count = std::move(message.point_count()),
                    .seed_resolution = message.seed_resolution()};
  require(is_positive(value.seed_resolution), "the distance of the seeds is not positive");
  require(value.centroid.size() % 3 == 0 && value.normal.size() == value.centroid.size() &&
              value.point_count.size() == value.count(),
          "centroids, normals and point counts do not fit together");
  require_indices(value.of_point, value.count(), "a point names a supervoxel that does not exist");
  value.adjacency = unflatten(message.adjacency(), value.count());
  return value;
}

template <>
struct MessageOf<Segments> {
  using Type = msg::Segments;
  static constexpr std::string_view kLayout = "ff4ff";
};

void fill(msg::Segments& message, const Segments& value) {
  message.of_supervoxel(value.of_supervoxel);
  message.of_point(value.of_point);
  message.count(value.count);
  message.adjacency(flatten(value.adjacency));
  message.concavity(value.concavity);
}

Segments take(msg::Segments& message) {
  Segments value{.of_supervoxel = std::move(message.of_supervoxel()),
                 .of_point = std::move(message.of_point()),
                 .count = message.count(),
                 .concavity = std::move(message.concavity())};
  require_segment_count(value.count);
  const auto count = static_cast<std::size_t>(value.count);
  require(count <= value.of_supervoxel.size(), "there are more segments than supervoxels");
  require_indices(value.of_supervoxel, count, "a supervoxel names a segment that does not exist");
  require_indices(value.of_point, count, "a point names a segment that does not exist");
  value.adjacency = unflatten(message.adjacency(), count);
  require(value.concavity.size() == value.adjacency.size(), "concavity does not fit adjacency");
  return value;
}

template <>
struct MessageOf<Descriptors> {
  using Type = msg::Descriptors;
  static constexpr std::string_view kLayout = "s[s4fff]";
};

void fill(msg::Descriptors& message, const Descriptors& value) {
  message.recipe(value.recipe);
  for (const auto& channel : value.channels) {
    msg::DescriptorChannel& out = message.channels().emplace_back();
    out.name(channel.name);
    out.dimension(channel.dimension);
    out.keypoint(channel.keypoint);
    pack(channel.value, out.present(), out.values());
  }
}

Descriptors take(msg::Descriptors& message) {
  Descriptors value{.recipe = std::move(message.recipe())};
  Unpacker unpacker;
  for (auto& channel : message.channels()) {
    require(channel.dimension() > 0, "a channel has no dimension");
    auto numbers = unpacker.unpack(channel.present(), channel.values());
    require(
        numbers.size() == channel.keypoint().size() * static_cast<std::size_t>(channel.dimension()),
        "a channel's values do not fit its keypoints");
    require(std::ranges::all_of(channel.keypoint(), [](std::int32_t i) { return i >= 0; }),
            "a keypoint is negative");
    require(all_finite(channel.values()), "a descriptor is not finite");
    value.channels.push_back({.name = std::move(channel.name()),
                              .dimension = channel.dimension(),
                              .keypoint = std::move(channel.keypoint()),
                              .value = std::move(numbers)});
  }
  return value;
}

template <>
struct MessageOf<Spectrum> {
  using Type = msg::Spectrum;
  static constexpr std::string_view kLayout = "sffffff";
};

void fill(msg::Spectrum& message, const Spectrum& value) {
  message.recipe(value.recipe);
  message.sample_index(value.sample);
  message.sample_dense(value.sample_dense);
  message.eigenvalue(value.eigenvalue);
  message.eigenfunction(value.eigenfunction);
  message.piece(value.component);
  message.nearest_sample(value.nearest_sample);
}

Spectrum take(msg::Spectrum& message) {
  Spectrum value{.recipe = std::move(message.recipe()),
                 .sample = std::move(message.sample_index()),
                 .sample_dense = std::move(message.sample_dense()),
                 .eigenvalue = std::move(message.eigenvalue()),
                 .eigenfunction = std::move(message.eigenfunction()),
                 .component = std::move(message.piece()),
                 .nearest_sample = std::move(message.nearest_sample())};
  const std::size_t samples = value.sample.size();
  require(value.sample_dense.size() == samples && value.component.size() == samples &&
              value.eigenfunction.size() == samples * value.eigenvalue.size(),
          "samples, pieces and eigenfunctions do not fit together");
  require_indices(value.nearest_sample, samples, "a point names a sample that does not exist");
  require_indices(value.sample, value.nearest_sample.size(), "a sample is not a point");
  require(std::ranges::all_of(value.eigenvalue, is_positive), "an eigenvalue is not positive");
  require(all_finite(value.eigenfunction), "an eigenfunction is not finite");
  return value;
}

template <>
struct MessageOf<Encodings> {
  using Type = msg::Encodings;
  static constexpr std::string_view kLayout = "44fff";
};

void fill(msg::Encodings& message, const Encodings& value) {
  message.segment_count(value.segment_count);
  message.dimension(value.dimension);
  message.segment(value.segment);
  pack(value.value, message.present(), message.values());
}

Encodings take(msg::Encodings& message) {
  Encodings value{.segment_count = message.segment_count(),
                  .dimension = message.dimension(),
                  .segment = std::move(message.segment())};
  require_segment_count(value.segment_count);
  require(value.dimension > 0, "the vectors have no dimension");
  require_indices(value.segment, static_cast<std::size_t>(value.segment_count),
                  "a packet names a segment that does not exist");
  require(all_finite(message.values()), "a vector is not finite");
  value.value = Unpacker().unpack(message.present(), message.values());
  require(value.value.size() == value.segment.size() * static_cast<std::size_t>(value.dimension),
          "values do not fit packets");
  return value;
}

// Sizes shared by Scores and Labelling.
void require_labels(const std::vector<std::string>& names, std::int32_t majority) {
  require(!names.empty(), "there are no label names");
  require(majority >= 0 && majority < static_cast<std::int32_t>(names.size()),
          "the majority label has no name");
}

template <>
struct MessageOf<Scores> {
  using Type = msg::Scores;
  static constexpr std::string_view kLayout = "S44f";
};

void fill(msg::Scores& message, const Scores& value) {
  message.label_names(value.label_names);
  message.majority(value.majority);
  message.segment_count(value.segment_count);
  message.probability(value.probability);
}

Scores take(msg::Scores& message) {
  Scores value{.label_names = std::move(message.label_names()),
               .majority = message.majority(),
               .segment_count = message.segment_count(),
               .probability = std::move(message.probability())};
  require_labels(value.label_names, value.majority);
  require_segment_count(value.segment_count);
  require(value.probability.size() ==
              static_cast<std::size_t>(value.segment_count) * value.label_names.size(),
          "probabilities do not fit segments and labels");
  require(std::ranges::all_of(value.probability, [](float p) { return p >= 0.0F && p <= 1.0F; }),
          "a probability is outside 0 .. 1");
  return value;
}

template <>
struct MessageOf<Labelling> {
  using Type = msg::Labelling;
  static constexpr std::string_view kLayout = "S4ffff81848";
};

void fill(msg::Labelling& message, const Labelling& value) {
  message.label_names(value.label_names);
  message.majority(value.majority);
  message.segment_label(value.segment_label);
  message.segment_confidence(value.segment_confidence);
  message.point_label(value.point_label);
  message.point_confidence(value.point_confidence);
  message.energy(value.energy);
  message.proven_optimal(value.proven_optimal);
  message.gap(value.gap);
  message.violations(value.violations);
  message.expansions(value.expansions);
}

Labelling take(msg::Labelling& message) {
  Labelling value{.label_names = std::move(message.label_names()),
                  .majority = message.majority(),
                  .segment_label = std::move(message.segment_label()),
                  .segment_confidence = std::move(message.segment_confidence()),
                  .point_label = std::move(message.point_label()),
                  .point_confidence = std::move(message.point_confidence()),
                  .energy = message.energy(),
                  .proven_optimal = message.proven_optimal(),
                  .gap = message.gap(),
                  .violations = message.violations(),
                  .expansions = message.expansions()};
  require_labels(value.label_names, value.majority);
  const std::size_t labels = value.label_names.size();
  require_indices(value.segment_label, labels, "a segment's label has no name");
  require_indices(value.point_label, labels, "a point's label has no name", kNoLabel);
  require(value.segment_confidence.size() == value.segment_label.size() &&
              value.point_confidence.size() == value.point_label.size(),
          "confidences do not fit labels");
  return value;
}

template <>
struct MessageOf<AppearanceModel> {
  using Type = msg::AppearanceModel;
  static constexpr std::string_view kLayout = "8Sfsss[s44ff44fff4]s4ffff88";
};

void fill(msg::AppearanceModel& message, const AppearanceModel& value) {
  message.id(value.id);
  message.label_names(value.label_names);
  message.label_share(value.label_share);
  message.cloud_recipe(value.cloud_recipe);
  message.descriptor_recipe(value.descriptor_recipe);
  message.encoding_recipe(value.encoding_recipe);
  for (const auto& channel : value.channels) {
    msg::AppearanceChannel& out = message.channels().emplace_back();
    out.name(channel.name);
    out.dimension(channel.dimension);
    out.projection_output(channel.projection.output);
    out.projection_mean(channel.projection.mean);
    out.projection_basis(channel.projection.basis);
    out.mixture_components(channel.mixture.components);
    out.mixture_dimension(channel.mixture.dimension);
    out.mixture_weight(channel.mixture.weight);
    out.mixture_mean(channel.mixture.mean);
    out.mixture_sigma(channel.mixture.sigma);
    out.block_scale(channel.block_scale);
  }
  const Classifier& classifier = value.classifier;
  message.kernel(classifier.kernel);
  message.classifier_dimension(classifier.dimension);
  message.weight(classifier.weight);
  message.support(classifier.support);
  message.coefficient(classifier.coefficient);
  message.bias(classifier.bias);
  message.gamma(classifier.gamma);
  message.sharpness(classifier.sharpness);
}

AppearanceModel take(msg::AppearanceModel& message) {
  AppearanceModel value{.id = message.id(),
                        .label_names = std::move(message.label_names()),
                        .label_share = std::move(message.label_share()),
                        .cloud_recipe = std::move(message.cloud_recipe()),
                        .descriptor_recipe = std::move(message.descriptor_recipe()),
                        .encoding_recipe = std::move(message.encoding_recipe())};
  for (auto& channel : message.channels()) {
    AppearanceChannel& out = value.channels.emplace_back();
    out.name = std::move(channel.name());
    out.dimension = channel.dimension();
    out.projection = {.input = channel.projection_output() > 0 ? channel.dimension() : 0,
                      .output = channel.projection_output(),
                      .mean = std::move(channel.projection_mean()),
                      .basis = std::move(channel.projection_basis())};
    out.mixture = {.components = channel.mixture_components(),
                   .dimension = channel.mixture_dimension(),
                   .weight = std::move(channel.mixture_weight()),
                   .mean = std::move(channel.mixture_mean()),
                   .sigma = std::move(channel.mixture_sigma())};
    out.block_scale = channel.block_scale();
  }
  value.classifier = {.kernel = std::move(message.kernel()),
                      .dimension = message.classifier_dimension(),
                      .label_count = static_cast<std::int32_t>(value.label_names.size()),
                      .weight = std::move(message.weight()),
                      .support = std::move(message.support()),
                      .coefficient = std::move(message.coefficient()),
                      .bias = std::move(message.bias()),
                      .gamma = message.gamma(),
                      .sharpness = message.sharpness()};
  model::check(value);
  return value;
}

template <>
struct MessageOf<RelationModel> {
  using Type = msg::RelationModel;
  static constexpr std::string_view kLayout = "8Ssffffb";
};

void fill(msg::RelationModel& message, const RelationModel& value) {
  message.id(value.id);
  message.label_names(value.label_names);
  message.spectrum_recipe(value.spectrum_recipe);
  if (!value.pairs.empty()) message.offset().push_back(0);
  for (const auto& pair : value.pairs) {
    message.weight().insert(message.weight().end(), pair.weight.begin(), pair.weight.end());
    message.mean().insert(message.mean().end(), pair.mean.begin(), pair.mean.end());
    message.sigma().insert(message.sigma().end(), pair.sigma.begin(), pair.sigma.end());
    message.offset().push_back(static_cast<std::int32_t>(message.weight().size()));
  }
  message.neighbours(value.neighbours);
}

RelationModel take(msg::RelationModel& message) {
  RelationModel value{.id = message.id(),
                      .label_names = std::move(message.label_names()),
                      .spectrum_recipe = std::move(message.spectrum_recipe()),
                      .neighbours = std::move(message.neighbours())};
  const auto& offset = message.offset();
  const std::size_t total = message.weight().size();
  require(message.mean().size() == total && message.sigma().size() == total,
          "mixtures do not fit together");
  require(offset.empty() || (offset.front() == 0 && std::ranges::is_sorted(offset) &&
                             static_cast<std::size_t>(offset.back()) == total),
          "offsets of the mixtures are not in order");
  const auto slice = [&](const std::vector<float>& all, std::size_t pair) {
    return std::vector<float>(all.begin() + offset[pair], all.begin() + offset[pair + 1]);
  };
  for (std::size_t p = 0; p + 1 < offset.size(); ++p)
    value.pairs.push_back({.weight = slice(message.weight(), p),
                           .mean = slice(message.mean(), p),
                           .sigma = slice(message.sigma(), p)});
  model::check(value);
  return value;
}

template <>
struct MessageOf<StreamEnd> {
  using Type = msg::StreamEnd;
  static constexpr std::string_view kLayout = "8";
};

void fill(msg::StreamEnd& message, const StreamEnd& value) {
  message.count(value.count);
}

StreamEnd take(msg::StreamEnd& message) {
  return {.count = message.count()};
}

template <>
struct MessageOf<FrameFailure> {
  using Type = msg::FrameFailure;
  static constexpr std::string_view kLayout = "s";
};

void fill(msg::FrameFailure& message, const FrameFailure& value) {
  message.reason(value.reason);
}

FrameFailure take(msg::FrameFailure& message) {
  return {.reason = std::move(message.reason())};
}

template <>
struct MessageOf<FrameDone> {
  using Type = msg::FrameDone;
  static constexpr std::string_view kLayout = "sss";
};

void fill(msg::FrameDone& message, const FrameDone& value) {
  message.outcome(std::string(to_name(value.outcome)));
  message.failed_stage(value.failed_stage);
  message.reason(value.reason);
}

FrameDone take(msg::FrameDone& message) {
  return {.outcome = from_name<Outcome>(message.outcome()),
          .failed_stage = std::move(message.failed_stage()),
          .reason = std::move(message.reason())};
}

template <>
struct MessageOf<StageStatus> {
  using Type = msg::StageStatus;
  static constexpr std::string_view kLayout = "ss441sss888888888888888888[ss188]";
};

void fill(msg::StageStatus& message, const StageStatus& value) {
  message.kind(value.kind);
  message.host(value.host);
  message.pid(value.pid);
  message.replica(value.replica);
  message.candidate(value.candidate);
  message.state(std::string(to_name(value.state)));
  message.activity(value.activity);
  message.recipe(value.recipe);
  message.progress(value.progress);
  message.frames_in(value.frames_in);
  message.frames_out(value.frames_out);
  message.frames_failed(value.frames_failed);
  message.repeated(value.repeated);
  message.queue(value.queue);
  message.next(value.next);
  message.latency_median(value.latency_median);
  message.latency_p99(value.latency_p99);
  message.latency_sum(value.latency_sum);
  message.cpu_seconds(value.cpu_seconds);
  message.memory(value.memory);
  message.admitted(value.account.admitted);
  message.labelled(value.account.labelled);
  message.consumed(value.account.consumed);
  message.failed(value.account.failed);
  message.dropped(value.account.dropped);
  message.settled(value.settled);
  for (const auto& port : value.ports) {
    msg::PortTraffic& out = message.ports().emplace_back();
    out.name(port.name);
    out.topic(port.topic);
    out.output(port.output);
    out.messages(port.messages);
    out.bytes(port.bytes);
  }
}

StageStatus take(msg::StageStatus& message) {
  StageStatus value{.kind = std::move(message.kind()),
                    .host = std::move(message.host()),
                    .pid = message.pid(),
                    .replica = message.replica(),
                    .candidate = message.candidate(),
                    .state = from_name<State>(message.state()),
                    .activity = std::move(message.activity()),
                    .recipe = std::move(message.recipe()),
                    .progress = message.progress(),
                    .frames_in = message.frames_in(),
                    .frames_out = message.frames_out(),
                    .frames_failed = message.frames_failed(),
                    .repeated = message.repeated(),
                    .queue = message.queue(),
                    .next = message.next(),
                    .latency_median = message.latency_median(),
                    .latency_p99 = message.latency_p99(),
                    .latency_sum = message.latency_sum(),
                    .cpu_seconds = message.cpu_seconds(),
                    .memory = message.memory(),
                    .account = {.admitted = message.admitted(),
                                .labelled = message.labelled(),
                                .consumed = message.consumed(),
                                .failed = message.failed(),
                                .dropped = message.dropped()},
                    .settled = message.settled()};
  for (auto& port : message.ports())
    value.ports.push_back({.name = std::move(port.name()),
                           .topic = std::move(port.topic()),
                           .output = port.output(),
                           .messages = port.messages(),
                           .bytes = port.bytes()});
  return value;
}

template <>
struct MessageOf<Command> {
  using Type = msg::Command;
  static constexpr std::string_view kLayout = "8ss4sS";
};

void fill(msg::Command& message, const Command& value) {
  message.id(value.id);
  message.host(value.host);
  message.stage(value.stage);
  message.generation(value.generation);
  message.verb(value.verb);
  message.words(value.words);
}

Command take(msg::Command& message) {
  return {.id = message.id(),
          .host = std::move(message.host()),
          .stage = std::move(message.stage()),
          .generation = message.generation(),
          .verb = std::move(message.verb()),
          .words = std::move(message.words())};
}

template <>
struct MessageOf<Reply> {
  using Type = msg::Reply;
  static constexpr std::string_view kLayout = "8sss";
};

void fill(msg::Reply& message, const Reply& value) {
  message.id(value.id);
  message.host(value.host);
  message.state(std::string(to_name(value.state)));
  message.text(value.text);
}

Reply take(msg::Reply& message) {
  return {.id = message.id(),
          .host = std::move(message.host()),
          .state = from_name<ReplyState>(message.state()),
          .text = std::move(message.text())};
}

template <>
struct MessageOf<AgentStatus> {
  using Type = msg::AgentStatus;
  static constexpr std::string_view kLayout = "ss4[s4441s4s]s4";
};

void fill(msg::AgentStatus& message, const AgentStatus& value) {
  message.host(value.host);
  message.address(value.address);
  message.pid(value.pid);
  message.swapping(value.swapping);
  message.newcomer(value.newcomer);
  for (const auto& process : value.processes) {
    msg::AgentProcess& out = message.processes().emplace_back();
    out.stage(process.stage);
    out.replica(process.replica);
    out.generation(process.generation);
    out.pid(process.pid);
    out.candidate(process.candidate);
    out.state(std::string(to_name(process.state)));
    out.restarts(process.restarts);
    out.text(process.text);
  }
}

AgentStatus take(msg::AgentStatus& message) {
  AgentStatus value{.host = std::move(message.host()),
                    .address = std::move(message.address()),
                    .pid = message.pid(),
                    .swapping = std::move(message.swapping()),
                    .newcomer = message.newcomer()};
  for (auto& process : message.processes())
    value.processes.push_back({.stage = std::move(process.stage()),
                               .replica = process.replica(),
                               .generation = process.generation(),
                               .pid = process.pid(),
                               .candidate = process.candidate(),
                               .state = from_name<ProcessState>(process.state()),
                               .restarts = process.restarts(),
                               .text = std::move(process.text())});
  return value;
}

template <>
struct MessageOf<LogLines> {
  using Type = msg::LogLines;
  static constexpr std::string_view kLayout = "ss4S";
};

void fill(msg::LogLines& message, const LogLines& value) {
  message.host(value.host);
  message.stage(value.stage);
  message.replica(value.replica);
  message.lines(value.lines);
}

LogLines take(msg::LogLines& message) {
  return {.host = std::move(message.host()),
          .stage = std::move(message.stage()),
          .replica = message.replica(),
          .lines = std::move(message.lines())};
}

// -- CDR -----------------------------------------------------------------------------------------

constexpr std::size_t kEncapsulation = 4;  // bytes before the body
constexpr std::string_view kHeaderLayout = "ss4s8888s";

template <class Message>
Bytes serialise(const Message& message) {
  Bytes bytes(Message::getCdrSerializedSize(message) + kEncapsulation);
  eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(bytes.data()), bytes.size());
  eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN,
                             eprosima::fastcdr::Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  message.serialize(cdr);
  bytes.resize(cdr.getSerializedDataLength());
  return bytes;
}

template <class Message>
Message deserialise(std::span<const std::uint8_t> bytes, std::string_view type,
                    std::string_view layout) {
  if (!fits_layout(bytes, std::string(kHeaderLayout) + std::string(layout)))
    throw InputError(std::string(type) + " message is truncated or claims an impossible length");
  // FastBuffer wants a mutable pointer; reading does not change it.
  auto* data = const_cast<char*>(reinterpret_cast<const char*>(bytes.data()));
  eprosima::fastcdr::FastBuffer buffer(data, bytes.size());
  eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN,
                             eprosima::fastcdr::Cdr::DDS_CDR);
  try {
    Message message;
    cdr.read_encapsulation();
    message.deserialize(cdr);
    return message;
  } catch (const eprosima::fastcdr::exception::Exception& error) {
    throw InputError(std::string(type) + " message cannot be read: " + error.what());
  }
}

}  // namespace

std::string wire_type(std::string_view name) {
  return "cosegraph::msg::" + std::string(name);
}

template <class Value>
Bytes encode(const FrameHeader& header, const Value& value) {
  typename MessageOf<Value>::Type message;
  message.header(to_message(header));
  fill(message, value);
  return serialise(message);
}

template <class Value>
Value decode(std::span<const std::uint8_t> bytes) {
  auto message = deserialise<typename MessageOf<Value>::Type>(bytes, type_name<Value>(),
                                                              MessageOf<Value>::kLayout);
  try {
    return take(message);
  } catch (const Error& error) {
    throw InputError(std::string(type_name<Value>()) + " message: " + error.what());
  }
}

FrameHeader decode_header(std::span<const std::uint8_t> bytes) {
  return to_header(deserialise<msg::FrameHeader>(bytes, "FrameHeader", ""));
}

void set_epoch(std::span<std::uint8_t> bytes, std::uint64_t epoch) {
  FrameHeader header = decode_header(bytes);
  header.epoch = epoch;
  eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(bytes.data()), bytes.size());
  eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN,
                             eprosima::fastcdr::Cdr::DDS_CDR);
  cdr.read_encapsulation();  // and takes on its byte order
  to_message(header).serialize(cdr);
}

#define COSEGRAPH_TRAVELS(Value)                           \
  template <>                                              \
  std::string_view type_name<Value>() {                    \
    return #Value;                                         \
  }                                                        \
  template Bytes encode(const FrameHeader&, const Value&); \
  template Value decode(std::span<const std::uint8_t>);

COSEGRAPH_TRAVELS(Cloud)
COSEGRAPH_TRAVELS(Supervoxels)
COSEGRAPH_TRAVELS(Segments)
COSEGRAPH_TRAVELS(Descriptors)
COSEGRAPH_TRAVELS(Encodings)
COSEGRAPH_TRAVELS(Scores)
COSEGRAPH_TRAVELS(Spectrum)
COSEGRAPH_TRAVELS(Labelling)
COSEGRAPH_TRAVELS(AppearanceModel)
COSEGRAPH_TRAVELS(RelationModel)
COSEGRAPH_TRAVELS(StreamEnd)
COSEGRAPH_TRAVELS(FrameFailure)
COSEGRAPH_TRAVELS(FrameDone)
COSEGRAPH_TRAVELS(StageStatus)
COSEGRAPH_TRAVELS(Command)
COSEGRAPH_TRAVELS(Reply)
COSEGRAPH_TRAVELS(AgentStatus)
COSEGRAPH_TRAVELS(LogLines)

#undef COSEGRAPH_TRAVELS

namespace {

template <class... Values>
bool check_any(std::string_view type, std::span<const std::uint8_t> bytes) {
  return ((type_name<Values>() == type && (decode<Values>(bytes), true)) || ...);
}

}  // namespace

void check(std::string_view type, std::span<const std::uint8_t> bytes) {
  if (!check_any<Cloud, Supervoxels, Segments, Descriptors, Encodings, Scores, Spectrum, Labelling,
                 AppearanceModel, RelationModel, StreamEnd, FrameFailure, FrameDone, StageStatus,
                 Command, Reply, AgentStatus, LogLines>(type, bytes))
    throw InputError("there is no message type '" + std::string(type) + "'");
}

std::span<const std::string_view> type_names() {
  static constexpr std::string_view kNames[] = {
      "Cloud",     "Supervoxels", "Segments",        "Descriptors",   "Encodings",   "Scores",
      "Spectrum",  "Labelling",   "AppearanceModel", "RelationModel", "StreamEnd",   "FrameFailure",
      "FrameDone", "StageStatus", "Command",         "Reply",         "AgentStatus", "LogLines"};
  return kNames;
}

}  // namespace cosegraph::idl
