#include "graph/ros2.hpp"

#include <algorithm>
#include <cctype>
#include <condition_variable>
#include <deque>
#include <mutex>

#include "graph/dds.hpp"
#include "idl/point_cloud2.hpp"

template <>
cosegraph::Names<cosegraph::graph::ros2::Reliability>
cosegraph::names<cosegraph::graph::ros2::Reliability>() {
  using enum graph::ros2::Reliability;
  static constexpr std::pair<graph::ros2::Reliability, std::string_view> kTable[] = {
      {reliable, "reliable"}, {best_effort, "best_effort"}};
  return kTable;
}

namespace cosegraph::graph::ros2 {
namespace {

constexpr int kLastDomain = 232;
constexpr int kDeepest = 1000;

bool is_word(std::string_view part) {
  const auto may_stand = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
  };
  return !part.empty() && std::isdigit(static_cast<unsigned char>(part[0])) == 0 &&
         std::ranges::all_of(part, may_stand);
}

int domain_of(const Topic& topic, int domain_of_graph) {
  return topic.domain < 0 ? domain_of_graph : topic.domain;
}

EndpointQos qos_of(const Topic& topic) {
  return {.depth = topic.depth,
          .keep_for_late = false,
          .reliable = topic.reliability == Reliability::reliable};
}

}  // namespace

Fields describe(Topic& topic, std::string name_doc, std::string depth_doc) {
  return {text_field("topic", topic.name, std::move(name_doc)),
          choice_field("reliability", topic.reliability,
                       "QoS of the topic; best_effort also reads publishers of sensor data"),
          integer_field("depth", topic.depth, 1, kDeepest, "", std::move(depth_doc)),
          integer_field("domain", topic.domain, -1, kLastDomain, "",
                        "ROS_DOMAIN_ID of the topic; -1: the domain of the graph")};
}

std::string dds_name(const std::string& name) {
  const std::string_view relative = std::string_view(name).substr(name.starts_with('/') ? 1 : 0);
  for (std::size_t begin = 0; begin <= relative.size();) {
    const std::size_t end = std::min(relative.find('/', begin), relative.size());
    if (!is_word(relative.substr(begin, end - begin)))
      throw ParameterError("topic: '" + name + "' is not the full name of a topic of ROS 2");
    begin = end + 1;
  }
  return "rt/" + std::string(relative);
}

struct Subscription::Impl {
  Impl(const Topic& wanted, int wanted_domain)
      : topic(wanted), domain(wanted_domain), participant(domain, "cosegraph" + topic.name) {}

  void receive(Sample message) {
    {
      const std::scoped_lock lock(mutex);
      messages.push_back(std::move(message));
      if (messages.size() > static_cast<std::size_t>(topic.depth)) {
        messages.pop_front();
        ++missed;
      }
    }
    changed.notify_all();
  }

  const Topic topic;
  const int domain;
  std::mutex mutex;  // guards what follows, up to participant
  std::condition_variable changed;
  std::deque<Sample> messages;  // newest last
  std::uint64_t missed = 0;
  Participant participant;
  std::unique_ptr<Reader> reader;
};

Subscription::Subscription(const Topic& topic, int domain_of_graph) {
  const std::string name = dds_name(topic.name);
  impl_ = std::make_unique<Impl>(topic, domain_of(topic, domain_of_graph));
  impl_->reader = impl_->participant.reader(
      name, idl::kPointCloud2, qos_of(topic),
      [impl = impl_.get()](Sample message) { impl->receive(std::move(message)); });
}

Subscription::~Subscription() = default;

bool Subscription::wait(std::chrono::milliseconds patience) {
  std::unique_lock lock(impl_->mutex);
  return impl_->changed.wait_for(lock, patience, [this] { return !impl_->messages.empty(); });
}

Sample Subscription::take() {
  const std::scoped_lock lock(impl_->mutex);
  if (impl_->messages.empty()) return nullptr;
  Sample message = std::move(impl_->messages.front());
  impl_->messages.pop_front();
  return message;
}

std::uint64_t Subscription::missed() {
  const std::scoped_lock lock(impl_->mutex);
  return std::exchange(impl_->missed, 0);
}

void Subscription::clear() {
  const std::scoped_lock lock(impl_->mutex);
  impl_->messages.clear();
  impl_->missed = 0;
}

std::string Subscription::waiting_for() const {
  const std::string& name = impl_->topic.name;
  if (impl_->reader->matched() > 0) return "waiting for " + name;
  if (impl_->reader->refused() > 0)
    return "the publisher of " + name + " is best effort: set reliability to best_effort";
  return "nobody publishes " + name + " in domain " + std::to_string(impl_->domain);
}

struct Publisher::Impl {
  Impl(const Topic& topic, int domain)
      : participant(domain, "cosegraph" + topic.name),
        writer(participant.writer(dds_name(topic.name), idl::kPointCloud2, qos_of(topic))) {}

  Participant participant;
  std::unique_ptr<Writer> writer;
};

Publisher::Publisher(const Topic& topic, int domain_of_graph) {
  dds_name(topic.name);  // refused before anything is started
  impl_ = std::make_unique<Impl>(topic, domain_of(topic, domain_of_graph));
}

Publisher::~Publisher() = default;

void Publisher::publish(const idl::Bytes& message) {
  impl_->writer->write(message);
}

bool Publisher::await_subscribers(std::chrono::milliseconds patience) {
  return impl_->writer->await_readers(patience);
}

}  // namespace cosegraph::graph::ros2
