// The channels of a graph, running or recorded.
#pragma once

#include <string>
#include <vector>

#include "tools/monitor/channel.hpp"
#include "tools/monitor/cloud_views.hpp"
#include "tools/monitor/topics.hpp"

namespace cosegraph::monitor {

// The topics, the views of them as point clouds, the state: in this order.
std::vector<Channel> channels_of(const graph::GraphDescription& graph,
                                 const std::vector<Topic>& topics,
                                 const std::vector<CloudView>& views);

// JSON text; see docs/monitor.md.
Channel state_channel(const std::string& name, std::vector<std::string> publishers);

Payload to_payload(std::string_view text);

}  // namespace cosegraph::monitor
