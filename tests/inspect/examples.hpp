// An encoded message of every type that travels.
#pragma once

#include <map>
#include <string>

#include "idl/codec.hpp"

namespace cosegraph::idl::test {

inline const FrameHeader kHeader{.graph = "segment",
                                 .stage = "camera",
                                 .generation = 3,
                                 .source = "camera",
                                 .epoch = 12345678901234ULL,
                                 .sequence = 42,
                                 .stamp = 1'700'000'000'250'000'000,
                                 .model_id = 0xfedcba9876543210ULL,
                                 .name = "mug 1"};

inline Cloud example_cloud() {
  Cloud cloud{.label = {1, kNoLabel, 0, 0},
              .label_names = {"body", "handle"},
              .origin = {0.5F, 0.0F, -1.0F},
              .scale = 0.1F,
              .recipe = "spacing=0.014",
              .notes = {"reduced"},
              .width = 4,
              .height = 1};
  for (int i = 0; i < 12; ++i) cloud.xyz.push_back(static_cast<float>(i));
  return cloud;
}

inline Descriptors example_descriptors() {
  return {
      .recipe = "r",
      .channels = {{.name = "fpfh:0.08", .dimension = 2, .keypoint = {0, 5}, .value = {1, 2, 3, 4}},
                   {.name = "shot:0.13", .dimension = 1, .keypoint = {7}, .value = {9}}}};
}

inline StageStatus example_status() {
  StageStatus status{.kind = "source", .host = "robot", .state = State::working};
  status.ports = {
      {.name = "dense", .topic = "g/s/dense", .output = true, .messages = 3, .bytes = 99},
      {.name = "model", .topic = "g/m/model"}};
  return status;
}

template <class Value>
void add(std::map<std::string, Bytes>& all, const Value& value) {
  all[std::string(type_name<Value>())] = encode(kHeader, value);
}

inline std::map<std::string, Bytes> examples() {
  std::map<std::string, Bytes> all;
  add(all, example_cloud());
  add(all, Supervoxels{.of_point = {0},
                       .centroid = {0, 0, 0},
                       .normal = {0, 0, 1},
                       .point_count = {1},
                       .adjacency = {{0, 0}},
                       .seed_resolution = 1.0F});
  add(all, Segments{.of_supervoxel = {0},
                    .of_point = {0},
                    .count = 1,
                    .adjacency = {{0, 0}},
                    .concavity = {0.5F}});
  add(all, example_descriptors());
  add(all, Encodings{.segment_count = 1, .dimension = 2, .segment = {0, 0}, .value = {1, 2, 3, 4}});
  add(all,
      Scores{.label_names = {"a", "b"}, .segment_count = 2, .probability = {1, 0, 0.25F, 0.75F}});
  add(all, Spectrum{.recipe = "r",
                    .sample = {0, 1},
                    .sample_dense = {0, 1},
                    .eigenvalue = {1, 2, 3},
                    .eigenfunction = {1, 2, 3, 4, 5, 6},
                    .component = {0, 0},
                    .nearest_sample = {0, 1}});
  add(all, Labelling{.label_names = {"a"},
                     .segment_label = {0},
                     .segment_confidence = {1},
                     .point_label = {0},
                     .point_confidence = {1},
                     .energy = -1.5,
                     .proven_optimal = true,
                     .expansions = 1LL << 40});
  AppearanceChannel channel{.name = "fpfh", .dimension = 2, .block_scale = 1.0F};
  add(all, AppearanceModel{.id = 7,
                           .label_names = {"a", "b"},
                           .channels = {channel, channel},
                           .classifier = {.kernel = "linear", .bias = {0.5F, -0.5F}}});
  add(all, RelationModel{.id = 7, .label_names = {"a", "b"}, .neighbours = {1, 0, 0, 1}});
  add(all, StreamEnd{9});
  add(all, FrameFailure{"why"});
  add(all, FrameDone{Outcome::failed, "cpc", "no supervoxels"});
  add(all, example_status());
  add(all, Command{.id = ~0ULL, .verb = "swap", .words = {"a", "bc"}});
  add(all, Reply{.host = "h", .text = "fine"});
  add(all, AgentStatus{.host = "h", .processes = {{.stage = "a"}, {.text = "b"}}});
  add(all, LogLines{.host = "h", .stage = "s", .lines = {"one", "two"}});
  return all;
}

}  // namespace cosegraph::idl::test
