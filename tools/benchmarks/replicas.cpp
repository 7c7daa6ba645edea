#include <algorithm>
#include <cstdio>
#include <map>
#include <thread>

#include "pipeline/pipeline.hpp"
#include "tools/benchmarks/bench.hpp"
#include "tools/benchmarks/running_graph.hpp"

// A graph whose slowest stage runs as one process, and as several.
namespace cosegraph::bench {
namespace {

// Descriptors take most of a frame so.
constexpr const char* kConfig = "fused+fv+iso";
constexpr descriptors::Kernel kKernel = descriptors::Kernel::pcl;
constexpr const char* kStage = "descriptors";

// The stage's share of all the work on a frame, in plain calls with one thread.
double share_of_stage(const Subject& subject) {
  pipeline::Config config = pipeline::config_from_name(kConfig);
  config.descriptors.threads = 1;
  config.descriptors.kernel = kKernel;
  const Model model = pipeline::train(subject.reference, config);
  pipeline::Times times;
  for (const Cloud& query : subject.queries) pipeline::segment(query, model, config, &times);
  double sum = 0.0;
  for (const auto& [stage, time] : times) sum += time;
  return times.at(kStage) / sum;
}

}  // namespace

int bench_replicas(int frames) {
  const Subject subject = load_subject();
  const double share = share_of_stage(subject);
  const double cores = std::max(1U, std::thread::hardware_concurrency());
  std::printf(
      "replicas: %s, %s with PCL's kernels, %d frames, a process per stage, one thread each\n",
      subject.name.c_str(), kConfig, frames);
  std::printf("  %s: %.0f %% of the work on a frame\n", kStage, 1e2 * share);
  constexpr int kRounds = 3;  // in turn, so that all see the same machine
  std::map<int, std::vector<double>> rates;
  for (int round = 0; round < kRounds; ++round)
    for (const int replicas : {1, 2, 3}) {
      RunningGraph graph(subject, {.frames = frames,
                                   .config = kConfig,
                                   .change = [&](graph::GraphDescription& description) {
                                     graph::set_param(description, kStage, "kernel",
                                                      {std::string(to_name(kKernel))});
                                     for (auto& stage : description.stages)
                                       if (stage.name == kStage && replicas > 1)
                                         stage.replicas = {{.host = "", .count = replicas}};
                                   }});
      graph.await_end();
      if (graph.account()["labelled"] != frames) return 1;
      rates[replicas].push_back(graph.rate());
    }
  const double one = median(rates[1]);
  for (const auto& [replicas, found] : rates)
    // The stage alone, and all work on all cores, are what a frame takes at least.
    std::printf("  %d %-9s %6.2f frames/s, %.2f x (at most %.2f on %.0f cores)\n", replicas,
                replicas == 1 ? "process" : "processes", median(found), median(found) / one,
                std::max(share, 1.0 / cores) / std::max(share / replicas, 1.0 / cores), cores);
  return 0;
}

}  // namespace cosegraph::bench
