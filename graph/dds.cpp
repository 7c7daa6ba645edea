#include "graph/dds.hpp"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

#include <algorithm>
#include <condition_variable>
#include <cstring>
#include <map>
#include <mutex>
#include <thread>

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

constexpr auto kReconnectionPeriod = std::chrono::milliseconds(100);

Duration_t milliseconds(int value) {
  return {0, static_cast<std::uint32_t>(value) * 1'000'000U};
}

rtps::Locator_t udp_locator(const std::string& field, const std::string& address,
                            std::uint32_t port) {
  rtps::Locator_t locator;
  locator.kind = LOCATOR_KIND_UDPv4;
  if (!rtps::IPLocator::setIPv4(locator, address))
    throw Error(field + ": '" + address + "' is not an IPv4 address");
  locator.port = port;
  return locator;
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

// Whether the way to the other hosts of the graph is cut off, as when a cable is out.
bool is_cut_off(const GraphDescription& graph, const Interface& interface) {
  return !interface.connected &&
         std::ranges::find(graph.hosts, interface.address, &Host::address) != graph.hosts.end();
}

// Fast DDS takes the addresses that are connected when a participant is made. Readers made while
// the host is cut off would never be found from other hosts; so they are told the address.
void set_own_addresses(const GraphDescription& graph,
                       eprosima::fastdds::rtps::LocatorList& locators) {
  const auto all = interfaces();
  if (std::ranges::none_of(all, [&](const auto& one) { return is_cut_off(graph, one); })) return;
  for (const auto& one : all)
    if (!one.loopback && (one.connected || is_cut_off(graph, one)))
      locators.push_back(udp_locator("hosts", one.address, 0));
}

dds::DomainParticipantQos participant_qos(const GraphDescription& graph, const std::string& name) {
  dds::DomainParticipantQos qos;
  qos.name(name);
  constexpr std::uint32_t kSocketBuffer = 4U << 20U;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->sendBufferSize = kSocketBuffer;
  udp->receiveBufferSize = kSocketBuffer;
  udp->non_blocking_send = false;
  // Only the first few participants of an address given without a port are tried otherwise.
  udp->maxInitialPeersRange = 64;
  // UDP only: a process that is killed in the middle of a write to shared memory can leave a lock
  // behind that stops its readers for good.
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  // A participant that is silent for so long is given up, with what was sent to it. Those of one
  // process are only silent when the process is (suspended, stopped, starved of CPU), and must not
  // give each other up when it goes on.
  if (graph.one_process)
    discovery.leaseDuration = eprosima::fastrtps::c_TimeInfinite;
  else
    discovery.leaseDuration = {2, 0};
  discovery.leaseDuration_announcementperiod = milliseconds(500);
  if (graph.dds.discovery == Discovery::peers)
    for (const auto& peer : graph.dds.peers)
      qos.wire_protocol().builtin.initialPeersList.push_back(udp_locator("dds.peers", peer, 0));
  if (graph.dds.discovery == Discovery::server) set_server(graph.dds.server, discovery);
  if (!graph.one_process)
    set_own_addresses(graph, qos.wire_protocol().default_unicast_locator_list);
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
  std::jthread reconnection;

  ~Impl() {
    if (participant == nullptr) return;
    reconnection = {};  // stopped
    participant->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant);
  }

  // A participant that is made while its host is cut off joins the others when that is over.
  void await_connection(const GraphDescription& graph) {
    const auto cut_off = [hosts = graph] {
      return std::ranges::any_of(interfaces(),
                                 [&](const auto& one) { return is_cut_off(hosts, one); });
    };
    if (!cut_off()) return;
    reconnection = std::jthread([this, cut_off](const std::stop_token& stop) {
      std::mutex waiting;
      std::condition_variable_any stopped;
      std::unique_lock lock(waiting);
      while (cut_off())
        if (stopped.wait_for(lock, stop, kReconnectionPeriod, [] { return false; });
            stop.stop_requested())
          return;
      participant->set_qos(participant->get_qos());  // looks at the interfaces anew
    });
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
  static std::once_flag quiet;
  std::call_once(quiet, [] { dds::Log::SetVerbosity(dds::Log::Error); });
  auto* factory = dds::DomainParticipantFactory::get_instance();
  dds::DomainParticipantQos qos = participant_qos(graph, name);
  if (!graph.dds.security.empty()) set_security(key_files(graph, identity), qos);
  impl_->participant = factory->create_participant(static_cast<std::uint32_t>(graph.dds.domain),
                                                   qos, listener, dds::StatusMask::none());
  if (impl_->participant == nullptr)
    throw Error("cannot join DDS domain " + std::to_string(graph.dds.domain) + " as " + name);
  if (!graph.one_process) impl_->await_connection(graph);
  dds::PublisherQos publisher;
  const std::string partition = partition_of(graph);
  publisher.partition().push_back(partition.c_str());
  dds::SubscriberQos subscriber;
  subscriber.partition().push_back(partition.c_str());
  impl_->publisher = impl_->participant->create_publisher(publisher);
  impl_->subscriber = impl_->participant->create_subscriber(subscriber);
  if (impl_->publisher == nullptr || impl_->subscriber == nullptr)
    throw Error("cannot set up publisher and subscriber of " + name);
}

Participant::~Participant() = default;

std::unique_ptr<Writer> Participant::writer(const std::string& topic, std::string_view type,
                                            const EndpointQos& wanted) {
  dds::DataWriterQos qos;
  set_common(qos, wanted);
  qos.reliable_writer_qos().times.heartbeatPeriod = milliseconds(50);
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
