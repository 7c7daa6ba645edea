// A cable with delay, for kernels without one of their own (tc netem).
#pragma once

#include <chrono>
#include <string>
#include <thread>

namespace cosegraph::test {

// Makes two network devices (TAP) in the namespace of the calling thread and passes every frame
// from one to the other `delay` later, both ways. They are gone with the object.
class Relay {
 public:
  // Throws Error if the devices cannot be made.
  Relay(const std::string& one, const std::string& other, std::chrono::milliseconds delay);
  ~Relay();
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

 private:
  void pass(std::chrono::milliseconds delay) const;

  int ends_[2];
  int stop_;  // an eventfd
  std::thread thread_;
};

}  // namespace cosegraph::test
