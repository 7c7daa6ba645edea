// Topics of ROS 2 from within a stage: PointCloud2 in and out, over the DDS that ROS 2 itself
// speaks, on a participant of their own. Needs nothing of ROS.
//
// A topic /NAME of ROS is rt/NAME in DDS, in no partition.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "core/fields.hpp"
#include "graph/stage.hpp"

namespace cosegraph::graph::ros2 {

enum class Reliability { reliable, best_effort };

struct Topic {
  std::string name;  // as in ROS; empty: none
  Reliability reliability = Reliability::reliable;
  int depth = 1;    // messages kept
  int domain = -1;  // of DDS; -1: the graph's
};

// `name_doc` tells what the topic is for, `depth_doc` what is kept.
Fields describe(Topic& topic, std::string name_doc, std::string depth_doc);

// The topic's name in DDS, "rt/camera/points" for both "/camera/points" and "camera/points". Throws
// ParameterError unless it is letters, digits and '_' between slashes, no part beginning with a
// digit.
std::string dds_name(const std::string& name);

// The newest messages of a topic, as they come. May be used from one thread.
class Subscription {
 public:
  // Throws ParameterError for a bad name, Error if DDS cannot be started.
  Subscription(const Topic& topic, int domain_of_graph);
  ~Subscription();

  // Whether there is a message; waits for one up to `patience`.
  bool wait(std::chrono::milliseconds patience);
  // The oldest of those kept, taken out; null if there is none.
  Sample take();
  // Messages that newer ones have pushed out since this was last asked.
  std::uint64_t missed();
  // Forgets all that has come.
  void clear();
  // What it waits for: "waiting for /camera/points", or why nothing can come.
  std::string waiting_for() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

class Publisher {
 public:
  // Throws as Subscription.
  Publisher(const Topic& topic, int domain_of_graph);
  ~Publisher();

  void publish(const idl::Bytes& message);
  // Waits until the reliable subscribers have all messages; false if that takes longer.
  bool await_subscribers(std::chrono::milliseconds patience);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cosegraph::graph::ros2

template <>
cosegraph::Names<cosegraph::graph::ros2::Reliability>
cosegraph::names<cosegraph::graph::ros2::Reliability>();
