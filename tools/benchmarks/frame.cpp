#include <cstdio>
#include <map>

#include "pipeline/pipeline.hpp"
#include "tools/benchmarks/bench.hpp"

namespace cosegraph::bench {
namespace {

void bench_config(const Subject& subject, const std::string& name, int repeats) {
  pipeline::Config config = pipeline::config_from_name(name);
  Model model;
  std::vector<double> train_wall;
  std::vector<double> train_cpu;
  for (int i = 0; i < repeats; ++i) {
    const Spent spent = measure([&] { model = pipeline::train(subject.reference, config); });
    train_wall.push_back(spent.wall);
    train_cpu.push_back(spent.cpu);
  }
  std::map<std::string, std::vector<double>> per_stage;
  std::vector<double> wall;
  std::vector<double> cpu;
  for (int i = 0; i < repeats; ++i)
    for (const auto& query : subject.queries) {
      pipeline::Times times;
      const Spent spent = measure([&] { pipeline::segment(query, model, config, &times); });
      wall.push_back(spent.wall);
      cpu.push_back(spent.cpu);
      for (const auto& [stage, milliseconds] : times) per_stage[stage].push_back(milliseconds);
    }
  std::printf(
      "%-14s train (%zu views): wall %7.0f ms, cpu %7.0f ms   query: wall %6.1f ms, "
      "cpu %6.1f ms\n",
      name.c_str(), subject.reference.size(), median(train_wall), median(train_cpu), median(wall),
      median(cpu));
  for (const auto& [stage, milliseconds] : per_stage)
    std::printf("    %-14s %8.2f ms\n", stage.c_str(), median(milliseconds));
}

}  // namespace

int bench_frame(int repeats) {
  const Subject subject = load_subject();
  std::printf("frame: %s, medians of %d repeats over %zu queries, library calls\n",
              subject.name.c_str(), repeats, subject.queries.size());
  for (const char* config : {"fpfh+fv", "fpfh+fv+iso", "shot+fv", "fpfh+bow", "best"})
    bench_config(subject, config, repeats);
  return 0;
}

}  // namespace cosegraph::bench
