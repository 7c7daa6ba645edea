// What makes a Fast DDS participant a secure one.
#pragma once

#include "graph/security.hpp"

namespace eprosima::fastdds::dds {
class DomainParticipantQos;
}

namespace cosegraph::graph {

// Expects the transports to be set already.
void set_security(const KeyFiles& files, eprosima::fastdds::dds::DomainParticipantQos& qos);

}  // namespace cosegraph::graph
