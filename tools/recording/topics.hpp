// The topics of a graph, as a recording keeps them.
#pragma once

#include <string>
#include <vector>

#include "graph/dds.hpp"
#include "graph/description.hpp"
#include "tools/recording/mcap.hpp"

namespace cosegraph::recording {

struct Topic {
  std::string name;   // "GRAPH/STAGE/PORT", or "GRAPH/frame_done" and the like
  std::string type;   // "Cloud"
  std::string stage;  // that publishes; empty: all of them (control topics)
  bool latched = false;
  bool taken = false;  // a stage of the graph reads it
  // Stages that can fail a frame before it gets here, the publishing one included.
  std::vector<std::string> upstream;

  bool is_control() const { return stage.empty(); }
  std::string port() const { return is_control() ? "" : name.substr(name.rfind('/') + 1); }
  // One message per frame, by one stage.
  bool has_frames() const { return !is_control() && !latched; }
  bool operator==(const Topic&) const = default;
};

// What all stages publish, in their order, then the control topics.
std::vector<Topic> topics_of(const graph::GraphDescription& graph, const graph::Catalog& catalog);

// Those whose name contains one of `wanted` (all, if there is none), and the control topics, which
// tell what happened to the frames. Throws ParameterError for a word that no name contains.
std::vector<Topic> choose(std::vector<Topic> topics, const std::vector<std::string>& wanted);

// How the runtime's writers and readers of a topic are set up.
graph::EndpointQos qos_of(const Topic& topic, const graph::GraphDescription& graph);

// A topic as a channel's metadata, and back. Who has only the file can so tell what is missing.
Texts to_metadata(const Topic& topic);
// Throws InputError if the channel was not made by to_metadata.
Topic topic_of(const Channel& channel, const Schema& schema);

}  // namespace cosegraph::recording
