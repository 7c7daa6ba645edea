// What somebody sees who records the traffic.
#include <gtest/gtest.h>
#include <linux/if_ether.h>
#include <net/if.h>
#include <netinet/in.h>
#include <netpacket/packet.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <cstring>
#include <thread>

#include "graph/dds.hpp"
#include "graph_security/raw.hpp"
#include "graph_security/world.hpp"

namespace cosegraph::graph::test {
namespace {

// Records every packet of the loopback device, on which all traffic within a host goes.
class Recorder {
 public:
  Recorder() : socket_(::socket(AF_PACKET, SOCK_RAW, htons(ETH_P_ALL))) {
    if (socket_ < 0) return;
    const int buffer = 32 << 20;
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUFFORCE, &buffer, sizeof buffer);
    sockaddr_ll address{};
    address.sll_family = AF_PACKET;
    address.sll_protocol = htons(ETH_P_ALL);
    address.sll_ifindex = static_cast<int>(::if_nametoindex("lo"));
    if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return;
    thread_ = std::thread([this] { record(); });
  }
  ~Recorder() {
    finish();
    if (socket_ >= 0) ::close(socket_);
  }
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  bool works() const { return thread_.joinable(); }
  // Everything so far, packets one after the other.
  const std::string& finish() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    return bytes_;
  }

 private:
  void record() {
    std::array<char, 70'000> packet;
    for (;;) {
      pollfd waiting{.fd = socket_, .events = POLLIN, .revents = 0};
      if (::poll(&waiting, 1, 20) > 0) {
        const ssize_t size = ::recv(socket_, packet.data(), packet.size(), 0);
        if (size > 0) bytes_.append(packet.data(), static_cast<std::size_t>(size));
      } else if (stop_) {
        return;
      }
    }
  }

  int socket_;
  std::atomic<bool> stop_ = false;
  std::string bytes_;
  std::thread thread_;
};

// Points that occur nowhere else.
Cloud marked_cloud() {
  Cloud cloud;
  for (int i = 0; i < 300; ++i) cloud.xyz.push_back(4321.5F + 0.37F * static_cast<float>(i));
  cloud.width = 100;
  return cloud;
}

std::string some_points() {
  const Cloud cloud = marked_cloud();
  std::string bytes(8 * sizeof(float), '\0');
  std::memcpy(bytes.data(), cloud.xyz.data() + 150, bytes.size());
  return bytes;
}

// The traffic while a cloud goes from `camera` to `grow`.
std::string recorded(const GraphDescription& graph) {
  Recorder recorder;
  EXPECT_TRUE(recorder.works());
  std::atomic<bool> arrived = false;
  Participant grow(graph, "grow", Identity::of_stage("grow"));
  const auto reader = grow.reader("g/camera/dense", "Cloud", {}, [&](const Sample& sample) {
    const std::string bytes(sample->begin(), sample->end());
    arrived = bytes.find(some_points()) != std::string::npos;
  });
  Participant camera(graph, "camera", Identity::of_stage("camera"));
  const auto writer = camera.writer("g/camera/dense", "Cloud", {});
  writer->write(idl::encode({.graph = "g"}, marked_cloud()));
  EXPECT_TRUE(comes_true([&] { return arrived.load(); }));
  return recorder.finish();
}

bool contains(const std::string& traffic, const std::string& bytes) {
  return traffic.find(bytes) != std::string::npos;
}

TEST(Wire, ShowsPointsWithoutSecurityAndNoneWithIt) {
  if (!Recorder().works()) GTEST_SKIP() << "recording traffic needs the right to (CAP_NET_RAW)";
  deliver_by_network();
  KeyWorld world;
  const std::string open = recorded(world.without_keys());
  EXPECT_TRUE(contains(open, "RTPS"));
  EXPECT_TRUE(contains(open, some_points()));
  EXPECT_TRUE(contains(open, "camera/dense"));

  const std::string secure = recorded(world.graph());
  EXPECT_TRUE(contains(secure, "RTPS"));
  EXPECT_TRUE(contains(secure, "CN=stage.camera,O=g")) << "permissions are sent as they are";
  EXPECT_FALSE(contains(secure, some_points()));
}

}  // namespace
}  // namespace cosegraph::graph::test
