#include "hosts/relay.hpp"

#include <fcntl.h>
#include <linux/if.h>
#include <linux/if_tun.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <deque>
#include <vector>

#include "core/error.hpp"

namespace cosegraph::test {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::size_t kLargestFrame = 2048;

int make_device(const std::string& name) {
  const int device = ::open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
  ifreq request{};
  request.ifr_flags = IFF_TAP | IFF_NO_PI;
  name.copy(request.ifr_name, IFNAMSIZ - 1);
  if (device >= 0 && ::ioctl(device, TUNSETIFF, &request) == 0) return device;
  const std::string why = std::strerror(errno);
  if (device >= 0) ::close(device);
  throw Error("cannot make the network device " + name + ": " + why);
}

struct Waiting {
  SteadyClock::time_point due;
  std::vector<char> frame;
};

// Frames on their way to one end.
class Way {
 public:
  Way(int from, int to, std::chrono::milliseconds delay) : from_(from), to_(to), delay_(delay) {}

  void take() {
    char frame[kLargestFrame];
    ssize_t size = 0;
    while ((size = ::read(from_, frame, sizeof frame)) > 0)
      waiting_.push_back({SteadyClock::now() + delay_, {frame, frame + size}});
  }
  void give() {
    for (; !waiting_.empty() && waiting_.front().due <= SteadyClock::now(); waiting_.pop_front()) {
      // A device that takes no more drops the frame, as a full cable would.
      [[maybe_unused]] const ssize_t written =
          ::write(to_, waiting_.front().frame.data(), waiting_.front().frame.size());
    }
  }
  SteadyClock::time_point next_due() const {
    return waiting_.empty() ? SteadyClock::time_point::max() : waiting_.front().due;
  }

 private:
  int from_;
  int to_;
  std::chrono::milliseconds delay_;
  std::deque<Waiting> waiting_;
};

}  // namespace

Relay::Relay(const std::string& one, const std::string& other, std::chrono::milliseconds delay)
    : ends_{make_device(one), -1}, stop_(::eventfd(0, EFD_CLOEXEC)) {
  try {
    ends_[1] = make_device(other);
    thread_ = std::thread([this, delay] { pass(delay); });
  } catch (...) {
    for (const int descriptor : {ends_[0], ends_[1], stop_})
      if (descriptor >= 0) ::close(descriptor);
    throw;
  }
}

Relay::~Relay() {
  ::eventfd_write(stop_, 1);
  thread_.join();
  for (const int descriptor : {ends_[0], ends_[1], stop_}) ::close(descriptor);
}

void Relay::pass(std::chrono::milliseconds delay) const {
  Way there(ends_[0], ends_[1], delay);
  Way back(ends_[1], ends_[0], delay);
  pollfd waits[] = {{.fd = ends_[0], .events = POLLIN, .revents = 0},
                    {.fd = ends_[1], .events = POLLIN, .revents = 0},
                    {.fd = stop_, .events = POLLIN, .revents = 0}};
  while (waits[2].revents == 0) {
    const auto due = std::min(there.next_due(), back.next_due());
    timespec patience{};
    const auto left = std::chrono::nanoseconds(due - SteadyClock::now()).count();
    if (left > 0) patience = {left / 1'000'000'000, left % 1'000'000'000};
    const bool nothing = due == SteadyClock::time_point::max();
    ::ppoll(waits, 3, nothing ? nullptr : &patience, nullptr);
    there.take();
    back.take();
    there.give();
    back.give();
  }
}

}  // namespace cosegraph::test
