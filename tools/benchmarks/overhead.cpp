#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <stdexcept>

#include "io/cloud_io.hpp"
#include "io/file.hpp"
#include "model/model.hpp"
#include "pipeline/pipeline.hpp"
#include "sink/results.hpp"
#include "sink/sink.hpp"
#include "tools/benchmarks/bench.hpp"

namespace cosegraph::bench {
namespace {

namespace fs = std::filesystem;

// What `cosegraph segment` does with a file, as plain calls.
void direct(const fs::path& file, const Model& model, const pipeline::Config& config,
            const fs::path& folder, sink::ResultsText& results) {
  const pipeline::Result result = pipeline::segment(io::read_cloud(file), model, config);
  const sink::Labelled labelled = sink::to_input(result.features.frame.input, result.labelling);
  const io::Column confidence{.name = "confidence", .value = labelled.confidence};
  io::write_cloud(folder / file.filename(), labelled.cloud, {&confidence, 1});
  const auto growth = results.add(
      sink::result_of(file.stem(), result.features.frame.input, result.segments, result.labelling));
  io::replace_end(folder / "results.json", growth.at, growth.bytes);
}

// Wall milliseconds of `cosegraph segment` on a folder of queries.
double through_graph(const fs::path& model, const fs::path& queries, const fs::path& out,
                     const std::string& options) {
  const std::string command = program() + " segment --model " + model.string() + " " +
                              queries.string() + " -o " + out.string() +
                              " --param descriptors.threads=1 " + options + " > /dev/null";
  int status = 0;
  const Spent spent = measure([&] { status = std::system(command.c_str()); });
  if (status != 0) throw std::runtime_error("failed: " + command);
  return spent.wall;
}

}  // namespace

// Per-frame times are differences between a long and a short stream, so that start-up cancels.
int bench_overhead(int frames) {
  const Subject subject = load_subject();
  const io::TemporaryFolder temporary;
  const fs::path& folder = temporary.path();
  pipeline::Config config = pipeline::config_from_name("fpfh+fv");
  config.descriptors.threads = 1;
  const Model model = pipeline::train(subject.reference, config);
  io::write_file(folder / "model.coseg", model::to_bytes(model));
  const int few = frames / 10;
  for (int i = 0; i < frames; ++i)
    for (const char* stream : {"long", "short"}) {
      fs::create_directories(folder / stream);
      if (std::string(stream) == "long" || i < few)
        io::write_cloud(folder / stream / ("q" + std::to_string(i) + ".ply"),
                        subject.queries[static_cast<std::size_t>(i) % subject.queries.size()]);
    }

  sink::ResultsText results;
  fs::create_directories(folder / "direct");
  io::write_file(folder / "direct" / "results.json", results.begun());
  const Spent calls = measure([&] {
    for (int i = 0; i < frames; ++i)
      direct(folder / "long" / ("q" + std::to_string(i) + ".ply"), model, config, folder / "direct",
             results);
  });
  const double per_call = calls.wall / frames;
  std::printf("overhead: %s, fpfh+fv, %d frames, one thread per stage\n", subject.name.c_str(),
              frames);
  std::printf("  %-34s %8.1f ms per frame\n", "direct calls", per_call);
  const std::array<std::array<const char*, 2>, 4> ways{
      {{"one process, window 1", "--window 1"},
       {"process per stage, window 1", "--window 1 --processes"},
       {"one process, window 4", "--window 4"},
       {"process per stage, window 4", "--window 4 --processes"}}};
  for (const auto& [name, options] : ways) {
    const double whole =
        through_graph(folder / "model.coseg", folder / "long", folder / "out", options);
    const double part =
        through_graph(folder / "model.coseg", folder / "short", folder / "out", options);
    const double per_frame = (whole - part) / (frames - few);
    std::printf("  %-34s %8.1f ms per frame, %.3f x direct; start-up and end %.0f ms\n", name,
                per_frame, per_frame / per_call, part - few * per_frame);
  }
  return 0;
}

}  // namespace cosegraph::bench
