// The benchmark command: the protocol of tools/evaluation with files, a terminal and Ctrl-C.
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>

#include "io/file.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/evaluation/evaluation.hpp"
#include "tools/evaluation/report.hpp"

namespace cosegraph::tools {
namespace {

namespace fs = std::filesystem;

std::atomic<bool> stop_asked = false;

// The first SIGINT or SIGTERM asks for a clean end, a second one ends at once.
void stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_asked = true; };
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
}

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

void write(const evaluation::Report& report, const fs::path& folder) {
  io::write_file(folder / "pairs.csv", evaluation::pairs_csv(report));
  io::write_file(folder / "table.csv", evaluation::table_csv(report));
  io::write_file(folder / "table.md", evaluation::table_markdown(report));
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw InputError(folder.string() + ": cannot be made: " + error.message());
}

int evaluate(const evaluation::Protocol& protocol, const fs::path& folder) {
  evaluation::check(protocol);
  make_folder(folder);
  stop_on_signals();
  Display display;
  const evaluation::Progress progress{
      .stopped = [] { return stop_asked.load(); },
      .step = [&](const evaluation::Status& status) { display.show(status); },
      .category_done =
          [&](const evaluation::Report& report, const evaluation::Status& status) {
            write(report, folder);
            display.category_done(report, status);
          }};
  const evaluation::Report report = evaluation::evaluate(protocol, progress);
  display.clear();
  write(report, folder);
  if (!report.pairs.empty()) std::cout << evaluation::table_markdown(report);
  if (report.interrupted)
    std::cerr << "interrupted; what was finished is in " << folder.string() << '\n';
  return report.interrupted ? 1 : 0;
}

}  // namespace

void add_eval_command(CLI::App& app, const Choose& choose) {
  auto* command = app.add_subcommand("eval", "Accuracy on a labelled benchmark");
  command->require_subcommand(1);
  auto* lpsb = command->add_subcommand(
      "lpsb", "One-vs-all on the Labelled Princeton Segmentation Benchmark");
  auto protocol = std::make_shared<evaluation::Protocol>();
  auto folder = std::make_shared<std::string>();
  lpsb->add_option("--data", protocol->data, "folder with CATEGORY/N.off and CATEGORY/N_labels.txt")
      ->required();
  lpsb->add_option("--config", protocol->configurations, "configurations, as fpfh+fv or best")
      ->capture_default_str();
  lpsb->add_option("--categories", protocol->categories, "A,B,...; default: all")->delimiter(',');
  lpsb->add_option("--shapes", protocol->shapes, "first shapes of each category; default: all")
      ->check(CLI::Range(2, 1000000));
  lpsb->add_option("--query-views", protocol->query_views, "views of each shape as queries")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  lpsb->add_option("--train-views", protocol->train_views, "views of each reference")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  lpsb->add_option("--seed", protocol->seed, "of everything random")->capture_default_str();
  lpsb->add_option("--jobs", protocol->jobs, "threads; default: one per core")
      ->check(CLI::Range(1, 1024));
  lpsb->add_option("--param", protocol->params,
                   "STAGE.NAME=VALUE for all configurations, may be repeated; see 'cosegraph "
                   "stages'")
      ->take_all();
  lpsb->add_option("-o,--output", *folder, "folder for pairs.csv, table.csv and table.md")
      ->required();
  lpsb->footer(
      "Example:\n"
      "  cosegraph eval lpsb --data lpsb --config fpfh+fv best --categories Cup,Chair -o out");
  lpsb->callback([=] { choose([=] { return evaluate(*protocol, *folder); }); });
}

}  // namespace cosegraph::tools
