#include "tools/monitor/channels.hpp"

#include "idl/schema.hpp"
#include "tools/monitor/point_cloud.hpp"

namespace cosegraph::monitor {

std::vector<Channel> channels_of(const graph::GraphDescription& graph,
                                 const std::vector<Topic>& topics,
                                 const std::vector<CloudView>& views) {
  std::vector<Channel> channels;
  for (const auto& topic : topics)
    channels.push_back({.topic = topic.name,
                        .encoding = std::string(idl::kMessageEncoding),
                        .schema_name = idl::wire_type(topic.type),
                        .schema = std::string(idl::idl_text(topic.type)),
                        .schema_encoding = std::string(idl::kSchemaEncoding),
                        .publishers = publishers_of(graph, topic),
                        .subscribers = readers_of(graph, topic)});
  for (const auto& view : views)
    channels.push_back({.topic = view.topic + "/points",
                        .encoding = std::string(idl::kMessageEncoding),
                        .schema_name = std::string(kPointCloudSchemaName),
                        .schema = std::string(kPointCloudSchema),
                        .schema_encoding = std::string(idl::kSchemaEncoding),
                        .publishers = {"monitor"}});
  channels.push_back(state_channel(graph.graph, {"monitor"}));
  return channels;
}

Channel state_channel(const std::string& name, std::vector<std::string> publishers) {
  return {.topic = name + "/monitor",
          .encoding = "json",
          .schema_name = "cosegraph.Monitor",
          .schema = R"({"type":"object"})",
          .schema_encoding = "jsonschema",
          .publishers = std::move(publishers)};
}

Payload to_payload(std::string_view text) {
  return std::make_shared<const idl::Bytes>(text.begin(), text.end());
}

}  // namespace cosegraph::monitor
