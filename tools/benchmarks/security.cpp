#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "io/cloud_io.hpp"
#include "io/file.hpp"
#include "model/model.hpp"
#include "pipeline/pipeline.hpp"
#include "tools/benchmarks/bench.hpp"

namespace cosegraph::bench {
namespace {

namespace fs = std::filesystem;

void run(const std::string& arguments) {
  const fs::path program = fs::read_symlink("/proc/self/exe").parent_path() / "cosegraph";
  const std::string command = program.string() + " " + arguments + " > /dev/null";
  if (std::system(command.c_str()) != 0) throw std::runtime_error("failed: " + command);
}

// The shipped graph of queries with a line more in its head.
void write_graph(const fs::path& file, const std::string& line) {
  const fs::path folder = fs::read_symlink("/proc/self/exe").parent_path().parent_path();
  std::string text = io::read_file(folder / "share" / "cosegraph" / "graphs" / "segment.yaml");
  text.insert(text.find("stages:"), line);
  io::write_file(file, text);
}

// Wall milliseconds of a stream. `how`: "run" or "up".
double stream(const fs::path& folder, const char* how, const char* graph, const char* queries) {
  return measure([&] {
           run(std::string(how) + " " + (folder / graph).string() +
               " --param descriptors.threads=1 --param model.file=" +
               (folder / "model.coseg").string() + " --param source.path=" +
               (folder / queries).string() + " --param sink.folder=" + (folder / "out").string());
         })
      .wall;
}

}  // namespace

// Per-frame times are differences between a long and a short stream, so that start-up cancels.
int bench_security(int frames) {
  const Subject subject = load_subject();
  const io::TemporaryFolder temporary;
  const fs::path& folder = temporary.path();
  const pipeline::Config config = pipeline::config_from_name("fpfh+fv+iso");
  io::write_file(folder / "model.coseg",
                 model::to_bytes(pipeline::train(subject.reference, config)));
  const int few = frames / 10;
  for (int i = 0; i < frames; ++i)
    for (const bool is_long : {true, false}) {
      const fs::path queries = folder / (is_long ? "long" : "short");
      fs::create_directories(queries);
      if (is_long || i < few)
        io::write_cloud(queries / ("q" + std::to_string(i) + ".ply"),
                        subject.queries[static_cast<std::size_t>(i) % subject.queries.size()]);
    }
  write_graph(folder / "plain.yaml", "");
  write_graph(folder / "secure.yaml", "dds: {security: keys}\n");
  run("keys init " + (folder / "secure.yaml").string());

  std::printf("security: %s, fpfh+fv+iso, %d frames, window 4, one thread per stage\n",
              subject.name.c_str(), frames);
  for (const char* how : {"run", "up"}) {
    double plain = 0.0;
    for (const char* graph : {"plain.yaml", "secure.yaml"}) {
      const double whole = stream(folder, how, graph, "long");
      const double part = stream(folder, how, graph, "short");
      const double per_frame = (whole - part) / (frames - few);
      const bool is_plain = plain == 0.0;
      if (is_plain) plain = per_frame;
      std::printf("  %-20s %-10s %8.1f ms per frame, %.3f x plain; start-up and end %.0f ms\n",
                  std::string(how) == "run" ? "one process" : "process per stage",
                  is_plain ? "plain" : "encrypted", per_frame, per_frame / plain,
                  part - few * per_frame);
    }
  }
  return 0;
}

}  // namespace cosegraph::bench
