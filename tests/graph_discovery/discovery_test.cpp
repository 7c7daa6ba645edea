// What a watcher of a domain is told, by participants of this process and strangers.
#include "graph/discovery.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <thread>

#include "graph/dds.hpp"
#include "graph/runs.hpp"

namespace cosegraph::graph {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr auto kPatience = 20s;  // only guards against hanging

GraphDescription small_graph() {
  std::vector<Fault> faults;
  GraphDescription graph = parse(R"(version: 1
graph: watched
stages:
  numbers: {use: numbers}
  sum: {use: sum, inputs: {in: numbers/out}}
)",
                                 "", faults);
  return fresh_instance(graph);
}

const std::string kTopic = "watched/numbers/out";

TEST(DomainWatch, SeesWhoWritesAndReadsWhat) {
  const GraphDescription graph = small_graph();
  DomainWatch watch(graph);
  Participant numbers(graph, "watched/numbers");
  Participant sum(graph, "watched/sum");
  const auto writer = numbers.writer(kTopic, "Cloud", {.depth = 3});
  EXPECT_FALSE(is_complete(watch.domain(), graph)) << "nobody reads";
  const auto reader = sum.reader(kTopic, "Cloud", {.reliable = false}, [](const Sample&) {});
  const Domain domain =
      watch.wait(kPatience, [&](const Domain& now) { return is_complete(now, graph); });
  ASSERT_TRUE(is_complete(domain, graph));
  const auto writers = domain.writers(kTopic);
  const auto readers = domain.readers(kTopic);
  ASSERT_THAT(writers, SizeIs(1));
  ASSERT_THAT(readers, SizeIs(1));
  EXPECT_EQ(writers[0]->type, "cosegraph::msg::Cloud");
  EXPECT_FALSE(writers[0]->keyed);
  EXPECT_THAT(writers[0]->partitions, ElementsAre(partition_of(graph)));
  EXPECT_TRUE(writers[0]->qos.reliable);
  EXPECT_EQ(writers[0]->qos.durability, Durability::transient_local);
  EXPECT_EQ(writers[0]->qos.deadline, kForever);
  EXPECT_FALSE(readers[0]->qos.reliable);
  EXPECT_THAT(mismatches(*writers[0], *readers[0]), IsEmpty());
  const Peer& peer = domain.peers.at(writers[0]->participant);
  EXPECT_EQ(peer.name, "watched/numbers");
  EXPECT_TRUE(peer.on_this_machine);
  EXPECT_EQ(peer.lease, 3.0);
  EXPECT_THAT(peer.addresses, testing::Not(IsEmpty()));
}

TEST(DomainWatch, ForgetsWhoLeaves) {
  const GraphDescription graph = small_graph();
  DomainWatch watch(graph);
  auto numbers = std::make_unique<Participant>(graph, "watched/numbers");
  auto writer = numbers->writer(kTopic, "Cloud", {});
  const auto is_there = [&](const Domain& now) { return !now.writers(kTopic).empty(); };
  ASSERT_TRUE(is_there(watch.wait(kPatience, is_there)));
  writer.reset();
  const auto is_gone = [&](const Domain& now) { return now.writers(kTopic).empty(); };
  EXPECT_TRUE(is_gone(watch.wait(kPatience, is_gone)));
  numbers.reset();
  const auto has_left = [&](const Domain& now) {
    return std::ranges::none_of(now.peers,
                                [](const auto& p) { return p.second.name == "watched/numbers"; });
  };
  EXPECT_TRUE(has_left(watch.wait(kPatience, has_left)));
}

// The cost of knowing each other grows with the square of their number.
TEST(DomainWatch, RunsOnOneHostTakeNoNoteOfEachOther) {
  const GraphDescription one = small_graph();
  const GraphDescription other = small_graph();
  DomainWatch watch(one);
  DomainWatch other_watch(other);
  Participant stranger(other, "watched/stranger");
  Participant member(one, "watched/member");
  const auto hears = [](const Domain& now, const std::string& name) {
    return std::ranges::any_of(now.peers, [&](const auto& p) { return p.second.name == name; });
  };
  const Domain seen =
      watch.wait(kPatience, [&](const Domain& now) { return hears(now, "watched/member"); });
  const Domain seen_by_other = other_watch.wait(
      kPatience, [&](const Domain& now) { return hears(now, "watched/stranger"); });
  EXPECT_TRUE(hears(seen, "watched/member"));
  EXPECT_FALSE(hears(seen, "watched/stranger"));
  EXPECT_TRUE(hears(seen_by_other, "watched/stranger"));
  EXPECT_FALSE(hears(seen_by_other, "watched/member"));
}

TEST(DomainWatch, BestEffortReadersGetWhatIsWrittenFromThenOn) {
  const GraphDescription graph = small_graph();
  DomainWatch watch(graph);
  Participant numbers(graph, "watched/numbers");
  const auto writer = numbers.writer(kTopic, "Cloud", {.depth = 3});
  const idl::Bytes bytes = idl::encode({.name = "one"}, Cloud{.height = 1});
  writer->write(bytes);
  std::atomic<int> heard = 0;
  const auto reader = watch.participant().reader(
      kTopic, "cosegraph::msg::Cloud", {.depth = 1, .keep_for_late = false, .reliable = false},
      [&](const Sample& sample) {
        EXPECT_EQ(*sample, bytes);
        ++heard;
      });
  for (int i = 0; i < 400 && (reader->matched() == 0 || writer->matched() == 0); ++i)
    std::this_thread::sleep_for(50ms);
  EXPECT_EQ(heard, 0) << "what was written before";
  for (int i = 0; i < 400 && heard == 0; ++i) {
    writer->write(bytes);
    std::this_thread::sleep_for(50ms);
  }
  EXPECT_GT(heard, 0);
}

// -- strangers -----------------------------------------------------------------------------------

class StrangeType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  StrangeType() {
    setName("strange::Type");
    m_typeSize = 16;
    m_isGetKeyDefined = true;
    auto_fill_type_information(false);
    auto_fill_type_object(false);
  }
  bool serialize(void*, eprosima::fastrtps::rtps::SerializedPayload_t*) override { return false; }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t*, void*) override { return false; }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [] { return 0U; };
  }
  void* createData() override { return nullptr; }
  void deleteData(void*) override {}
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return true; }
};

TEST(DomainWatch, TellsEveryPolicyOfAStranger) {
  namespace dds = eprosima::fastdds::dds;
  GraphDescription graph = small_graph();
  graph.instance.clear();  // strangers are heard by graphs that agents run
  DomainWatch watch(graph);
  auto* factory = dds::DomainParticipantFactory::get_instance();
  dds::DomainParticipantQos participant_qos;
  participant_qos.name("stranger");
  auto* stranger = factory->create_participant(0, participant_qos);
  ASSERT_NE(stranger, nullptr);
  dds::TypeSupport type(new StrangeType);
  type.register_type(stranger);
  auto* topic = stranger->create_topic(kTopic, "strange::Type", dds::TOPIC_QOS_DEFAULT);
  auto* publisher = stranger->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
  dds::DataWriterQos qos;
  qos.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
  qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
  qos.deadline().period = {1, 500'000'000};
  qos.liveliness().kind = dds::MANUAL_BY_TOPIC_LIVELINESS_QOS;
  qos.liveliness().lease_duration = {3, 0};
  qos.liveliness().announcement_period = {1, 0};
  qos.ownership().kind = dds::EXCLUSIVE_OWNERSHIP_QOS;
  ASSERT_NE(publisher->create_datawriter(topic, qos), nullptr);

  const Domain domain =
      watch.wait(kPatience, [&](const Domain& now) { return !now.writers(kTopic).empty(); });
  const auto writers = domain.writers(kTopic);
  ASSERT_THAT(writers, SizeIs(1));
  const Endpoint& writer = *writers[0];
  EXPECT_EQ(writer.type, "strange::Type");
  EXPECT_TRUE(writer.keyed);
  EXPECT_THAT(writer.partitions, IsEmpty());
  EXPECT_FALSE(writer.qos.reliable);
  EXPECT_EQ(writer.qos.durability, Durability::volatile_);
  EXPECT_NEAR(writer.qos.deadline, 1.5, 1e-6);
  EXPECT_EQ(writer.qos.liveliness, Liveliness::manual_by_topic);
  EXPECT_NEAR(writer.qos.lease, 3.0, 1e-6);
  EXPECT_TRUE(writer.qos.exclusive);
  EXPECT_EQ(domain.peers.at(writer.participant).name, "stranger");
  stranger->delete_contained_entities();
  factory->delete_participant(stranger);
}

// What commands print is for programs as well.
TEST(Participants, ErrorsOfFastDdsAreNotAmongWhatIsPrinted) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  {
    const GraphDescription graph = small_graph();
    const Participant participant(graph, "somebody");
    EPROSIMA_LOG_ERROR(TEST, "a handshake failed");
    eprosima::fastdds::dds::Log::Flush();
  }
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_THAT(testing::internal::GetCapturedStderr(), testing::HasSubstr("a handshake failed"));
}

}  // namespace
}  // namespace cosegraph::graph
