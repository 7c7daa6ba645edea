// The order of events of a swap, without processes.
#include "graph/swap.hpp"

#include <gmock/gmock.h>

namespace cosegraph::graph {
namespace {

using namespace std::chrono_literals;
using idl::ProcessState;
using idl::State;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class SwapTest : public testing::Test {
 protected:
  SwapTest() {
    view_.source = "camera";
    view_.now += 1h;
    status("camera", 0, State::waiting);
    view_.statuses.at({"camera", 0, 0}).first.epoch = 7;
    view_.statuses.at({"camera", 0, 0}).second.settled = 40;
    view_.statuses.at({"camera", 0, 0}).second.account = {.admitted = 43, .labelled = 40};
    status("cpc", 3, State::waiting);
    process("cpc", 3, ProcessState::running);
  }

  static SwapRequest request(bool dry_run = false) {
    SwapRequest request{.stage = "cpc",
                        .old_generation = 3,
                        .new_generation = 4,
                        .old_hosts = {"robot"},
                        .new_hosts = {"rack"},
                        .dry_run = dry_run};
    request.graph.deadline = 30;
    return request;
  }

  idl::StageStatus& status(const std::string& stage, std::uint32_t generation, State state,
                           bool candidate = false) {
    auto& known = view_.statuses[{stage, 0, generation}];
    known.first.stage = stage;
    known.second.state = state;
    known.second.candidate = candidate;
    return known.second;
  }
  void process(const std::string& stage, std::uint32_t generation, ProcessState state) {
    view_.processes[{stage, 0, generation}] = {
        .stage = stage, .generation = generation, .pid = 1, .state = state, .text = "was killed"};
  }
  std::vector<std::string> step(Swap& swap, std::chrono::milliseconds later = 10ms) {
    view_.now += later;
    std::vector<std::string> orders;
    commands_ = swap.step(view_);
    for (const auto& command : commands_)
      orders.push_back(command.verb + " " + std::to_string(command.generation) +
                       (command.host.empty() ? "" : " at " + command.host));
    return orders;
  }
  void newcomer_is_ready() {
    process("cpc", 4, ProcessState::running);
    status("cpc", 4, State::standby, true);
  }
  void old_is_drained() {
    status("cpc", 3, State::drained).next = 42;
    view_.statuses.at({"cpc", 0, 3}).first.epoch = 7;
  }

  GraphView view_;
  std::vector<idl::Command> commands_;
};

TEST_F(SwapTest, GoesFromLaunchToDismissalInOrder) {
  Swap swap(request(), view_.now);
  EXPECT_THAT(step(swap), ElementsAre("retire 4 at robot", "launch 4 at rack"));
  EXPECT_THAT(step(swap), IsEmpty()) << "until the newcomer is ready";
  newcomer_is_ready();
  EXPECT_THAT(step(swap), ElementsAre("drain 4"));
  EXPECT_THAT(step(swap), IsEmpty()) << "until the old one is drained";
  old_is_drained();
  EXPECT_THAT(step(swap), ElementsAre("activate 4"));
  const auto handover = Handover::from_word(commands_[0].words.at(0));
  ASSERT_TRUE(handover);
  EXPECT_EQ(handover->next, (StreamPosition{7, 42}));
  status("cpc", 4, State::waiting, false);
  EXPECT_THAT(step(swap), IsEmpty()) << "until the frames of the old one are over";
  view_.statuses.at({"camera", 0, 0}).second.settled = 43;
  EXPECT_THAT(step(swap), ElementsAre("replace 4 at rack", "replace 4 at robot"));
  EXPECT_TRUE(swap.succeeded());
}

TEST_F(SwapTest, NewcomerThatDiesChangesNothing) {
  Swap swap(request(), view_.now);
  step(swap);
  process("cpc", 4, ProcessState::failed);
  EXPECT_THAT(step(swap), ElementsAre("dismiss 4 at rack", "keep 4 at robot"));
  EXPECT_TRUE(swap.finished());
  EXPECT_FALSE(swap.succeeded());
  EXPECT_THAT(swap.report({}).text, HasSubstr("the newcomer was killed"));
}

TEST_F(SwapTest, NewcomerThatIsNeverReadySaysWhatItLacks) {
  Swap swap(request(), view_.now);
  step(swap);
  process("cpc", 4, ProcessState::running);
  status("cpc", 4, State::starting, true).activity = "nobody feeds input 'cloud'";
  EXPECT_THAT(step(swap, 21s), ElementsAre("dismiss 4 at rack", "keep 4 at robot"));
  EXPECT_THAT(swap.report({}).text, HasSubstr("nobody feeds input 'cloud'"));
}

TEST_F(SwapTest, OldOneIsReleasedIfTheNewcomerDiesAfterTheDrain) {
  Swap swap(request(), view_.now);
  step(swap);
  newcomer_is_ready();
  step(swap);
  old_is_drained();
  step(swap);
  process("cpc", 4, ProcessState::failed);
  EXPECT_THAT(step(swap), ElementsAre("release 4", "dismiss 4 at rack", "keep 4 at robot"));
  EXPECT_FALSE(swap.succeeded());
}

TEST_F(SwapTest, OldOneThatStaysBusyIsReleased) {
  Swap swap(request(), view_.now);
  step(swap);
  newcomer_is_ready();
  step(swap);
  EXPECT_THAT(step(swap, 31s), ElementsAre("release 4", "dismiss 4 at rack", "keep 4 at robot"));
  EXPECT_THAT(swap.report({}).text, HasSubstr("still busy"));
}

TEST_F(SwapTest, DeathOfTheOldOneInItsDrainLeavesAllToTheNewcomer) {
  Swap swap(request(), view_.now);
  step(swap);
  newcomer_is_ready();
  step(swap);
  process("cpc", 3, ProcessState::failed);
  EXPECT_THAT(step(swap), ElementsAre("activate 4"));
  EXPECT_EQ(Handover::from_word(commands_[0].words.at(0))->next, StreamPosition{});
}

// How far a source has come, nobody else can tell.
TEST_F(SwapTest, SourceThatDiesInItsDrainIsStartedAgain) {
  view_.source = "cpc";
  Swap swap(request(), view_.now);
  step(swap);
  newcomer_is_ready();
  step(swap);
  process("cpc", 3, ProcessState::stopped);
  EXPECT_THAT(step(swap), ElementsAre("release 4", "dismiss 4 at rack", "keep 4 at robot"));
}

// Processes that were started again count up by themselves.
TEST_F(SwapTest, PredecessorsMayBeOfAnyGeneration) {
  view_.processes.clear();
  view_.statuses.erase({"cpc", 0, 3});
  status("cpc", 1, State::waiting);
  process("cpc", 1, ProcessState::running);
  Swap swap(request(), view_.now);
  step(swap);
  newcomer_is_ready();
  EXPECT_THAT(step(swap), ElementsAre("drain 4"));
  EXPECT_THAT(step(swap), IsEmpty()) << "it is not drained yet";
  status("cpc", 1, State::drained).next = 42;
  EXPECT_THAT(step(swap), ElementsAre("activate 4"));
  EXPECT_EQ(Handover::from_word(commands_[0].words.at(0))->next.sequence, 42U);
}

TEST_F(SwapTest, DryRunEndsWhenTheNewcomerIsReady) {
  Swap swap(request(true), view_.now);
  step(swap);
  newcomer_is_ready();
  EXPECT_THAT(step(swap), ElementsAre("dismiss 4 at rack", "keep 4 at robot"));
  EXPECT_TRUE(swap.succeeded());
}

TEST_F(SwapTest, AnotherRecipeIsRefused) {
  status("cpc", 3, State::waiting).recipe = "radius=1";
  Swap swap(request(), view_.now);
  step(swap);
  newcomer_is_ready();
  view_.statuses.at({"cpc", 0, 4}).second.recipe = "radius=2";
  EXPECT_THAT(step(swap), ElementsAre("dismiss 4 at rack", "keep 4 at robot"));
  EXPECT_THAT(swap.report({}).text, HasSubstr("[radius=2] instead of [radius=1]"));
}

// Frames 43 .. 45 are admitted while it goes on; 44 comes out twice, 45 not at all.
TEST_F(SwapTest, ReportCountsWhatIsLostAndDoubledAndTheLongestPause) {
  Swap swap(request(), view_.now);
  const auto begin = view_.now;
  step(swap);
  newcomer_is_ready();
  step(swap);
  old_is_drained();
  view_.statuses.at({"camera", 0, 0}).second.account.admitted = 46;
  step(swap);
  status("cpc", 4, State::waiting, false);
  step(swap);
  view_.statuses.at({"camera", 0, 0}).second.settled = 46;
  view_.statuses.at({"camera", 0, 0}).second.account.labelled = 46;
  step(swap, 200ms);
  ASSERT_TRUE(swap.succeeded());
  std::deque<FrameReport> frames;
  for (std::uint64_t i = 0; i < 40; ++i)
    frames.push_back({"sink", 7, i, false, begin - std::chrono::milliseconds(10 * (40 - i))});
  frames.push_back({"sink", 7, 43, true, begin + 90ms});
  frames.push_back({"sink", 7, 44, false, begin + 100ms});
  frames.push_back({"sink", 7, 44, false, begin + 110ms});
  const SwapReport report = swap.report(frames);
  EXPECT_EQ(report.admitted, 3U);
  EXPECT_EQ(report.finished, 2U);
  EXPECT_EQ(report.failed, 1U);
  EXPECT_EQ(report.lost, 1U);
  EXPECT_EQ(report.doubled, 1U);
  EXPECT_NEAR(report.pause_ms, 100.0, 1e-6);
  EXPECT_NEAR(report.usual_ms, 10.0, 1e-6);
}

// Three hosts with a replica each, whose processes have died a different number of times.
class LeftoverSwap : public testing::Test {
 protected:
  void process(std::uint32_t replica, std::uint32_t generation, bool candidate) {
    const ProcessKey key{"left", replica, generation};
    view_.processes[key] = {.stage = "left",
                            .replica = replica,
                            .generation = generation,
                            .pid = 1,
                            .state = ProcessState::running};
    view_.hosts[key] = "host" + std::to_string(replica);
    view_.statuses[key].second.candidate = candidate;
  }
  std::vector<std::string> orders(const std::string& host) const {
    std::vector<std::string> result;
    for (const auto& command : end_leftover_swap(view_, "left", host))
      result.push_back(command.verb + " " + std::to_string(command.generation) +
                       (command.host.empty() ? "" : " at " + command.host));
    return result;
  }
  GraphView view_;
};

TEST_F(LeftoverSwap, NewcomersThatStillStandByGo) {
  process(0, 3, false);
  process(0, 4, true);
  process(1, 1, false);
  process(1, 4, true);
  for (const std::string host : {"host0", "host1"})
    EXPECT_THAT(orders(host),
                ElementsAre("release 4", "dismiss 4 at " + host, "keep 4 at " + host));
}

TEST_F(LeftoverSwap, NewcomersReplaceTheOldOnesOnceOneHasTakenItsPlace) {
  process(0, 3, false);
  process(0, 4, true);
  process(1, 1, false);
  process(1, 4, false);
  for (const std::string host : {"host0", "host1"})
    EXPECT_THAT(orders(host), ElementsAre("activate 4", "replace 4 at " + host));
}

TEST_F(LeftoverSwap, NewcomerIsKeptWhereNothingElseIsLeft) {
  process(0, 4, true);
  EXPECT_THAT(orders("host0"), ElementsAre("activate 4", "replace 4 at host0"));
}

TEST_F(LeftoverSwap, OldOnesGoOnWhereTheNewcomerIsGone) {
  process(0, 3, false);
  EXPECT_THAT(orders("host0"), ElementsAre("release 4", "keep 4 at host0"));
  EXPECT_THAT(orders("host1"), IsEmpty());
}

}  // namespace
}  // namespace cosegraph::graph
