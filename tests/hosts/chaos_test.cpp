// A graph on three hosts, of which any process may be killed and any link cut at any moment, while
// stages are swapped: every frame is accounted for, nothing comes out wrong, nothing is left.
//
// COSEGRAPH_CHAOS_FRAMES (500, a quarter of a minute) makes it longer, COSEGRAPH_CHAOS_SEED (1)
// another one.
#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <iostream>
#include <map>
#include <optional>

#include "core/random.hpp"
#include "graph_agent/toy_graph.hpp"
#include "hosts/lab.hpp"

namespace cosegraph::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using testing::IsEmpty;

constexpr std::array kStages = {"numbers", "left", "right", "keep"};
constexpr std::array kHosts = {"one", "two", "three"};

long number_from_environment(const char* name, long otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::atol(text);
}

std::string hosts_line(Lab& lab) {
  std::string line = "hosts: {";
  for (std::size_t i = 0; i < kHosts.size(); ++i)
    line += std::string(i == 0 ? "" : ", ") + kHosts[i] +
            ": {address: " + lab.host(static_cast<int>(i)).address() + "}";
  return line + "}\n";
}

class Chaos {
 public:
  explicit Chaos(int frames, std::uint64_t seed)
      : frames_(frames),
        random_(seed),
        lab_({.hosts = static_cast<int>(kHosts.size())}),
        graph_(
            {.count = frames,
             .rate = 100,
             .extra = "replicas: {one: 1, two: 1, three: 1}, ",
             .hosts = hosts_line(lab_),
             .host_of = {{"numbers", "one"}, {"left", "two"}, {"right", "three"}, {"keep", "one"}},
             .deadline = 15}) {
    for (int i = 0; i < lab_.size(); ++i) start_agent(i);
  }

  // Until the source has taken everything and every frame is over.
  void run(int kills, int swaps) {
    const auto begin = Clock::now();
    auto next_kill = begin + 2s;
    auto next_swap = begin + 3s;
    const auto kill_period = std::chrono::milliseconds(10L * frames_ / (kills + 1));
    const auto swap_period = std::chrono::milliseconds(10L * frames_ / (swaps + 1));
    const auto limit = begin + 60s + 60ms * frames_;
    began_ = begin;
    int written = -1;
    auto changed = begin;
    bool told = false;
    while (Clock::now() < limit) {
      std::this_thread::sleep_for(20ms);
      const auto now = Clock::now();
      if (kills_ < kills && now >= next_kill) {
        disturb();
        next_kill = now + kill_period;
      }
      if (swaps_ < swaps && now >= next_swap && (!swap_ || !swap_->running())) {
        count_swap();
        swap();
        next_swap = now + swap_period;
      }
      mend();
      if (const int count = graph_.written(); count != written) {
        written = count;
        changed = now;
        if (told) tell("goes on at " + std::to_string(written));
        told = false;
      }
      if (!told && now - changed > 3s) {
        tell("stalls at " + std::to_string(written));
        std::clog << lab_.host(0).run({"cosegraph", "ps", graph_.file(), "--edges"}).output;
        told = true;
      }
      // All that can come out has: the rest failed, and the account tells so.
      if (kills_ >= kills && (written >= frames_ || now - changed > 5s) && is_over()) break;
    }
    mend(true);
    if (swap_) swap_->wait(60s);
    count_swap();
    seconds_ = std::chrono::duration<double>(Clock::now() - begin).count();
  }

  void expect_closed_account() {
    const auto account = this->account();
    ASSERT_FALSE(account.is_null());
    EXPECT_EQ(account["admitted"], frames_);
    const int labelled = account["labelled"];
    const int failed = account["failed"];
    EXPECT_EQ(labelled + failed, frames_) << account;
    EXPECT_GE(graph_.written(), labelled) << "what is called labelled has come out";
    // Of each source that was killed what it had in flight.
    EXPECT_LE(failed, 4 * source_kills_ + frames_ / 100) << account;
    for (int i = 0; i < frames_; ++i) {
      const double value = graph_.value(i);
      if (value < 0.0) continue;  // failed
      const double added = value - 2.0 * i;
      EXPECT_TRUE(added == 3.0 || added == 12.0) << "frame " << i << " came out as " << value;
    }
    std::cout << "{\"frames\": " << frames_ << ", \"labelled\": " << labelled
              << ", \"failed\": " << failed << ", \"kills\": " << kills_
              << ", \"of_sources\": " << source_kills_ << ", \"of_agents\": " << agent_kills_
              << ", \"cuts\": " << cuts_ << ", \"swaps\": " << swaps_
              << ", \"swaps_done\": " << swaps_done_ << ", \"lost_in_swaps\": " << lost_
              << ", \"doubled_in_swaps\": " << doubled_ << ", \"seconds\": " << seconds_ << "}\n";
    EXPECT_EQ(lost_, 0);
    EXPECT_EQ(doubled_, 0);
  }

  void expect_nothing_left() {
    const Outcome down = lab_.host(0).run({"cosegraph", "down", graph_.file()});
    EXPECT_EQ(down.status, 0) << down.errors;
    for (auto& agent : agents_) {
      const Outcome outcome = agent->wait(20s);
      EXPECT_EQ(outcome.status, 0) << outcome.errors;
    }
    EXPECT_THAT(graph_.pids(), IsEmpty()) << "a process was left behind";
  }

 private:
  void start_agent(int host) {
    agents_.at(static_cast<std::size_t>(host))
        .emplace(lab_.host(host).start({"cosegraph", "agent", "--host",
                                        kHosts.at(static_cast<std::size_t>(host)), graph_.file(),
                                        "--allow-exec"}));
  }

  void disturb() {
    ++kills_;
    const std::size_t dice = random_.below(10);
    if (dice < 2) {
      const auto host = random_.below(kHosts.size());
      ++agent_kills_;
      tell("kill agent " + std::string(kHosts[host]));
      agents_[host]->signal(SIGKILL);
    } else if (dice < 4 && !cut_) {
      ++cuts_;
      cut_ = static_cast<int>(random_.below(kHosts.size()));
      lab_.host(*cut_).cut();
      tell("cut " + std::string(kHosts.at(static_cast<std::size_t>(*cut_))));
      restore_at_ = Clock::now() + std::chrono::milliseconds(300 + random_.below(1500));
    } else {
      const std::string stage = kStages.at(random_.below(kStages.size()));
      const auto pids = graph_.pids("--stage " + stage + " ");
      if (pids.empty()) return;
      if (stage == "numbers") ++source_kills_;
      const pid_t pid = pids[random_.below(pids.size())];
      tell("kill " + stage + " " + std::to_string(pid));
      ::kill(pid, SIGKILL);
    }
  }

  void mend(bool all = false) {
    if (cut_ && (all || Clock::now() >= restore_at_)) {
      lab_.host(*cut_).restore();
      tell("restore");
      cut_.reset();
    }
    for (int i = 0; i < lab_.size(); ++i)
      if (!agents_[static_cast<std::size_t>(i)]->running()) start_agent(i);
  }

  void swap() {
    ++swaps_;
    const std::string stage = kStages.at(random_.below(kStages.size()));
    std::vector<std::string> words{"cosegraph", "swap", stage, "--graph", graph_.file(), "--json"};
    if (stage == "left")
      words.insert(words.end(), {"--param", swaps_ % 2 == 1 ? "value=10" : "value=1"});
    tell("swap " + stage);
    swap_.emplace(lab_.host(0).start(words));
  }

  // What happened when: to be read where a run ends badly.
  void tell(const std::string& what) const {
    std::clog << std::chrono::duration<double>(Clock::now() - began_).count() << " s: " << what
              << "\n";
  }

  // A swap may fail where processes die; what it reports must be right.
  void count_swap() {
    if (!swap_) return;
    const auto report = nlohmann::json::parse(swap_->output(), nullptr, false);
    tell("swapped: " + swap_->output());
    swap_.reset();
    if (report.is_discarded() || !report.contains("lost")) return;
    ++swaps_done_;
    // Frames of a source that was killed meanwhile have failed, with that reason.
    lost_ += std::max(0, report["lost"].get<int>() - 4 * source_kills_);
    doubled_ += report["doubled"].get<int>() > 8 ? 1 : 0;
  }

  nlohmann::json account() {
    const Outcome ps = lab_.host(0).run({"cosegraph", "ps", graph_.file(), "--json"});
    const auto json = nlohmann::json::parse(ps.output, nullptr, false);
    return json.is_discarded() ? nlohmann::json() : json["account"];
  }

  bool is_over() {
    const auto account = this->account();
    return !account.is_null() &&
           account["labelled"].get<int>() + account["failed"].get<int>() == frames_;
  }

  int frames_;
  Clock::time_point began_ = Clock::now();
  Random random_;
  Lab lab_;
  ToyGraph graph_;
  std::array<std::optional<Child>, kHosts.size()> agents_;
  std::optional<Child> swap_;
  std::optional<int> cut_;
  Clock::time_point restore_at_{};
  int kills_ = 0;
  int source_kills_ = 0;
  int agent_kills_ = 0;
  int cuts_ = 0;
  int swaps_ = 0;
  int swaps_done_ = 0;
  int lost_ = 0;
  int doubled_ = 0;
  double seconds_ = 0.0;
};

TEST(Chaos, EveryFrameIsAccountedForWhateverDies) {
  if (const auto reason = Lab::unavailable(); !reason.empty()) GTEST_SKIP() << reason;
  const int frames = static_cast<int>(number_from_environment("COSEGRAPH_CHAOS_FRAMES", 500));
  const auto seed = static_cast<std::uint64_t>(number_from_environment("COSEGRAPH_CHAOS_SEED", 1));
  Chaos chaos(frames, seed);
  chaos.run(std::max(20, frames / 50), std::max(5, frames / 1000));
  chaos.expect_closed_account();
  chaos.expect_nothing_left();
}

}  // namespace
}  // namespace cosegraph::test
