#include "graph/dds.hpp"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/dds/log/StdoutErrConsumer.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/flowcontrol/FlowControllerDescriptor.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>
#include <set>

#include "graph/credentials.hpp"
#include "graph/dds_security.hpp"
#include "graph/discovery.hpp"
#include "graph/interfaces.hpp"

namespace cosegraph::graph {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::Duration_t;

// A DDS type whose samples are encoded already.
class EncodedType final : public dds::TopicDataType {
 public:
  explicit EncodedType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 4096;  // of the first allocation; the history grows as samples need it
    m_isGetKeyDefined = false;
    // With type information on, Fast DDS 2.9 crashes when participants start together, and other
    // vendors refuse the endpoints.
    auto_fill_type_information(false);
    auto_fill_type_object(false);
  }

  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const auto& bytes = *static_cast<const idl::Bytes*>(data);
    if (bytes.size() > payload->max_size) return false;
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = bytes.size() > 1 && bytes[1] == 1 ? CDR_LE : CDR_BE;
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    static_cast<idl::Bytes*>(data)->assign(payload->data, payload->data + payload->length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<idl::Bytes*>(data)->size()); };
  }
  void* createData() override { return new idl::Bytes; }
  void deleteData(void* data) override { delete static_cast<idl::Bytes*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

Duration_t milliseconds(int value) {
  return {0, static_cast<std::uint32_t>(value) * 1'000'000U};
}

rtps::Locator_t udp_locator(const std::string& field, const std::string& address,
                            std::uint32_t port) {
  rtps::Locator_t locator;
  locator.kind = LOCATOR_KIND_UDPv4;
  const auto [found, found_of_v6] = rtps::IPLocator::resolveNameDNS(address);
  if (found.empty() || !rtps::IPLocator::setIPv4(locator, *found.begin()))
    throw Error(field + ": '" + address + "' is neither an IPv4 address nor the name of one");
  locator.port = port;
  return locator;
}

bool is_run_on_this_host(const GraphDescription& graph) {
  return graph.dds.discovery == Discovery::multicast && !graph.instance.empty();
}

// A run on this host has a multicast port of its own. On the domain's, the participants of all runs
// would take note of each other, at a cost that grows with the square of their number.
void set_port_of_run(const std::string& instance, dds::DomainParticipantQos& qos) {
  constexpr std::uint32_t kFirst = 20'000;  // between those of DDS domains and ephemeral ones
  constexpr std::uint32_t kCount = 12'000;  // runs that share one are kept apart all the same
  std::uint32_t sum = 0;
  for (const char letter : instance) sum = 31 * sum + static_cast<unsigned char>(letter);
  auto& builtin = qos.wire_protocol().builtin;
  rtps::Locator_t multicast;
  rtps::IPLocator::createLocator(LOCATOR_KIND_UDPv4, "239.255.0.1", kFirst + sum % kCount,
                                 multicast);
  builtin.metatrafficMulticastLocatorList.push_back(multicast);
  // As usual: the port that the domain gives to the participant.
  rtps::Locator_t unicast;
  rtps::IPLocator::createLocator(LOCATOR_KIND_UDPv4, "0.0.0.0", 0, unicast);
  builtin.metatrafficUnicastLocatorList.push_back(unicast);
}

// This host is always a peer: its participants would not find each other otherwise.
void set_peers(std::vector<std::string> peers, dds::DomainParticipantQos& qos) {
  peers.emplace_back("127.0.0.1");
  for (const auto& peer : peers)
    qos.wire_protocol().builtin.initialPeersList.push_back(
        udp_locator("dds.discovery.peers", peer, 0));
}

// Makes the participant a client of the discovery server with id 0 at "HOST:PORT".
void set_server(const std::string& server, rtps::DiscoverySettings& discovery) {
  const std::size_t colon = server.rfind(':');
  rtps::RemoteServerAttributes remote;
  remote.ReadguidPrefix("44.53.00.5f.45.50.52.4f.53.49.4d.41");  // of `-i 0`, fixed by Fast DDS
  remote.metatrafficUnicastLocatorList.push_back(
      udp_locator("dds.discovery.server", server.substr(0, colon),
                  static_cast<std::uint32_t>(std::stoul(server.substr(colon + 1)))));
  discovery.discoveryProtocol = rtps::DiscoveryProtocol_t::CLIENT;
  discovery.m_DiscoveryServers.push_back(remote);
}

// The topics of a participant that readers on other hosts take; none unless it is a stage's.
std::set<std::string> topics_between_hosts(const GraphDescription& graph, const std::string& name) {
  std::set<std::string> result;
  const std::string prefix = graph.graph + "/";
  const std::string stage = name.starts_with(prefix) ? name.substr(prefix.size()) : "";
  if (graph.one_process || graph.stage(stage) == nullptr) return result;
  const auto hosts_here = hosts_of(*graph.stage(stage));
  const auto is_here = [&](const std::string& host) { return host == hosts_here.front(); };
  const bool spread = !std::ranges::all_of(hosts_here, is_here);
  for (const auto& reader : graph.stages)
    for (const auto& input : reader.inputs)
      if (input.from_stage == stage && (spread || !std::ranges::all_of(hosts_of(reader), is_here)))
        result.insert(topic_name(graph, stage, input.from_port));
  return result;
}

using Udp = eprosima::fastdds::rtps::UDPv4TransportDescriptor;

// Sends messages of at most so many bytes; takes in any.
class UdpOfSmallMessages final : public Udp {
 public:
  explicit UdpOfSmallMessages(std::uint32_t bytes) : bytes_(bytes) {}
  std::uint32_t max_message_size() const override { return bytes_; }

 private:
  std::uint32_t bytes_;
};

// What networks carry in one packet, bytes. A larger message is several IP fragments, and lost with
// any of them. What is left of it stops the receiver: the kernel keeps it for 30 s in 4 MB, and
// takes no further fragments meanwhile.
std::uint32_t message_size_between_hosts(const GraphDescription& graph) {
  constexpr std::uint32_t kMtu = 1400;  // that of most tunnels and overlays; Ethernet's: 1500
  constexpr std::uint32_t kIpAndUdpHeaders = 28;
  // Participants prove who they are in one message, which Fast DDS does not cut: a certificate
  // (0.7 kB), the signed permissions (3 kB, 50 B of it for each topic), keys. It has one limit for
  // all messages. A flow controller of one packet would cut the others, at 0.4 ms for each packet.
  constexpr std::uint32_t kHandshake = 8192;
  return graph.dds.security.empty() ? kMtu - kIpAndUdpHeaders : kHandshake;
}

// `message_size`: 0 for what UDP can take.
std::shared_ptr<Udp> udp_transport(std::uint32_t message_size) {
  constexpr std::uint32_t kSocketBuffer = 4U << 20U;
  auto udp = message_size == 0 ? std::make_shared<Udp>()
                               : std::make_shared<UdpOfSmallMessages>(message_size);
  udp->sendBufferSize = kSocketBuffer;
  udp->receiveBufferSize = kSocketBuffer;
  udp->non_blocking_send = false;
  // Only the first few participants of an address given without a port are tried otherwise.
  udp->maxInitialPeersRange = 64;
  return udp;
}

constexpr const char* kRateLimit = "rate";

// Hands no more than `rate` (Mbit/s) to the network.
std::shared_ptr<eprosima::fastdds::rtps::FlowControllerDescriptor> rate_limit(double rate) {
  constexpr double kShortestPeriod = 10.0;      // ms
  constexpr double kLeastPerPeriod = 4 * 1500;  // bytes; several messages
  const double bytes_per_ms = rate * 1e6 / 8.0 / 1e3;
  const double period = std::ceil(std::max(kShortestPeriod, kLeastPerPeriod / bytes_per_ms));
  auto result = std::make_shared<eprosima::fastdds::rtps::FlowControllerDescriptor>();
  result->name = kRateLimit;
  result->scheduler = eprosima::fastdds::rtps::FlowControllerSchedulerPolicy::FIFO;
  result->period_ms = static_cast<std::uint64_t>(period);
  result->max_bytes_per_period = static_cast<std::int32_t>(bytes_per_ms * period);
  return result;
}

// Without this, what is said to all goes out by every interface, and comes back by each.
void keep_on_this_host(Udp& udp) {
  udp.interfaceWhiteList.emplace_back("127.0.0.1");
}

// UDP only: a process that is killed in the middle of a write to shared memory can leave a lock
// behind that stops its readers for good.
dds::DomainParticipantQos udp_qos(const std::string& name, std::shared_ptr<Udp> udp) {
  dds::DomainParticipantQos qos;
  qos.name(name);
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(std::move(udp));
  return qos;
}

dds::DomainParticipantQos participant_qos(const GraphDescription& graph, const std::string& name,
                                          bool between_hosts) {
  auto udp = udp_transport(between_hosts ? message_size_between_hosts(graph) : 0);
  if (is_run_on_this_host(graph)) keep_on_this_host(*udp);
  dds::DomainParticipantQos qos = udp_qos(name, std::move(udp));
  if (graph.dds.rate > 0.0) qos.flow_controllers().push_back(rate_limit(graph.dds.rate));
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  // A participant that is silent for so long is given up, with what was sent to it. Those of one
  // process are only silent when the process is (suspended, stopped, starved of CPU), and must not
  // give each other up when it goes on.
  if (graph.one_process)
    discovery.leaseDuration = eprosima::fastrtps::c_TimeInfinite;
  else
    discovery.leaseDuration = {2, 0};
  discovery.leaseDuration_announcementperiod = milliseconds(500);
  if (is_run_on_this_host(graph)) {
    // All of a run announce themselves to all, and a process that ends is noticed without: rarely.
    if (!graph.one_process) discovery.leaseDuration = {3, 0};
    discovery.leaseDuration_announcementperiod = {1, 0};
    set_port_of_run(graph.instance, qos);
  }
  if (graph.dds.discovery == Discovery::peers) set_peers(graph.dds.peers, qos);
  if (graph.dds.discovery == Discovery::server) set_server(graph.dds.server, discovery);
  return qos;
}

template <class Qos>
void set_common(Qos& qos, const EndpointQos& wanted) {
  qos.reliability().kind =
      wanted.reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
  qos.durability().kind =
      wanted.keep_for_late ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = wanted.depth;
  qos.resource_limits().max_samples_per_instance = wanted.depth;
  qos.resource_limits().max_samples = wanted.depth;
  qos.resource_limits().max_instances = 1;
  qos.resource_limits().allocated_samples = 0;
  qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  qos.data_sharing().off();
}

class Listener final : public dds::DataReaderListener {
 public:
  explicit Listener(std::function<void(Sample)> receive) : receive_(std::move(receive)) {}

  void on_data_available(dds::DataReader* reader) override {
    for (;;) {
      auto bytes = std::make_shared<idl::Bytes>();
      dds::SampleInfo info;
      if (reader->take_next_sample(bytes.get(), &info) != ReturnCode_t::RETCODE_OK) return;
      if (info.valid_data) receive_(std::move(bytes));
    }
  }

 private:
  std::function<void(Sample)> receive_;
};

}  // namespace

struct Participant::Impl {
  dds::DomainParticipant* participant = nullptr;
  dds::Publisher* publisher = nullptr;
  dds::Subscriber* subscriber = nullptr;
  std::mutex mutex;
  std::map<std::string, dds::Topic*> topics;
  bool is_on_one_host = false;         // the graph
  std::set<std::string> rate_limited;  // topics

  ~Impl() {
    if (participant == nullptr) return;
    participant->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant);
  }

  void join(int domain, const dds::DomainParticipantQos& qos, const std::string& partition,
            dds::DomainParticipantListener* listener) {
    static std::once_flag quiet;
    std::call_once(quiet, [] {
      dds::Log::SetVerbosity(dds::Log::Error);
      // Of itself Fast DDS writes errors among what a command prints.
      dds::Log::ClearConsumers();
      dds::Log::RegisterConsumer(std::make_unique<dds::StdoutErrConsumer>());
    });
    const std::string name = qos.name().c_str();
    participant = dds::DomainParticipantFactory::get_instance()->create_participant(
        static_cast<std::uint32_t>(domain), qos, listener, dds::StatusMask::none());
    if (participant == nullptr)
      throw Error("cannot join DDS domain " + std::to_string(domain) + " as " + name);
    dds::PublisherQos of_publisher;
    of_publisher.partition().push_back(partition.c_str());
    dds::SubscriberQos of_subscriber;
    of_subscriber.partition().push_back(partition.c_str());
    publisher = participant->create_publisher(of_publisher);
    subscriber = participant->create_subscriber(of_subscriber);
    if (publisher == nullptr || subscriber == nullptr)
      throw Error("cannot set up publisher and subscriber of " + name);
  }

  dds::Topic* topic(const std::string& name, std::string_view type) {
    const std::scoped_lock lock(mutex);
    auto& known = topics[name];
    if (known != nullptr) return known;
    const bool is_foreign = type.find("::") != std::string_view::npos;
    const std::string wire = is_foreign ? std::string(type) : idl::wire_type(type);
    dds::TypeSupport support(new EncodedType(wire));
    support.register_type(participant);
    known = participant->create_topic(name, wire, dds::TOPIC_QOS_DEFAULT);
    if (known == nullptr) throw Error("cannot create the topic " + name + " of type " + wire);
    return known;
  }
};

namespace {

class DdsWriter final : public Writer {
 public:
  DdsWriter(dds::Publisher* publisher, dds::DataWriter* writer)
      : publisher_(publisher), writer_(writer) {}
  ~DdsWriter() override { publisher_->delete_datawriter(writer_); }

  void write(const idl::Bytes& bytes) override {
    // DDS takes a mutable pointer but only reads.
    if (!writer_->write(const_cast<idl::Bytes*>(&bytes)))
      throw Error("cannot publish " + std::to_string(bytes.size()) + " bytes on " +
                  writer_->get_topic()->get_name());
  }
  int matched() const override {
    dds::PublicationMatchedStatus status;
    writer_->get_publication_matched_status(status);
    return status.current_count;
  }

  bool await_readers(std::chrono::milliseconds patience) override {
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(patience);
    const auto rest = std::chrono::nanoseconds(patience - seconds);
    return writer_->wait_for_acknowledgments({static_cast<std::int32_t>(seconds.count()),
                                              static_cast<std::uint32_t>(rest.count())}) ==
           ReturnCode_t::RETCODE_OK;
  }

 private:
  dds::Publisher* publisher_;
  dds::DataWriter* writer_;
};

class DdsReader final : public Reader {
 public:
  DdsReader(dds::Subscriber* subscriber, dds::DataReader* reader,
            std::unique_ptr<Listener> listener)
      : subscriber_(subscriber), reader_(reader), listener_(std::move(listener)) {}
  ~DdsReader() override {
    reader_->set_listener(nullptr);
    subscriber_->delete_datareader(reader_);
  }
  int matched() const override {
    dds::SubscriptionMatchedStatus status;
    reader_->get_subscription_matched_status(status);
    return status.current_count;
  }
  int refused() const override {
    dds::RequestedIncompatibleQosStatus status;
    reader_->get_requested_incompatible_qos_status(status);
    return status.total_count;
  }

 private:
  dds::Subscriber* subscriber_;
  dds::DataReader* reader_;
  std::unique_ptr<Listener> listener_;
};

}  // namespace

Participant::Participant(const GraphDescription& graph, const std::string& name,
                         const Identity& identity, dds::DomainParticipantListener* listener)
    : impl_(std::make_unique<Impl>()) {
  require_keys(graph, identity);
  for (const auto& host : graph.hosts) count_as_connected(host.address);
  impl_->is_on_one_host = graph.hosts.empty();
  const auto between_hosts = topics_between_hosts(graph, name);
  if (graph.dds.rate > 0.0) impl_->rate_limited = between_hosts;
  dds::DomainParticipantQos qos = participant_qos(graph, name, !between_hosts.empty());
  if (!graph.dds.security.empty()) set_security(key_files(graph, identity), qos);
  impl_->join(graph.dds.domain, qos, partition_of(graph), listener);
}

Participant::Participant(int domain, const std::string& name) : impl_(std::make_unique<Impl>()) {
  impl_->join(domain, udp_qos(name, udp_transport(0)), "", nullptr);
}

Participant::~Participant() = default;

std::unique_ptr<Writer> Participant::writer(const std::string& topic, std::string_view type,
                                            const EndpointQos& wanted) {
  dds::DataWriterQos qos;
  set_common(qos, wanted);
  // A heartbeat is answered by every reader. Where hardly anything gets lost there is none with
  // each sample, as there would be once a history is full, but one for all of a while.
  qos.reliable_writer_qos().disable_heartbeat_piggyback = impl_->is_on_one_host;
  qos.reliable_writer_qos().times.heartbeatPeriod = milliseconds(impl_->is_on_one_host ? 100 : 50);
  if (impl_->rate_limited.contains(topic)) {
    qos.publish_mode().kind = dds::ASYNCHRONOUS_PUBLISH_MODE;
    qos.publish_mode().flow_controller_name = kRateLimit;
  }
  auto* writer = impl_->publisher->create_datawriter(impl_->topic(topic, type), qos);
  if (writer == nullptr) throw Error("cannot create a writer for " + topic);
  return std::make_unique<DdsWriter>(impl_->publisher, writer);
}

std::unique_ptr<Reader> Participant::reader(const std::string& topic, std::string_view type,
                                            const EndpointQos& wanted,
                                            std::function<void(Sample)> receive) {
  dds::DataReaderQos qos;
  set_common(qos, wanted);
  qos.reliable_reader_qos().times.heartbeatResponseDelay = milliseconds(1);
  auto listener = std::make_unique<Listener>(std::move(receive));
  auto* reader =
      impl_->subscriber->create_datareader(impl_->topic(topic, type), qos, listener.get());
  if (reader == nullptr) throw Error("cannot create a reader for " + topic);
  return std::make_unique<DdsReader>(impl_->subscriber, reader, std::move(listener));
}

}  // namespace cosegraph::graph
