// Hosts on one machine: network namespaces that a switch or a router connects, for tests of graphs
// that run on several machines.
//
//   if (const auto reason = Lab::unavailable(); !reason.empty()) GTEST_SKIP() << reason;
//   Lab lab({.hosts = 3});
//   lab.host(1).shape({.loss = 0.01, .delay = 20ms});
//   auto child = lab.host(0).start({"cosegraph-source", "--graph", file, ...});
//   lab.host(0).inside([&] { Observer observer(graph); ... });
//
// Namespaces have no names: they last as long as this process or something that was started in
// them, so that a crash leaves nothing behind. Needs root, iproute2 and nftables. Failures of the
// lab itself are thrown as Error.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "support/program.hpp"

namespace cosegraph::test {

// An open file descriptor.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  int number() const { return number_; }

 private:
  int number_;
};

// A program that runs in a host; as Program, but it is killed with the handle, and with the thread
// that started it.
class Child {
 public:
  // In the namespaces that are open as `net` and `mount`, if not negative. A program without a
  // slash is one of the project's. Throws Error if it cannot be started.
  Child(std::vector<std::string> words, int net, int mount = -1);
  ~Child();
  Child(Child&& other) noexcept;
  Child& operator=(Child&& other) = delete;

  pid_t pid() const { return pid_; }
  bool running();
  void signal(int number) const;
  std::string output() const;  // so far
  std::string errors() const;
  // Waits for its end. The overload returns status -1 if it has not come within `patience`.
  Outcome wait();
  Outcome wait(std::chrono::milliseconds patience);

 private:
  Outcome outcome() const;

  std::unique_ptr<TemporaryFolder> folder_;
  pid_t pid_ = -1;
  int status_ = -1;  // as waitpid() has it, once it is over
  bool over_ = false;
};

// What the link between a host and its switch does to packets, each way.
struct Link {
  double loss = 0.0;                   // share of packets that vanish
  std::chrono::milliseconds delay{0};  // a round trip takes twice that
  double rate = 0.0;                   // Mbit/s; 0: as fast as it goes
};

class Network;
class Relay;

class LabHost {
 public:
  ~LabHost();
  LabHost(LabHost&&) noexcept;

  const std::string& address() const { return address_; }

  Child start(std::vector<std::string> words) const;
  // Runs a program to its end.
  Outcome run(std::vector<std::string> words) const;
  // Calls `task` in a thread that is in this host, and waits for it; what it throws is thrown here.
  // Threads and sockets that it makes are in the host as well. Messages between participants of
  // this process do not touch the network, whatever hosts they are in.
  void inside(const std::function<void()>& task) const;

  // Takes effect at once and replaces what was set before.
  void shape(const Link& link);
  // Pulls the plug: no packet passes until restore(), which returns when the link is up again.
  void cut();
  void restore();
  // As if the power failed: kills all that runs in this host, whoever started it.
  void kill_everything() const;

 private:
  friend class Lab;
  LabHost(Network& network, int index, int subnet, bool own_shm);
  void await_connection() const;
  void set_delay(std::chrono::milliseconds delay);

  Network* network_;
  std::string address_;
  std::string bridge_;  // of its subnet, in the network's namespace, as are all that follow
  std::string port_;    // the other end of the host's eth0
  std::string name_;    // prefix of what else is made for it
  Descriptor net_;
  Descriptor mount_;  // if it has its own
  Link link_;
  std::unique_ptr<Relay> relay_;  // if there is delay
};

struct LabOptions {
  int hosts = 2;
  int subnets = 1;        // hosts are dealt out to them in turn; a router connects them
  bool multicast = true;  // within a subnet; it never passes the router
  bool own_shm = false;   // every host has its own /dev/shm, as containers have
};

class Lab {
 public:
  explicit Lab(const LabOptions& options = {});
  ~Lab();

  // Why there cannot be a lab here: "needs root", ...; empty if there can.
  static std::string unavailable();

  LabHost& host(int index) { return hosts_.at(static_cast<std::size_t>(index)); }
  int size() const { return static_cast<int>(hosts_.size()); }

 private:
  std::unique_ptr<Network> network_;
  std::vector<LabHost> hosts_;
};

}  // namespace cosegraph::test
