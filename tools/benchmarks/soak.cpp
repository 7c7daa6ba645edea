#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>

#include "core/random.hpp"
#include "tools/benchmarks/bench.hpp"
#include "tools/benchmarks/running_graph.hpp"

// Stages of a running graph are swapped, and killed, while frames flow.
namespace cosegraph::bench {
namespace {

using namespace std::chrono_literals;
using SystemClock = RunningGraph::Clock;

constexpr std::array kStages = {"supervoxels", "cpc",     "descriptors", "fisher",
                                "svm",         "spectra", "astar",       "sink"};

double milliseconds(SystemClock::duration time) {
  return std::chrono::duration<double, std::milli>(time).count();
}

// Fixed by a seed: the order in which stages are hit.
std::string stage_at(int i, Random& random) {
  return i % 10 == 9 ? "source" : kStages.at(random.below(kStages.size()));
}

// Calls `disturb` with 0, 1, ... `count`-1, each after `spacing` more frames have come out.
void disturb_along(RunningGraph& graph, int count, int spacing,
                   const std::function<void(int)>& disturb) {
  for (int i = 0; i < count; ++i) {
    graph.await_written((i + 1) * spacing);
    if (!graph.running()) return;
    disturb(i);
  }
}

bool print_account(const nlohmann::json& account, int frames) {
  const int labelled = account["labelled"];
  const int failed = account["failed"];
  const bool closed = account["admitted"] == frames && labelled + failed == frames;
  std::printf("  account: admitted %d = labelled %d + failed %d%s\n",
              account["admitted"].get<int>(), labelled, failed, closed ? "" : ": does not close");
  return closed;
}

bool soak_swaps(const Subject& subject, int swaps) {
  constexpr int kSpacing = 100;  // some seconds: a swap takes one
  const int frames = kSpacing * (swaps + 2);
  RunningGraph graph(subject, {.frames = frames});
  Random random(1);
  std::vector<double> excess;
  std::uint64_t lost = 0;
  std::uint64_t doubled = 0;
  int done = 0;
  disturb_along(graph, swaps, kSpacing, [&](int i) {
    const std::string stage = stage_at(i, random);
    const auto report = graph.swap(stage);
    if (!report.is_object() || !report.contains("lost")) {
      std::printf("  swap %d of %s failed\n", i, stage.c_str());
      return;
    }
    ++done;
    lost += report["lost"].get<std::uint64_t>();
    doubled += report["doubled"].get<std::uint64_t>();
    excess.push_back(report["pause_ms"].get<double>() - report["usual_ms"].get<double>());
  });
  graph.await_end();
  std::printf("soak, swaps: %d frames, %d of %d swaps done, %llu lost, %llu doubled\n", frames,
              done, swaps, static_cast<unsigned long long>(lost),
              static_cast<unsigned long long>(doubled));
  std::printf(
      "  longest interval around a swap beyond the usual: median %.0f ms, p90 %.0f, "
      "longest %.0f\n",
      quantile(excess, 0.5), quantile(excess, 0.9), quantile(excess, 1.0));
  return print_account(graph.account(), frames) && done == swaps && lost + doubled == 0;
}

bool soak_kills(const Subject& subject, int kills) {
  constexpr int kSpacing = 30;
  const int frames = kSpacing * (kills + 2);
  RunningGraph graph(subject, {.frames = frames});
  Random random(2);
  std::vector<SystemClock::time_point> times;
  std::uint64_t memory_before = 0;
  std::uint64_t memory_after = 0;
  int of_sources = 0;
  disturb_along(graph, kills, kSpacing, [&](int i) {
    memory_after = graph.memory();
    if (i == kills / 10) memory_before = memory_after;
    const std::string stage = stage_at(i, random);
    if (!graph.kill_stage(stage)) return;
    of_sources += stage == "source" ? 1 : 0;
    times.push_back(SystemClock::now());
  });
  graph.await_end();
  const auto outputs = graph.outputs();
  std::vector<double> usual;
  std::vector<double> pauses(times.size(), 0.0);
  for (std::size_t i = 1; i < outputs.size(); ++i) {
    const double interval = milliseconds(outputs[i] - outputs[i - 1]);
    usual.push_back(interval);
    for (std::size_t k = 0; k < times.size(); ++k)
      if (outputs[i] > times[k] && outputs[i - 1] < times[k] + 2s)
        pauses[k] = std::max(pauses[k], interval);
  }
  std::printf("soak, kills: %d frames, %zu kills (%d of the source)\n", frames, times.size(),
              of_sources);
  std::printf(
      "  longest interval after a kill: median %.0f ms, p90 %.0f, longest %.0f; usual %.0f\n",
      quantile(pauses, 0.5), quantile(pauses, 0.9), quantile(pauses, 1.0), median(usual));
  std::printf("  memory of all stages: %.0f MB after a tenth of the kills, %.0f MB at the last\n",
              1e-6 * static_cast<double>(memory_before), 1e-6 * static_cast<double>(memory_after));
  return print_account(graph.account(), frames);
}

}  // namespace

int bench_soak(int repeats) {
  const Subject subject = load_subject();
  std::printf("soak: %s, fpfh+fv+iso, a process per stage\n", subject.name.c_str());
  const bool swaps = soak_swaps(subject, 10 * repeats);
  const bool kills = soak_kills(subject, 40 * repeats);
  return swaps && kills ? 0 : 1;
}

}  // namespace cosegraph::bench
