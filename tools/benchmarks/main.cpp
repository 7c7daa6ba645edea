#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <iostream>

#include "camera/camera.hpp"
#include "inputs/inputs.hpp"
#include "sample/shapes.hpp"
#include "tools/benchmarks/bench.hpp"

namespace cosegraph::bench {
namespace {

std::vector<Cloud> views_of(const Mesh& mesh, int count) {
  camera::Params params;
  params.count = count;
  std::vector<Cloud> views;
  for (const auto& view : camera::choose_views(mesh, params))
    views.push_back(finite_points(camera::render(mesh, view.direction, view.roll, params)));
  return views;
}

}  // namespace

Subject load_subject() {
  const char* named = std::getenv("COSEGRAPH_DATA");
  const std::filesystem::path folder =
      std::filesystem::path(named != nullptr ? named : "../shared") / "lpsb" / "FourLeg";
  constexpr int kTrainViews = 8;
  constexpr int kQueryViews = 4;
  if (std::filesystem::exists(folder / "381.off"))
    return {.name = "benchmark FourLeg 381 and 383",
            .reference = views_of(inputs::read_labelled_mesh(folder / "381.off"), kTrainViews),
            .queries = views_of(inputs::read_labelled_mesh(folder / "383.off"), kQueryViews)};
  return {.name = "generated mugs 1 and 2",
          .reference = views_of(sample::make(sample::Kind::mug, 1), kTrainViews),
          .queries = views_of(sample::make(sample::Kind::mug, 2), kQueryViews)};
}

double milliseconds(const timeval& time) {
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_usec);
}

std::string program() {
  return (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "cosegraph").string();
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto before = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size()));
  const auto at = values.begin() + std::min(before, std::ssize(values) - 1);
  std::ranges::nth_element(values, at);
  return *at;
}

double median(std::vector<double> values) {
  return quantile(std::move(values), 0.5);
}

}  // namespace cosegraph::bench

int main(int argc, char** argv) {
  using namespace cosegraph;
  CLI::App app("Benchmarks of cosegraph");
  std::string which = "all";
  int repeats = 5;
  // Each with what it is called with per repeat.
  struct Benchmark {
    const char* name;
    int (*run)(int);
    int per_repeat;
  };
  constexpr Benchmark kBenchmarks[] = {
      {"frame", bench::bench_frame, 1},
      {"overhead", bench::bench_overhead, 20},
      {"security", bench::bench_security, 20},
      {"learning", bench::bench_learning, 1},
      {"descriptors", bench::bench_descriptors, 1},
      {"peers", bench::bench_peers, 1},
      {"replicas", bench::bench_replicas, 20},
      {"observers", bench::bench_observers, 1},
      {"soak", bench::bench_soak, 1},
  };
  std::vector<std::string> names;
  std::string list;
  for (const auto& benchmark : kBenchmarks) {
    names.emplace_back(benchmark.name);
    list += names.back() + ", ";
  }
  names.emplace_back("all");
  app.add_option("benchmark", which, list + "or all")->check(CLI::IsMember(names));
  app.add_option("--repeats", repeats, "measurements of which the median is printed")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    int status = 0;
    for (const auto& benchmark : kBenchmarks)
      if (which == benchmark.name || which == "all")
        status |= benchmark.run(benchmark.per_repeat * repeats);
    return status;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
