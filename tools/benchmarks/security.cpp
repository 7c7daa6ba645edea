#include <sys/resource.h>

#include <cstdio>
#include <cstdlib>
#include <map>
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
  const std::string command = program() + " " + arguments + " > /dev/null";
  if (std::system(command.c_str()) != 0) throw std::runtime_error("failed: " + command);
}

// The shipped graph of queries with a line more in its head.
void write_graph(const fs::path& file, const std::string& line) {
  const fs::path folder = fs::read_symlink("/proc/self/exe").parent_path().parent_path();
  std::string text = io::read_file(folder / "share" / "cosegraph" / "graphs" / "segment.yaml");
  text.insert(text.find("stages:"), line);
  io::write_file(file, text);
}

// Milliseconds of all programs that were waited for.
double cpu_of_children() {
  rusage usage{};
  ::getrusage(RUSAGE_CHILDREN, &usage);
  return milliseconds(usage.ru_utime) + milliseconds(usage.ru_stime);
}

// `how`: "run" or "up". The CPU time is that of all processes.
Spent stream(const fs::path& folder, const char* how, const char* graph, const char* queries) {
  const double before = cpu_of_children();
  Spent spent = measure([&] {
    run(std::string(how) + " " + (folder / graph).string() +
        " --param descriptors.threads=1 --param model.file=" + (folder / "model.coseg").string() +
        " --param source.path=" + (folder / queries).string() +
        " --param sink.folder=" + (folder / "out").string());
  });
  spent.cpu = cpu_of_children() - before;
  return spent;
}

struct Times {
  std::vector<double> wall;
  std::vector<double> cpu;
  std::vector<double> start;
};

}  // namespace

// Medians of per-frame times, which are differences between a long and a short stream, so that
// start-up cancels.
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
  constexpr int kRounds = 3;  // plain and encrypted in turn, so that both see the same machine
  for (const char* how : {"run", "up"}) {
    std::map<std::string, Times> times;
    for (int round = 0; round < kRounds; ++round)
      for (const char* graph : {"plain.yaml", "secure.yaml"}) {
        const Spent whole = stream(folder, how, graph, "long");
        const Spent part = stream(folder, how, graph, "short");
        Times& found = times[graph];
        found.wall.push_back((whole.wall - part.wall) / (frames - few));
        found.cpu.push_back((whole.cpu - part.cpu) / (frames - few));
        found.start.push_back(part.wall - few * found.wall.back());
      }
    const double plain = median(times["plain.yaml"].wall);
    const double plain_cpu = median(times["plain.yaml"].cpu);
    for (const auto& [graph, found] : times)
      std::printf(
          "  %-18s %-11s %7.1f ms per frame (%.2f x plain), CPU %7.1f ms (%.2f x); start-up and "
          "end %.0f ms\n",
          std::string(how) == "run" ? "one process" : "process per stage", graph.c_str(),
          median(found.wall), median(found.wall) / plain, median(found.cpu),
          median(found.cpu) / plain_cpu, median(found.start));
  }
  return 0;
}

}  // namespace cosegraph::bench
