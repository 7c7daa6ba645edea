// The lab does to packets what it says.
#include "hosts/lab.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <sstream>
#include <thread>

#include "core/error.hpp"

namespace cosegraph::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr std::uint16_t kPort = 7000;
constexpr auto kPatience = 300ms;  // for a packet that may not come

sockaddr_in address_of(const std::string& host) {
  sockaddr_in result{};
  result.sin_family = AF_INET;
  result.sin_port = htons(kPort);
  ::inet_pton(AF_INET, host.c_str(), &result.sin_addr);
  return result;
}

// A UDP socket in a host.
class Mailbox {
 public:
  explicit Mailbox(LabHost& host) {
    host.inside([&] { socket_ = Descriptor(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)); });
    const sockaddr_in any = address_of("0.0.0.0");
    if (::bind(socket_.number(), reinterpret_cast<const sockaddr*>(&any), sizeof any) != 0)
      throw Error("cannot bind");
    const timeval patience{.tv_usec = std::chrono::microseconds(kPatience).count()};
    ::setsockopt(socket_.number(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    const int buffer = 4 << 20;
    ::setsockopt(socket_.number(), SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer);
  }

  bool send(const std::string& host, const std::string& text) const {
    const sockaddr_in to = address_of(host);
    return ::sendto(socket_.number(), text.data(), text.size(), 0,
                    reinterpret_cast<const sockaddr*>(&to),
                    sizeof to) == static_cast<ssize_t>(text.size());
  }
  std::optional<std::string> receive() const {
    char text[2000];
    const ssize_t size = ::recv(socket_.number(), text, sizeof text, 0);
    if (size < 0) return std::nullopt;
    return std::string(text, text + size);
  }
  // How many come until none has come for a while.
  int count() const {
    int result = 0;
    while (receive()) ++result;
    return result;
  }
  void join(const std::string& group, LabHost& host) const {
    ip_mreq request{};
    ::inet_pton(AF_INET, group.c_str(), &request.imr_multiaddr);
    ::inet_pton(AF_INET, host.address().c_str(), &request.imr_interface);
    host.inside([&] {
      if (::setsockopt(socket_.number(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof request) !=
          0)
        throw Error("cannot join the group");
    });
  }

 private:
  Descriptor socket_;
};

bool reaches(LabHost& from, LabHost& to) {
  const Mailbox sender(from);
  const Mailbox receiver(to);
  return sender.send(to.address(), "hello") && receiver.receive() == "hello";
}

bool reaches_by_multicast(LabHost& from, LabHost& to) {
  const std::string group = "239.255.0.1";
  const Mailbox sender(from);
  const Mailbox receiver(to);
  receiver.join(group, to);
  return sender.send(group, "hello") && receiver.receive() == "hello";
}

bool eventually(const std::function<bool()>& condition) {
  const auto limit = std::chrono::steady_clock::now() + 10s;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > limit) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

std::vector<pid_t> children_of(pid_t parent) {
  std::vector<pid_t> result;
  const std::string id = std::to_string(parent);
  std::istringstream words(slurp("/proc/" + id + "/task/" + id + "/children"));
  for (pid_t pid = 0; words >> pid;) result.push_back(pid);
  return result;
}

class LabTest : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string reason = Lab::unavailable(); !reason.empty()) GTEST_SKIP() << reason;
  }
};

TEST_F(LabTest, HostsReachEachOtherAndNobodyElse) {
  Lab lab({.hosts = 3});
  EXPECT_TRUE(reaches(lab.host(0), lab.host(2)));
  EXPECT_TRUE(reaches(lab.host(2), lab.host(1)));
  EXPECT_TRUE(reaches_by_multicast(lab.host(0), lab.host(1)));
  Lab other({.hosts = 1});
  const Mailbox sender(other.host(0));
  const Mailbox receiver(lab.host(1));
  sender.send(lab.host(1).address(), "hello");
  EXPECT_EQ(receiver.receive(), std::nullopt);
}

TEST_F(LabTest, MulticastDoesNotPassTheRouter) {
  Lab lab({.hosts = 3, .subnets = 2});
  EXPECT_TRUE(reaches(lab.host(0), lab.host(1)));
  EXPECT_FALSE(reaches_by_multicast(lab.host(0), lab.host(1)));
  EXPECT_TRUE(reaches_by_multicast(lab.host(0), lab.host(2))) << "in one subnet";
}

TEST_F(LabTest, MulticastCanBeAbsent) {
  Lab lab({.hosts = 2, .multicast = false});
  EXPECT_TRUE(reaches(lab.host(0), lab.host(1)));
  EXPECT_FALSE(reaches_by_multicast(lab.host(0), lab.host(1)));
}

TEST_F(LabTest, LossDropsItsShareEachWay) {
  Lab lab;
  ASSERT_TRUE(reaches(lab.host(0), lab.host(1))) << "they know each other's cards from here on";
  lab.host(0).shape({.loss = 0.25});
  for (const int from : {0, 1}) {
    LabHost& to = lab.host(1 - from);
    const Mailbox sender(lab.host(from));
    const Mailbox receiver(to);
    for (int i = 0; i < 2000; ++i) sender.send(to.address(), "x");
    EXPECT_NEAR(receiver.count(), 1500, 6 * 19) << "6 standard deviations";
  }
  lab.host(0).shape({});
  EXPECT_TRUE(reaches(lab.host(0), lab.host(1)));
}

TEST_F(LabTest, DelayHoldsPacketsBackEachWayAndKeepsTheirOrder) {
  Lab lab;
  lab.host(1).shape({.delay = 40ms});
  {
    const Mailbox one(lab.host(0));
    const Mailbox other(lab.host(1));
    for (int round = 0; round < 3; ++round) {
      const auto start = std::chrono::steady_clock::now();
      one.send(lab.host(1).address(), "there");
      ASSERT_EQ(other.receive(), "there");
      other.send(lab.host(0).address(), "back");
      ASSERT_EQ(one.receive(), "back");
      EXPECT_GE(std::chrono::steady_clock::now() - start, 80ms);
    }
    for (int i = 0; i < 1000; ++i) one.send(lab.host(1).address(), std::to_string(i));
    for (int i = 0; i < 1000; ++i) ASSERT_EQ(other.receive(), std::to_string(i));
  }
  EXPECT_TRUE(reaches_by_multicast(lab.host(0), lab.host(1)));
  lab.host(1).shape({});
  EXPECT_TRUE(reaches(lab.host(0), lab.host(1)));
}

TEST_F(LabTest, RateHoldsPacketsBack) {
  Lab lab;
  lab.host(0).shape({.rate = 10.0});
  const Mailbox sender(lab.host(0));
  const Mailbox receiver(lab.host(1));
  const auto start = std::chrono::steady_clock::now();
  // 100 kB wait for 80 ms, less the 32 kB that may go at once.
  for (int i = 0; i < 100; ++i) sender.send(lab.host(1).address(), std::string(1000, 'x'));
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(receiver.receive());
  EXPECT_GE(std::chrono::steady_clock::now() - start, 50ms);
}

TEST_F(LabTest, CutLinkCarriesNothingUntilItIsRestored) {
  Lab lab({.hosts = 3});
  for (const bool delayed : {false, true}) {
    lab.host(1).shape({.delay = delayed ? 1ms : 0ms});
    lab.host(1).cut();
    EXPECT_FALSE(reaches(lab.host(0), lab.host(1)));
    EXPECT_FALSE(reaches(lab.host(1), lab.host(0)));
    EXPECT_TRUE(reaches(lab.host(0), lab.host(2)));
    lab.host(1).restore();
    // Who was in vain asked for the address of its card is asked again once a second.
    EXPECT_TRUE(eventually([&] { return reaches(lab.host(0), lab.host(1)); }));
  }
}

TEST_F(LabTest, HostsCanHaveTheirOwnSharedMemory) {
  Lab lab({.hosts = 2, .own_shm = true});
  EXPECT_EQ(lab.host(0).run({"/usr/bin/touch", "/dev/shm/cosegraph_lab_test"}).status, 0);
  EXPECT_EQ(lab.host(0).run({"/bin/ls", "/dev/shm"}).output, "cosegraph_lab_test\n");
  EXPECT_EQ(lab.host(1).run({"/bin/ls", "/dev/shm"}).output, "");
  EXPECT_FALSE(std::filesystem::exists("/dev/shm/cosegraph_lab_test"));
  lab.host(0).inside([] { EXPECT_TRUE(std::filesystem::exists("/dev/shm/cosegraph_lab_test")); });
}

TEST_F(LabTest, ProgramsRunInTheirHostAndTellHowTheyEnded) {
  Lab lab;
  const Outcome outcome =
      lab.host(1).run({"/bin/sh", "-c", "ip -brief address show eth0; pwd; echo bad >&2; exit 3"});
  EXPECT_EQ(outcome.status, 3);
  EXPECT_THAT(outcome.output, HasSubstr(lab.host(1).address() + "/24"));
  EXPECT_THAT(outcome.output, HasSubstr(std::filesystem::current_path().string() + "\n"));
  EXPECT_EQ(outcome.errors, "bad\n");
  EXPECT_EQ(lab.host(1).run({"/no/such/program"}).status, 127);

  Child child = lab.host(0).start({"/bin/sleep", "100"});
  EXPECT_TRUE(child.running());
  EXPECT_EQ(child.wait(20ms).status, -1);
  child.signal(SIGTERM);
  EXPECT_EQ(child.wait().status, 128 + SIGTERM);
}

TEST_F(LabTest, LeavesNothingRunning) {
  std::vector<pid_t> pids;
  {
    Lab lab;
    Child orphaned = lab.host(0).start({"/bin/sh", "-c", "sleep 100 & sleep 100 & wait"});
    while (pids.size() < 2) {
      pids = children_of(orphaned.pid());
      std::this_thread::sleep_for(1ms);
    }
  }
  // One that is dead but has not been waited for by its new parent is gone as well.
  const auto is_gone = [](pid_t pid) {
    const std::string status = slurp("/proc/" + std::to_string(pid) + "/status");
    return status.empty() || status.find("State:\tZ") != std::string::npos;
  };
  EXPECT_TRUE(eventually([&] { return std::ranges::all_of(pids, is_gone); }));
}

}  // namespace
}  // namespace cosegraph::test
