#include "graph_security/raw.hpp"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <map>

#include "graph/dds_security.hpp"
#include "idl/codec.hpp"

namespace cosegraph::graph::test {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

// Nothing is ever written: it is the name that counts.
class Nothing final : public dds::TopicDataType {
 public:
  explicit Nothing(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 64;
    m_isGetKeyDefined = false;
    auto_fill_type_information(false);
    auto_fill_type_object(false);
  }
  bool serialize(void*, rtps::SerializedPayload_t*) override { return false; }
  bool deserialize(rtps::SerializedPayload_t*, void*) override { return false; }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [] { return 0U; };
  }
  void* createData() override { return new int; }
  void deleteData(void* data) override { delete static_cast<int*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

}  // namespace

struct RawParticipant::Impl {
  dds::DomainParticipant* participant = nullptr;
  dds::Publisher* publisher = nullptr;
  std::map<std::string, dds::DataWriter*> writers;
};

RawParticipant::RawParticipant(const GraphDescription& graph, const KeyFiles& files)
    : impl_(std::make_unique<Impl>()) {
  dds::DomainParticipantQos qos;
  qos.name("raw");
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(
      std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>());
  qos.wire_protocol().builtin.discovery_config.leaseDuration_announcementperiod = {0, 500'000'000};
  set_security(files, qos);
  impl_->participant = dds::DomainParticipantFactory::get_instance()->create_participant(
      static_cast<std::uint32_t>(graph.dds.domain), qos);
  if (impl_->participant == nullptr) return;
  dds::PublisherQos publisher;
  publisher.partition().push_back(graph.graph.c_str());
  impl_->publisher = impl_->participant->create_publisher(publisher);
}

RawParticipant::~RawParticipant() {
  if (impl_->participant == nullptr) return;
  impl_->participant->delete_contained_entities();
  dds::DomainParticipantFactory::get_instance()->delete_participant(impl_->participant);
}

bool RawParticipant::joined() const {
  return impl_->participant != nullptr;
}

bool RawParticipant::open_writer(const std::string& topic, std::string_view type) {
  const std::string wire = idl::wire_type(type);
  dds::TypeSupport support(new Nothing(wire));
  support.register_type(impl_->participant);
  dds::DataWriterQos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
  qos.data_sharing().off();
  dds::DataWriter* writer = impl_->publisher->create_datawriter(
      impl_->participant->create_topic(topic, wire, dds::TOPIC_QOS_DEFAULT), qos);
  if (writer != nullptr) impl_->writers[topic] = writer;
  return writer != nullptr;
}

int RawParticipant::readers(const std::string& topic) const {
  dds::PublicationMatchedStatus status;
  impl_->writers.at(topic)->get_publication_matched_status(status);
  return status.current_count;
}

void deliver_by_network() {
  eprosima::fastrtps::LibrarySettingsAttributes settings;
  settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
  eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
}

}  // namespace cosegraph::graph::test
