#include "graph/dds_security.hpp"

#include <fastdds/rtps/network/SenderResource.h>
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/ChainingTransportDescriptor.h>

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <memory>
#include <mutex>

namespace cosegraph::graph {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
namespace transport = eprosima::fastdds::rtps;

struct OneByOneDescriptor final : transport::ChainingTransportDescriptor {
  using ChainingTransportDescriptor::ChainingTransportDescriptor;
  transport::TransportInterface* create_transport() const override;
};

// Hands the participant one datagram at a time. Fast DDS receives in a thread per port; up to 2.10
// secure participants that are discovered by two threads at once overwrite each other's data, and
// never meet (pull request 4188 of Fast DDS): with a dozen participants that start together every
// second start had such a pair.
class OneByOne final : public transport::ChainingTransport {
 public:
  explicit OneByOne(const OneByOneDescriptor& descriptor)
      : ChainingTransport(descriptor), descriptor_(descriptor) {}

  transport::TransportDescriptorInterface* get_configuration() override { return &descriptor_; }

  bool send(rtps::SenderResource* resource, const rtps::octet* data, std::uint32_t size,
            rtps::LocatorsIterator* begin, rtps::LocatorsIterator* end,
            const std::chrono::steady_clock::time_point& timeout) override {
    return resource->send(data, size, begin, end, timeout);
  }

  void receive(transport::TransportReceiverInterface* receiver, const rtps::octet* data,
               std::uint32_t size, const rtps::Locator_t& local,
               const rtps::Locator_t& remote) override {
    const std::scoped_lock lock(mutex_);
    receiver->OnDataReceived(data, size, local, remote);
  }

 private:
  OneByOneDescriptor descriptor_;
  std::mutex mutex_;
};

transport::TransportInterface* OneByOneDescriptor::create_transport() const {
  return new OneByOne(*this);
}

}  // namespace

void set_security(const KeyFiles& files, dds::DomainParticipantQos& qos) {
  const auto set = [&](const char* name, const std::string& value) {
    qos.properties().properties().emplace_back(name, value);
  };
  const auto set_file = [&](const char* name, const std::filesystem::path& file) {
    set(name, "file://" + file.string());
  };
  set("dds.sec.auth.plugin", "builtin.PKI-DH");
  set_file("dds.sec.auth.builtin.PKI-DH.identity_ca", files.identity_ca);
  set_file("dds.sec.auth.builtin.PKI-DH.identity_certificate", files.certificate);
  set_file("dds.sec.auth.builtin.PKI-DH.private_key", files.key);
  set("dds.sec.access.plugin", "builtin.Access-Permissions");
  set_file("dds.sec.access.builtin.Access-Permissions.permissions_ca", files.permissions_ca);
  set_file("dds.sec.access.builtin.Access-Permissions.governance", files.governance);
  set_file("dds.sec.access.builtin.Access-Permissions.permissions", files.permissions);
  set("dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC");
  for (auto& used : qos.transport().user_transports)
    used = std::make_shared<OneByOneDescriptor>(used);
  // Once one of two participants has given the other up, they never meet again: who still counts
  // the other as authenticated does not answer its new handshake. So a pause of a process or of the
  // network must not end a lease; what is left of the dead goes after an hour.
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  if (discovery.leaseDuration != eprosima::fastrtps::c_TimeInfinite)
    discovery.leaseDuration = {3600, 0};
}

}  // namespace cosegraph::graph
