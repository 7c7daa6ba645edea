// Kinds of stages for tests: the ports of a segmentation graph, few parameters of every type.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/error.hpp"
#include "graph/description.hpp"

namespace cosegraph::graph::test {

enum class Mode { exact, greedy };

struct FakeParams {
  bool loop = false;
  int threads = 0;
  std::uint64_t seed = 1;
  double size = 0.04;
  std::string path = "queries";
  Mode mode = Mode::exact;
  std::vector<std::string> channels = {"fpfh:0.08"};
};

// Fresh parameters of all types, called as the members are.
Fields describe(FakeParams& params);

inline StageInfo fake_kind(std::string kind, std::vector<PortInfo> inputs,
                           std::vector<PortInfo> outputs,
                           const std::vector<std::string>& parameters) {
  const auto params = std::make_shared<FakeParams>();
  StageInfo info{.kind = std::move(kind),
                 .inputs = std::move(inputs),
                 .outputs = std::move(outputs),
                 .owner = params};
  info.summary = "The fake " + info.kind + ".";
  for (const auto& field : describe(*params))
    if (std::ranges::find(parameters, field.name) != parameters.end())
      info.parameters.push_back(field);
  return info;
}

inline PortInfo framed(std::string name, std::string type) {
  return {.name = std::move(name), .type = std::move(type), .doc = "One per frame."};
}
inline PortInfo latched(std::string name, std::string type) {
  return {.name = std::move(name), .type = std::move(type), .doc = "The newest.", .latched = true};
}
inline PortInfo optional(PortInfo port) {
  port.optional = true;
  return port;
}

inline Catalog fake_catalog() {
  Catalog catalog;
  const auto add = [&](std::string kind, std::vector<PortInfo> inputs,
                       std::vector<PortInfo> outputs, std::vector<std::string> parameters) {
    catalog[kind] = [=] { return fake_kind(kind, inputs, outputs, parameters); };
  };
  const PortInfo cloud = framed("cloud", "Cloud");
  const PortInfo segments = framed("segments", "Segments");
  const PortInfo spectrum = framed("spectrum", "Spectrum");
  const PortInfo appearance = latched("appearance", "AppearanceModel");
  const PortInfo relation = latched("relation", "RelationModel");
  add("source", {}, {framed("dense", "Cloud"), cloud}, {"path", "loop", "size"});
  add("supervoxels", {cloud}, {framed("supervoxels", "Supervoxels")}, {"size", "seed"});
  add("cpc", {framed("supervoxels", "Supervoxels")}, {segments}, {"threads"});
  add("descriptors", {cloud}, {framed("descriptors", "Descriptors")}, {"channels", "threads"});
  add("spectra", {cloud}, {spectrum}, {});
  add("model", {}, {appearance, relation}, {"path"});
  add("fisher", {cloud, framed("descriptors", "Descriptors"), segments, appearance},
      {framed("encodings", "Encodings")}, {"seed"});
  add("svm", {framed("encodings", "Encodings"), appearance}, {framed("scores", "Scores")}, {});
  add("astar", {framed("scores", "Scores"), segments, optional(spectrum), optional(relation)},
      {framed("labelling", "Labelling")}, {"mode", "threads"});
  add("sink", {cloud, framed("labelling", "Labelling"), optional(segments)}, {}, {"path"});
  add("training", {cloud, framed("descriptors", "Descriptors"), optional(spectrum)},
      {appearance, relation}, {"seed"});
  add("recorder", {optional(cloud), optional(appearance)}, {}, {"path"});
  add("archive", {appearance}, {}, {"path"});
  add("mixer", {cloud, optional(framed("other", "Cloud"))}, {cloud}, {});
  add("tracker", {cloud}, {framed("pose", "Pose")}, {});
  add("calibration", {}, {latched("pose", "Pose")}, {});
  add("aligner", {cloud, latched("pose", "Pose")}, {cloud}, {});
  add("plotter", {framed("pose", "Pose")}, {}, {});
  return catalog;
}

// The whole graph from source to sink.
inline const std::string kSegmentGraph = R"(version: 1
graph: segment
dds: {domain: 7, rate: 80.5, discovery: {peers: [10.0.0.2, rack.local]}}
window: 8
deadline: 2.5
hosts:
  robot: {address: 10.0.0.2}
  rack: {address: rack.local}
stages:
  camera: {use: source, host: robot, params: {path: queries/, loop: true}}
  supervoxels: {use: supervoxels, host: robot, inputs: {cloud: camera/dense}, params: {size: 0.05}}
  cpc: {use: cpc, host: robot, inputs: {supervoxels: supervoxels/supervoxels}}
  features:
    use: descriptors
    host: rack
    inputs: {cloud: camera/cloud}
    params: {channels: [fpfh:0.08, shot:0.13]}
    restart: {policy: on-failure, max: 2}
  spectra: {use: spectra, host: rack, inputs: {cloud: camera/cloud}}
  model: {use: model, host: rack, params: {path: cup.model}}
  fisher:
    use: fisher
    host: rack
    inputs:
      cloud: camera/cloud
      descriptors: features/descriptors
      segments: cpc/segments
      appearance: model/appearance
  svm: {use: svm, inputs: {encodings: fisher/encodings, appearance: model/appearance}}
  astar:
    use: astar
    inputs:
      scores: svm/scores
      segments: cpc/segments
      spectrum: spectra/spectrum
      relation: model/relation
    params: {mode: greedy}
  sink: {use: sink, inputs: {cloud: camera/cloud, labelling: astar/labelling, segments: cpc/segments}}
)";

// Every fault of parsing and checking as "LINE:COLUMN: MESSAGE".
inline std::vector<std::string> lines_of(const std::vector<Fault>& faults) {
  std::vector<std::string> result;
  for (const auto& fault : faults)
    result.push_back(std::to_string(fault.mark.line) + ":" + std::to_string(fault.mark.column) +
                     ": " + fault.message);
  return result;
}

// The graph in `yaml`; throws GraphError if parsing finds a fault.
inline GraphDescription parsed(const std::string& yaml) {
  return parse(yaml, "test.yaml");
}

}  // namespace cosegraph::graph::test

template <>
cosegraph::Names<cosegraph::graph::test::Mode> cosegraph::names<cosegraph::graph::test::Mode>();
