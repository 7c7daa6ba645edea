#include "graph/discovery.hpp"

#include <fastdds/rtps/participant/ParticipantDiscoveryInfo.h>
#include <fastdds/rtps/reader/ReaderDiscoveryInfo.h>
#include <fastdds/rtps/writer/WriterDiscoveryInfo.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>

#include <algorithm>
#include <sstream>

#include "graph/figures.hpp"

namespace cosegraph::graph {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

template <class Guid>
std::string text_of(const Guid& guid) {
  std::ostringstream text;
  text << guid;
  return text.str();
}

double seconds(const eprosima::fastrtps::Duration_t& duration) {
  if (duration == eprosima::fastrtps::c_TimeInfinite) return kForever;
  return duration.seconds + 1e-9 * duration.nanosec;
}

template <class Qos>
Offer offer_of(const Qos& qos) {
  return {.reliable = qos.m_reliability.kind == dds::RELIABLE_RELIABILITY_QOS,
          .durability = static_cast<Durability>(qos.m_durability.kind),
          .liveliness = static_cast<Liveliness>(qos.m_liveliness.kind),
          .lease = seconds(qos.m_liveliness.lease_duration),
          .deadline = seconds(qos.m_deadline.period),
          .exclusive = qos.m_ownership.kind == dds::EXCLUSIVE_OWNERSHIP_QOS};
}

template <class Proxy>
Endpoint endpoint_of(const Proxy& proxy, bool is_writer) {
  Endpoint endpoint{.guid = text_of(proxy.guid()),
                    .participant = text_of(proxy.guid().guidPrefix),
                    .is_writer = is_writer,
                    .topic = proxy.topicName().to_string(),
                    .type = proxy.typeName().to_string(),
                    .keyed = proxy.topicKind() == rtps::WITH_KEY,
                    .qos = offer_of(proxy.m_qos)};
  for (const auto& partition : proxy.m_qos.m_partition.getNames())
    endpoint.partitions.push_back(partition);
  return endpoint;
}

Peer peer_of(const rtps::ParticipantProxyData& proxy) {
  Peer peer{.guid = text_of(proxy.m_guid.guidPrefix),
            .name = proxy.m_participantName.to_string(),
            .lease = seconds(proxy.m_leaseDuration)};
  for (const auto& property : proxy.m_properties) {
    if (property.first() == dds::parameter_policy_physical_data_host) {
      const std::string host = property.second();  // "NAME:HASH"
      peer.host = host.substr(0, host.rfind(':'));
    }
    if (property.first() == dds::parameter_policy_physical_data_user) peer.user = property.second();
    if (property.first() == dds::parameter_policy_physical_data_process)
      peer.process = property.second();
  }
  for (const auto& locator : proxy.default_locators.unicast) {
    const std::string address = rtps::IPLocator::ip_to_string(locator);
    if (std::ranges::find(peer.addresses, address) == peer.addresses.end())
      peer.addresses.push_back(address);
  }
  return peer;
}

}  // namespace

class DomainWatch::Listener final : public dds::DomainParticipantListener {
 public:
  explicit Listener(DomainWatch& owner) : owner_(owner) {}

  void on_participant_discovery(dds::DomainParticipant* self,
                                rtps::ParticipantDiscoveryInfo&& info) override {
    using Status = rtps::ParticipantDiscoveryInfo;
    const std::scoped_lock lock(owner_.mutex_);
    Peer peer = peer_of(info.info);
    peer.on_this_machine = info.info.m_guid.is_on_same_host_as(self->guid());
    if (info.status == Status::REMOVED_PARTICIPANT || info.status == Status::DROPPED_PARTICIPANT) {
      owner_.peers_.erase(peer.guid);
      std::erase_if(owner_.endpoints_,
                    [&](const auto& entry) { return entry.second.participant == peer.guid; });
    } else {
      owner_.peers_[peer.guid] = std::move(peer);
    }
    owner_.tell();
  }

  void on_publisher_discovery(dds::DomainParticipant*, rtps::WriterDiscoveryInfo&& info) override {
    note(endpoint_of(info.info, true), info.status == rtps::WriterDiscoveryInfo::REMOVED_WRITER);
  }

  void on_subscriber_discovery(dds::DomainParticipant*, rtps::ReaderDiscoveryInfo&& info) override {
    note(endpoint_of(info.info, false), info.status == rtps::ReaderDiscoveryInfo::REMOVED_READER);
  }

 private:
  void note(Endpoint endpoint, bool removed) {
    const std::scoped_lock lock(owner_.mutex_);
    if (removed)
      owner_.endpoints_.erase(endpoint.guid);
    else
      owner_.endpoints_[endpoint.guid] = std::move(endpoint);
    owner_.tell();
  }

  DomainWatch& owner_;
};

DomainWatch::DomainWatch(const GraphDescription& graph)
    : listener_(std::make_unique<Listener>(*this)),
      participant_(std::make_unique<Participant>(graph, graph.graph + "/observer",
                                                 Identity::observer(), listener_.get())) {}

DomainWatch::~DomainWatch() = default;

Domain DomainWatch::domain() const {
  const std::scoped_lock lock(mutex_);
  Domain result{.peers = peers_};
  for (const auto& [guid, endpoint] : endpoints_) result.endpoints.push_back(endpoint);
  return result;
}

Domain DomainWatch::wait(std::chrono::milliseconds patience,
                         const std::function<bool(const Domain&)>& enough) {
  const auto limit = std::chrono::steady_clock::now() + patience;
  for (;;) {
    std::unique_lock lock(mutex_);
    const std::uint64_t seen = changes_;
    lock.unlock();
    Domain now = domain();
    if (enough(now)) return now;
    lock.lock();
    if (!news_.wait_until(lock, limit, [&] { return changes_ != seen; })) return now;
  }
}

void DomainWatch::tell() {
  ++changes_;
  news_.notify_all();
}

std::string partition_of(const GraphDescription& graph) {
  return graph.instance.empty() ? graph.graph : graph.graph + "." + graph.instance;
}

bool is_complete(const Domain& domain, const GraphDescription& graph) {
  const std::vector<std::string> partition{partition_of(graph)};
  std::map<std::string, std::size_t> wanted;  // readers by topic
  for (const auto& stage : graph.stages)
    for (const auto& input : stage.inputs)
      wanted[topic_name(graph, input.from_stage, input.from_port)] += hosts_of(stage).size();
  std::map<std::string, std::size_t> readers;
  std::map<std::string, std::size_t> writers;
  for (const auto& endpoint : domain.endpoints)
    if (endpoint.partitions == partition)
      ++(endpoint.is_writer ? writers : readers)[endpoint.topic];
  return std::ranges::all_of(wanted, [&](const auto& topic) {
    return writers[topic.first] > 0 && readers[topic.first] >= topic.second;
  });
}

std::vector<const Endpoint*> Domain::writers(std::string_view topic) const {
  std::vector<const Endpoint*> result;
  for (const auto& endpoint : endpoints)
    if (endpoint.is_writer && endpoint.topic == topic) result.push_back(&endpoint);
  return result;
}

std::vector<const Endpoint*> Domain::readers(std::string_view topic) const {
  std::vector<const Endpoint*> result;
  for (const auto& endpoint : endpoints)
    if (!endpoint.is_writer && endpoint.topic == topic) result.push_back(&endpoint);
  return result;
}

}  // namespace cosegraph::graph
