// The benchmark command: the protocol of tools/evaluation with files, a terminal and Ctrl-C.
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>

#include "io/file.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/stop_signals.hpp"
#include "tools/evaluation/evaluation.hpp"
#include "tools/evaluation/paper.hpp"
#include "tools/evaluation/pictures.hpp"
#include "tools/evaluation/report.hpp"
#include "tools/evaluation/tables.hpp"

namespace cosegraph::tools {
namespace {

namespace fs = std::filesystem;

std::string duration(double seconds) {
  const auto s = static_cast<long>(seconds + 0.5);
  char text[32];
  if (s < 60)
    std::snprintf(text, sizeof text, "%ld s", s);
  else if (s < 3600)
    std::snprintf(text, sizeof text, "%ld min %02ld s", s / 60, s % 60);
  else
    std::snprintf(text, sizeof text, "%ld h %02ld min", s / 3600, s / 60 % 60);
  return text;
}

// Progress on stderr: one line that is rewritten on a terminal, else one line per category.
class Display {
 public:
  void show(const evaluation::Status& status) {
    const auto now = std::chrono::steady_clock::now();
    if (!terminal_ || now < next_) return;
    next_ = now + std::chrono::milliseconds(200);
    std::fprintf(stderr, "\r\033[K%3.0f %%  %s (%zu of %zu): %s, %s left", 100.0 * status.done,
                 status.category.c_str(), status.categories_done + 1, status.categories,
                 status.step.c_str(), duration(status.seconds_left).c_str());
  }

  void category_done(const evaluation::Report& report, const evaluation::Status& status) {
    clear();
    const auto& counts = report.categories.back();
    std::fprintf(stderr, "%s (%zu of %zu): %lld pairs", counts.name.c_str(), status.categories_done,
                 status.categories, static_cast<long long>(counts.compatible));
    for (const auto& table : evaluation::tables_of(report))
      if (!table.categories.empty() && table.categories.back().name == counts.name)
        std::fprintf(stderr, ", %s %.1f %%", table.configuration.c_str(),
                     100.0 * table.categories.back().accuracy.mean);
    std::fprintf(stderr, "; %s left\n", duration(status.seconds_left).c_str());
  }

  void clear() const {
    if (terminal_) std::fprintf(stderr, "\r\033[K");
  }

 private:
  bool terminal_ = ::isatty(STDERR_FILENO) == 1;
  std::chrono::steady_clock::time_point next_{};
};

// The figures, after every category; the pictures wait for the end.
void write_tables(const evaluation::Report& report, const fs::path& folder) {
  io::write_file(folder / "pairs.csv", evaluation::pairs_csv(report));
  io::write_file(folder / "table1.csv", evaluation::table_csv(report));
  io::write_file(folder / "table1.md", evaluation::table_markdown(report));
  io::write_file(folder / "differences.csv", evaluation::differences_csv(report));
  io::write_file(folder / "times.csv", evaluation::times_csv(report));
  io::write_file(folder / "confusion.csv", evaluation::confusion_csv(report));
}

void write_pictures(const evaluation::Report& report, const fs::path& folder) {
  io::write_file(folder / "metrics.png", evaluation::metrics_png(report));
  const int shown = evaluation::best_configuration(report).value_or(0);
  io::write_file(folder / "confusion.png", evaluation::confusion_png(report, shown));
  if (evaluation::best_configuration(report))
    io::write_file(folder / "times.png", evaluation::times_png(report));
  io::write_file(folder / "gallery.png", evaluation::gallery_png(report, shown));
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw InputError(folder.string() + ": cannot be made: " + error.message());
}

struct Arguments {
  evaluation::Protocol protocol;
  std::string folder;
  std::string cache;
  bool no_cache = false;
  bool quick = false;
};

// The paper's rows, what we add, and the bounds.
std::vector<std::string> default_configurations() {
  std::vector<std::string> names;
  for (const auto& row : evaluation::paper_rows())
    if (!row.configuration.empty()) names.emplace_back(row.configuration);
  names.insert(names.end(), {"fused+fv", "best", "majority", "oracle"});
  return names;
}

int evaluate(const Arguments& arguments) {
  const evaluation::Protocol& protocol = arguments.protocol;
  const fs::path folder = arguments.folder;
  evaluation::check(protocol);
  make_folder(folder);
  const StopSignals signals;
  Display display;
  const evaluation::Progress progress{
      .stopped = [&] { return signals.asked().load(); },
      .step = [&](const evaluation::Status& status) { display.show(status); },
      .category_done =
          [&](const evaluation::Report& report, const evaluation::Status& status) {
            write_tables(report, folder);
            display.category_done(report, status);
          }};
  evaluation::Keep keep{.results = folder / "finished", .views_after = !arguments.cache.empty()};
  if (!arguments.no_cache)
    keep.views = arguments.cache.empty() ? folder / "cache" : fs::path(arguments.cache);
  const evaluation::Report report = evaluation::evaluate(protocol, progress, keep);
  display.clear();
  write_tables(report, folder);
  if (report.interrupted) {
    std::cerr << "interrupted; the same command goes on from here. What was finished is in "
              << folder.string() << '\n';
    return 1;
  }
  write_pictures(report, folder);
  std::cout << evaluation::summary_markdown(report);
  return 0;
}

}  // namespace

void add_eval_command(CLI::App& app, const Choose& choose) {
  auto* command = app.add_subcommand("eval", "Accuracy on a labelled benchmark");
  command->require_subcommand(1);
  auto* lpsb = command->add_subcommand(
      "lpsb",
      "The paper's evaluation on the Labelled Princeton Segmentation Benchmark: every shape once "
      "the only labelled reference for the views of all others of its category.\n"
      "The same command goes on where it was stopped.");
  auto arguments = std::make_shared<Arguments>();
  evaluation::Protocol& protocol = arguments->protocol;
  protocol.configurations = default_configurations();
  lpsb->add_option("--data", protocol.data, "folder with CATEGORY/N.off and CATEGORY/N_labels.txt")
      ->required();
  lpsb->add_option("--config", protocol.configurations,
                   "configurations: fpfh+fv, shot+bow+iso, ..., best, majority, oracle; default: "
                   "all rows of the paper's Table 1 and ours")
      ->delimiter(',')
      ->default_str("");
  lpsb->add_option("--categories", protocol.categories, "A,B,...; default: all")->delimiter(',');
  auto* shapes =
      lpsb->add_option("--shapes", protocol.shapes, "first shapes of each category; default: all")
          ->check(CLI::Range(2, 1000000));
  auto* query_views =
      lpsb->add_option("--query-views", protocol.query_views, "views of each shape as queries")
          ->check(CLI::Range(1, 1000))
          ->capture_default_str();
  auto* train_views =
      lpsb->add_option("--train-views", protocol.train_views, "views of each reference")
          ->check(CLI::Range(1, 1000))
          ->capture_default_str();
  lpsb->add_option("--seed,--seeds", protocol.seeds,
                   "of everything random; with several (1,2,3) the whole is done once for each")
      ->delimiter(',')
      ->capture_default_str();
  lpsb->add_option("--jobs", protocol.jobs, "threads; default: one per core")
      ->check(CLI::Range(1, 1024));
  lpsb->add_option("--param", protocol.params,
                   "STAGE.NAME=VALUE for all configurations, may be repeated; see 'cosegraph "
                   "stages'")
      ->take_all();
  lpsb->add_flag("--flawed", protocol.flawed,
                 "also shapes whose mesh has holes, is no manifold or has vertices without a face; "
                 "else they are reported and left out");
  lpsb->add_flag("--quick", arguments->quick,
                 "a first impression: 3 shapes of each category, 4 training views and 1 query "
                 "view, unless given otherwise");
  auto* cache = lpsb->add_option("--cache", arguments->cache,
                                 "folder that keeps what depends on a view alone, some MB per "
                                 "view, for further runs; default: OUTPUT/cache, for the category "
                                 "at work only");
  lpsb->add_flag("--no-cache", arguments->no_cache, "keep finished pairs only")->excludes(cache);
  lpsb->add_option("-o,--output", arguments->folder, "folder for the report")->required();
  lpsb->footer(
      "The report: table1.md and table1.csv, pairs.csv, differences.csv, times.csv,\n"
      "confusion.csv, and the pictures metrics.png, times.png, confusion.png, gallery.png.\n"
      "Examples:\n"
      "  cosegraph eval lpsb --data lpsb --quick -o quick\n"
      "  cosegraph eval lpsb --data lpsb --config fpfh+fv,best --categories Cup,Chair -o out\n"
      "  cosegraph eval lpsb --data lpsb --seeds 1,2,3 --query-views 2 -o report");
  lpsb->callback([=] {
    choose([=] {
      if (arguments->quick) {
        evaluation::Protocol& quick = arguments->protocol;
        if (shapes->empty()) quick.shapes = 3;
        if (query_views->empty()) quick.query_views = 1;
        if (train_views->empty()) quick.train_views = 4;
      }
      return evaluate(*arguments);
    });
  });
}

}  // namespace cosegraph::tools
