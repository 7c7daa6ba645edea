#include "hosts/lab.hpp"

#include <fcntl.h>
#include <net/if.h>
#include <sched.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <thread>

#include "core/error.hpp"
#include "hosts/relay.hpp"

namespace cosegraph::test {
namespace {

using namespace std::chrono_literals;
using SteadyClock = std::chrono::steady_clock;

[[noreturn]] void fail(const std::string& what) {
  throw Error(what + ": " + std::strerror(errno));
}

void in_thread(const std::function<void()>& task) {
  std::exception_ptr error;
  std::thread([&] {
    try {
      task();
    } catch (...) {
      error = std::current_exception();
    }
  }).join();
  if (error) std::rethrow_exception(error);
}

Descriptor open_namespace(const char* kind) {
  const std::string file = std::string("/proc/thread-self/ns/") + kind;
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail("cannot open " + file);
  return Descriptor(descriptor);
}

void set_kernel_value(const std::string& file, const char* value) {
  std::ofstream stream(file);
  if (!(stream << value << std::flush)) throw Error("cannot write " + file);
}

// A namespace with nothing but its loopback device.
Descriptor new_network() {
  Descriptor result;
  in_thread([&] {
    if (::unshare(CLONE_NEWNET) != 0) fail("cannot make a network namespace");
    // Addresses of version 6 take a second to come up, and nothing uses them.
    if (std::filesystem::exists("/proc/sys/net/ipv6"))
      set_kernel_value("/proc/sys/net/ipv6/conf/all/disable_ipv6", "1");
    result = open_namespace("net");
  });
  return result;
}

// The files of this process, but with an empty /dev/shm.
Descriptor new_mounts() {
  Descriptor result;
  in_thread([&] {
    if (::unshare(CLONE_FS | CLONE_NEWNS) != 0) fail("cannot make a mount namespace");
    if (::mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0)
      fail("cannot make mounts private");
    if (::mount("tmpfs", "/dev/shm", "tmpfs", MS_NOSUID | MS_NODEV, "mode=1777") != 0)
      fail("cannot mount /dev/shm");
    result = open_namespace("mnt");
  });
  return result;
}

void enter(int net, int mount) {
  if (net >= 0 && ::setns(net, CLONE_NEWNET) != 0) fail("cannot enter a network namespace");
  if (mount >= 0 && (::unshare(CLONE_FS) != 0 || ::setns(mount, CLONE_NEWNS) != 0))
    fail("cannot enter a mount namespace");
}

// Root's PATH often lacks the folders for root's programs.
std::string system_program(const std::string& name) {
  for (const std::string folder : {"/usr/sbin/", "/sbin/", "/usr/bin/", "/bin/"})
    if (::access((folder + name).c_str(), X_OK) == 0) return folder + name;
  throw Error(name + " is not installed");
}

// The kernel may take a second to notice that a cable was plugged in.
void await_link(const std::string& device) {
  const Descriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ifreq request{};
  device.copy(request.ifr_name, IFNAMSIZ - 1);
  const auto limit = SteadyClock::now() + 10s;
  while (::ioctl(socket.number(), SIOCGIFFLAGS, &request) == 0 &&
         (request.ifr_flags & IFF_RUNNING) == 0) {
    if (SteadyClock::now() > limit) throw Error("the device " + device + " does not come up");
    std::this_thread::sleep_for(2ms);
  }
}

bool is_in_network(const std::string& pid, const struct stat& network) {
  struct stat other {};
  return ::stat(("/proc/" + pid + "/ns/net").c_str(), &other) == 0 &&
         other.st_ino == network.st_ino && other.st_dev == network.st_dev;
}

std::vector<pid_t> processes_in(int net) {
  struct stat network {};
  if (::fstat(net, &network) != 0) fail("cannot look at a namespace");
  std::vector<pid_t> result;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename().string();
    pid_t pid = 0;
    const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), pid);
    if (error == std::errc() && *end == '\0' && pid != ::getpid() && is_in_network(name, network))
      result.push_back(pid);
  }
  return result;
}

void kill_all_in(int net) {
  // Again, as one of them may have started another meanwhile.
  for (auto pids = processes_in(net); !pids.empty(); pids = processes_in(net)) {
    for (const pid_t pid : pids) ::kill(pid, SIGKILL);
    std::this_thread::sleep_for(1ms);
  }
}

}  // namespace

Descriptor::~Descriptor() {
  if (number_ >= 0) ::close(number_);
}

// -- Child ---------------------------------------------------------------------------------------

Child::Child(std::vector<std::string> words, int net, int mount)
    : folder_(std::make_unique<TemporaryFolder>()) {
  if (words.at(0).find('/') == std::string::npos)
    words[0] = std::string(COSEGRAPH_BINARY_DIR) + "/bin/" + words[0];
  std::vector<char*> arguments;
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const auto open_file = [&](const char* name) {
    return Descriptor(
        ::open((*folder_ / name).c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  };
  const Descriptor output = open_file("output");
  const Descriptor errors = open_file("errors");
  const Descriptor here(::open(".", O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  const pid_t parent = ::getpid();
  pid_ = ::fork();
  if (pid_ < 0) fail("cannot start " + words[0]);
  if (pid_ == 0) {  // only async-signal-safe calls from here on
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(126);
    if (net >= 0 && ::setns(net, CLONE_NEWNET) != 0) ::_exit(126);
    if (mount >= 0 && ::setns(mount, CLONE_NEWNS) != 0) ::_exit(126);
    if (::fchdir(here.number()) != 0) ::_exit(126);
    ::dup2(output.number(), STDOUT_FILENO);
    ::dup2(errors.number(), STDERR_FILENO);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }
}

Child::Child(Child&& other) noexcept
    : folder_(std::move(other.folder_)),
      pid_(std::exchange(other.pid_, -1)),
      status_(other.status_),
      over_(std::exchange(other.over_, true)) {}

Child::~Child() {
  if (over_) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
}

bool Child::running() {
  if (!over_) over_ = ::waitpid(pid_, &status_, WNOHANG) == pid_;
  return !over_;
}

void Child::signal(int number) const {
  if (!over_) ::kill(pid_, number);
}

std::string Child::output() const {
  return slurp(*folder_ / "output");
}

std::string Child::errors() const {
  return slurp(*folder_ / "errors");
}

Outcome Child::outcome() const {
  Outcome result{.output = output(), .errors = errors()};
  if (over_) result.status = WIFEXITED(status_) ? WEXITSTATUS(status_) : 128 + WTERMSIG(status_);
  return result;
}

Outcome Child::wait() {
  if (!over_) over_ = ::waitpid(pid_, &status_, 0) == pid_;
  return outcome();
}

Outcome Child::wait(std::chrono::milliseconds patience) {
  const auto limit = SteadyClock::now() + patience;
  while (running() && SteadyClock::now() < limit) std::this_thread::sleep_for(5ms);
  return outcome();
}

// -- Network -------------------------------------------------------------------------------------

// What is between the hosts: a bridge per subnet, in a namespace that routes between them.
class Network {
 public:
  explicit Network(const LabOptions& options) : net_(new_network()) {
    std::vector<std::string> lines;
    for (int subnet = 0; subnet < options.subnets; ++subnet) {
      const std::string bridge = bridge_of(subnet);
      lines.insert(lines.end(), {"link add " + bridge + " type bridge mcast_snooping 0",
                                 "addr add " + gateway_of(subnet) + "/24 dev " + bridge,
                                 "link set " + bridge + " up"});
    }
    ip(net(), lines);
    inside([&] { set_kernel_value("/proc/sys/net/ipv4/ip_forward", "1"); });
    if (!options.multicast)
      tool(net(), {"nft",
                   "add table bridge lab; add chain bridge lab pass { type filter hook "
                   "forward priority 0; }; add rule bridge lab pass ip daddr "
                   "224.0.0.0/4 drop"});
  }
  ~Network() { kill_all_in(net()); }

  static std::string bridge_of(int subnet) { return "net" + std::to_string(subnet); }
  static std::string prefix_of(int subnet) { return "10.77." + std::to_string(subnet) + "."; }
  static std::string gateway_of(int subnet) { return prefix_of(subnet) + "254"; }

  int net() const { return net_.number(); }

  void inside(const std::function<void()>& task) const {
    in_thread([&] {
      enter(net(), -1);
      task();
    });
  }

  // Runs a program of the system, which must succeed.
  static void tool(int net, std::vector<std::string> words) {
    std::string text;
    for (const auto& word : words) text += word + " ";
    words[0] = system_program(words[0]);
    const Outcome outcome = Child(std::move(words), net).wait();
    if (outcome.status != 0) throw Error(text + "failed: " + outcome.errors);
  }

  static void ip(int net, const std::vector<std::string>& lines) {
    const TemporaryFolder folder;
    {
      std::ofstream batch(folder / "batch");
      for (const auto& line : lines) batch << line << '\n';
    }
    tool(net, {"ip", "-batch", (folder / "batch").string()});
  }

 private:
  Descriptor net_;
};

// -- LabHost -------------------------------------------------------------------------------------

namespace {

// Packets that come in on `device` vanish with this probability.
void set_loss(int net, const std::string& device, double loss) {
  const std::string table = "netdev lab_" + device;
  std::string text = "add table " + table + "; delete table " + table;
  if (loss > 0.0)
    text += "; add table " + table + "; add chain " + table +
            " pass { type filter hook ingress device " + device + " priority 0; }; add rule " +
            table + " pass numgen random mod 1000000 < " + std::to_string(std::lround(loss * 1e6)) +
            " drop";
  Network::tool(net, {"nft", text});
}

// Packets go out on `device` no faster than this many Mbit/s; what does not fit into 100 ms of it
// is dropped.
void set_rate(int net, const std::string& device, double rate, double before) {
  const std::string megabits = std::to_string(rate) + "mbit";
  if (rate > 0.0)
    Network::tool(net, {"tc", "qdisc", "replace", "dev", device, "root", "tbf", "rate", megabits,
                        "burst", "32k", "latency", "100ms"});
  else if (before > 0.0)
    Network::tool(net, {"tc", "qdisc", "del", "dev", device, "root"});
}

}  // namespace

LabHost::LabHost(Network& network, int index, int subnet, bool own_shm)
    : network_(&network),
      address_(Network::prefix_of(subnet) + std::to_string(index + 1)),
      bridge_(Network::bridge_of(subnet)),
      port_("port" + std::to_string(index)),
      name_("link" + std::to_string(index)),
      net_(new_network()) {
  if (own_shm) mount_ = new_mounts();
  const std::string here =
      "/proc/" + std::to_string(::getpid()) + "/fd/" + std::to_string(net_.number());
  // Segments are cut to packets before they meet loss: gso_max_segs.
  Network::ip(network.net(), {"link add " + port_ +
                                  " gso_max_segs 1 type veth peer name eth0 gso_max_segs 1 "
                                  "netns " +
                                  here,
                              "link set " + port_ + " master " + bridge_ + " up"});
  Network::ip(net_.number(),
              {"link set lo up", "link set eth0 up", "addr add " + address_ + "/24 brd + dev eth0",
               "route add default via " + Network::gateway_of(subnet)});
}

LabHost::LabHost(LabHost&&) noexcept = default;

LabHost::~LabHost() {
  if (net_.number() >= 0) kill_everything();
}

Child LabHost::start(std::vector<std::string> words) const {
  return Child(std::move(words), net_.number(), mount_.number());
}

Outcome LabHost::run(std::vector<std::string> words) const {
  return start(std::move(words)).wait();
}

void LabHost::inside(const std::function<void()>& task) const {
  in_thread([&] {
    enter(net_.number(), mount_.number());
    task();
  });
}

void LabHost::shape(const Link& link) {
  set_loss(network_->net(), port_, link.loss);
  set_loss(net_.number(), "eth0", link.loss);
  set_rate(network_->net(), port_, link.rate, link_.rate);
  set_rate(net_.number(), "eth0", link.rate, link_.rate);
  set_delay(link.delay);
  link_ = link;
}

// With delay, the port is on a bridge of its own, and the relay is the way from there to the
// subnet's.
void LabHost::set_delay(std::chrono::milliseconds delay) {
  if (delay == link_.delay) return;
  if (relay_ != nullptr) {
    Network::ip(network_->net(), {"link set " + port_ + " master " + bridge_, "link del " + name_});
    relay_.reset();
  }
  if (delay == 0ms) return;
  const std::string near = name_ + "a";
  const std::string far = name_ + "b";
  network_->inside([&] { relay_ = std::make_unique<Relay>(near, far, delay); });
  Network::ip(network_->net(),
              {"link add " + name_ + " type bridge mcast_snooping 0", "link set " + name_ + " up",
               "link set " + near + " txqueuelen 20000 master " + name_ + " up",
               "link set " + far + " txqueuelen 20000 master " + bridge_ + " up",
               "link set " + port_ + " master " + name_});
}

void LabHost::cut() {
  Network::ip(network_->net(), {"link set " + port_ + " down"});
}

void LabHost::restore() {
  Network::ip(network_->net(), {"link set " + port_ + " up"});
  await_connection();
}

void LabHost::await_connection() const {
  network_->inside([&] { await_link(port_); });
  inside([] { await_link("eth0"); });
}

void LabHost::kill_everything() const {
  kill_all_in(net_.number());
}

// -- Lab -----------------------------------------------------------------------------------------

Lab::Lab(const LabOptions& options) : network_(std::make_unique<Network>(options)) {
  for (int i = 0; i < options.hosts; ++i)
    hosts_.push_back(LabHost(*network_, i, i % options.subnets, options.own_shm));
  for (const auto& host : hosts_) host.await_connection();
}

Lab::~Lab() = default;

std::string Lab::unavailable() {
  if (::geteuid() != 0) return "needs root, for network namespaces";
  try {
    Lab lab({.hosts = 1, .own_shm = true});
    lab.host(0).shape({.loss = 0.5, .delay = 1ms, .rate = 1.0});
    return "";
  } catch (const Error& error) {
    return error.what();
  }
}

}  // namespace cosegraph::test
