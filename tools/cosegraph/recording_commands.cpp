// record, info: recordings of running graphs.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "graph/process.hpp"
#include "graph/runs.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/durations.hpp"
#include "tools/cosegraph/stop_signals.hpp"
#include "tools/recording/recorder.hpp"
#include "tools/recording/recording.hpp"

namespace cosegraph::tools {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::ordered_json;

// -- what a recording holds ----------------------------------------------------------------------

std::string size_text(std::uint64_t bytes) {
  char text[32];
  if (bytes < 1000)
    std::snprintf(text, sizeof text, "%llu B", static_cast<unsigned long long>(bytes));
  else if (bytes < 1'000'000)
    std::snprintf(text, sizeof text, "%.1f kB", 1e-3 * static_cast<double>(bytes));
  else
    std::snprintf(text, sizeof text, "%.1f MB", 1e-6 * static_cast<double>(bytes));
  return text;
}

std::string time_text(std::uint64_t nanoseconds) {
  const auto seconds = static_cast<std::time_t>(nanoseconds / 1'000'000'000);
  std::tm utc{};
  ::gmtime_r(&seconds, &utc);
  char text[40];
  const std::size_t length = std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", &utc);
  std::snprintf(text + length, sizeof text - length, ".%03u UTC",
                static_cast<unsigned>(nanoseconds / 1'000'000 % 1000));
  return text;
}

std::uint64_t missing_messages(const recording::TopicCount& count) {
  std::uint64_t sum = count.missing_models.size();
  for (const auto& range : count.missing) sum += range.count();
  return sum;
}

// What a recording has of an epoch, as "frames 0 to 39, the whole stream, 2 failed".
std::string stretch_text(const recording::Stretch& stretch) {
  std::string text = "frames " + std::to_string(stretch.frames.first) + " to " +
                     std::to_string(stretch.frames.last);
  if (stretch.from_start && stretch.to_end)
    text += ", the whole stream";
  else if (!stretch.from_start)
    text += stretch.to_end ? ", the end of the stream" : ", from the middle of the stream";
  if (stretch.failed > 0) text += ", " + std::to_string(stretch.failed) + " failed";
  return text;
}

// "complete", or what is missing.
std::string verdict(const recording::Completeness& completeness) {
  std::uint64_t lost = 0;
  std::uint64_t missing = 0;
  for (const auto& [name, count] : completeness.topics) {
    lost += count.lost;
    missing += missing_messages(count);
  }
  if (lost + missing == 0) return "complete";
  return "incomplete: " + std::to_string(lost) + " messages had no room, " +
         std::to_string(missing) + " never came";
}

ordered_json info_json(const recording::McapReader& reader,
                       const recording::Completeness& completeness) {
  const recording::Statistics& statistics = reader.statistics();
  ordered_json topics = ordered_json::array();
  for (const auto& [id, topic] : recording::topics_in(reader)) {
    const auto messages = statistics.channel_messages.find(id);
    const auto count = completeness.topics.find(topic.name);
    ordered_json missing = ordered_json::array();
    if (count != completeness.topics.end())
      for (const auto& range : count->second.missing)
        missing.push_back({{"epoch", range.epoch}, {"first", range.first}, {"last", range.last}});
    topics.push_back(
        {{"topic", topic.name},
         {"type", topic.type},
         {"latched", topic.latched},
         {"messages", messages == statistics.channel_messages.end() ? 0 : messages->second},
         {"bytes", count == completeness.topics.end() ? 0 : count->second.bytes},
         {"lost", count == completeness.topics.end() ? 0 : count->second.lost},
         {"missing", std::move(missing)},
         {"missing_models", count == completeness.topics.end() ? std::vector<std::uint64_t>{}
                                                               : count->second.missing_models}});
  }
  ordered_json stretches = ordered_json::array();
  for (const auto& stretch : completeness.stretches)
    stretches.push_back({{"epoch", stretch.frames.epoch},
                         {"first", stretch.frames.first},
                         {"last", stretch.frames.last},
                         {"from_start", stretch.from_start},
                         {"to_end", stretch.to_end},
                         {"failed", stretch.failed}});
  return {{"file", reader.file().string()},
          {"bytes", reader.size()},
          {"graph", recording::graph_in(reader).graph},
          {"messages", statistics.messages},
          {"chunks", statistics.chunks},
          {"start", statistics.start_time},
          {"seconds", 1e-9 * static_cast<double>(statistics.end_time - statistics.start_time)},
          {"recovered", !reader.damage().empty()},
          {"damage", reader.damage()},
          {"complete", completeness.has_all()},
          {"ended", completeness.ended},
          {"epochs", std::move(stretches)},
          {"topics", std::move(topics)}};
}

void print_info(const recording::McapReader& reader, const recording::Completeness& completeness) {
  const recording::Statistics& statistics = reader.statistics();
  std::printf("%s: graph %s, %s, %llu messages in %u chunks\n", reader.file().c_str(),
              recording::graph_in(reader).graph.c_str(), size_text(reader.size()).c_str(),
              static_cast<unsigned long long>(statistics.messages), statistics.chunks);
  if (statistics.messages > 0)
    std::printf("from %s, %.3f s\n", time_text(statistics.start_time).c_str(),
                1e-9 * static_cast<double>(statistics.end_time - statistics.start_time));
  for (const auto& stretch : completeness.stretches)
    std::printf("%s\n", stretch_text(stretch).c_str());
  std::printf("%-36s %-16s %9s %10s %6s %8s\n", "topic", "type", "messages", "size", "lost",
              "missing");
  for (const auto& [id, topic] : recording::topics_in(reader)) {
    const auto messages = statistics.channel_messages.find(id);
    const auto found = completeness.topics.find(topic.name);
    const auto count = found == completeness.topics.end() ? recording::TopicCount{} : found->second;
    std::printf("%-36s %-16s %9llu %10s %6llu %8llu\n", topic.name.c_str(), topic.type.c_str(),
                messages == statistics.channel_messages.end()
                    ? 0ULL
                    : static_cast<unsigned long long>(messages->second),
                size_text(count.bytes).c_str(), static_cast<unsigned long long>(count.lost),
                static_cast<unsigned long long>(missing_messages(count)));
  }
  std::printf(
      "%s; %s\n", verdict(completeness).c_str(),
      completeness.ended.empty() ? "the recording was cut off" : completeness.ended.c_str());
  if (!reader.damage().empty()) std::printf("recovered up to %s\n", reader.damage().c_str());
}

int info(const std::string& file, bool json) {
  const recording::McapReader reader(file);
  const recording::Completeness completeness = recording::completeness_in(reader);
  if (json)
    std::cout << info_json(reader, completeness).dump(2) << '\n';
  else
    print_info(reader, completeness);
  return 0;
}

// -- record --------------------------------------------------------------------------------------

struct RecordArguments {
  graph::RunQuery run;
  std::string output;
  std::vector<std::string> topics;
  std::uint64_t max_size = 0;
  bool split = false;
  bool uncompressed = false;
  double last = 0.0;  // s
  bool wait = false;
};

// Whether a run of this graph is known on this machine.
bool is_running(const graph::RunQuery& query) {
  std::error_code error;
  const std::string name = fs::is_regular_file(query.graph, error)
                               ? graph::find_run({.graph = query.graph}).graph
                               : query.graph;
  for (const auto& run : graph::live_runs())
    if (run.graph == name && run.instance.starts_with(query.instance)) return true;
  return false;
}

int record(const RecordArguments& arguments) {
  const StopSignals signals;
  while (arguments.wait && !signals.asked() && !is_running(arguments.run))
    std::this_thread::sleep_for(20ms);
  if (signals.asked()) return 1;
  graph::give_way();
  const graph::GraphDescription graph = graph::find_run(arguments.run);
  recording::RecorderOptions options{.file = {.max_size = arguments.max_size,
                                              .split = arguments.split,
                                              .compressed = !arguments.uncompressed},
                                     .topics = arguments.topics};
  if (arguments.last > 0.0)
    options.last = std::chrono::milliseconds(std::llround(1000.0 * arguments.last));
  recording::Recorder recorder(graph, graph::catalog_of(stage_table()), arguments.output, options);
  std::cerr << "recording graph " << graph.graph << ", Ctrl-C ends it\n";
  std::string reason = "stopped";
  // A run that ended otherwise than with its stream leaves nobody to tell.
  const graph::RunQuery run{.graph = graph.graph, .instance = graph.instance};
  auto looked = std::chrono::steady_clock::now();
  while (!signals.asked() && recorder.step(100ms)) {
    if (graph.instance.empty() || std::chrono::steady_clock::now() - looked < 1s) continue;
    looked = std::chrono::steady_clock::now();
    if (is_running(run)) continue;
    reason = "the run has ended";
    break;
  }
  const auto result = recorder.finish(reason);
  for (const auto& file : result.files) std::cout << file.string() << '\n';
  std::cerr << verdict(result.completeness) << "; " << result.completeness.ended << '\n';
  return result.completeness.has_all() ? 0 : 1;
}

}  // namespace

void add_recording_commands(CLI::App& app, const Choose& choose) {
  auto* info_command = app.add_subcommand("info", "Tells what a recording holds and what it lacks");
  auto file = std::make_shared<std::string>();
  auto json = std::make_shared<bool>(false);
  info_command->add_option("recording", *file, "MCAP file")->required();
  info_command->add_flag("--json", *json, "as JSON");
  info_command->footer("Example:\n  cosegraph info run.mcap");
  info_command->callback([=] { choose([=] { return info(*file, *json); }); });

  auto* record_command = app.add_subcommand(
      "record", "Records the topics of a running graph until its stream is over");
  auto arguments = std::make_shared<RecordArguments>();
  record_command->add_option("graph", arguments->run.graph, "graph that runs: its file or its name")
      ->required();
  record_command->add_option("--instance", arguments->run.instance,
                             "which run of the graph, if there are several");
  record_command->add_option("-o,--output", arguments->output, "MCAP file; must not exist")
      ->required();
  record_command
      ->add_option("--topics", arguments->topics,
                   "only topics whose name contains one of these, separated by commas")
      ->delimiter(',');
  auto* max_size =
      record_command
          ->add_option("--max-size", arguments->max_size, "bytes, as 500MB; the file ends there")
          ->transform(CLI::AsSizeValue(true));
  auto* split = record_command->add_flag(
      "--split", arguments->split, "go on in X_1.mcap, X_2.mcap, ... when X_0.mcap has its size");
  record_command->add_flag("--uncompressed", arguments->uncompressed,
                           "a larger file, for less of the CPU");
  auto* last = record_command->add_option(
      "--last", arguments->last, "as 30s: keep only so much, in memory, and write it at the end");
  takes_seconds(last, 0.1, 86'400.0);
  split->needs(max_size);
  last->excludes(max_size);
  record_command->add_flag("--wait", arguments->wait, "until the graph runs");
  record_command->footer(
      "Example:\n"
      "  cosegraph record segment -o run.mcap --wait\n"
      "  cosegraph record segment -o run.mcap --topics labelling,segments --max-size 2GB --split");
  record_command->callback([=] { choose([=] { return record(*arguments); }); });
}

}  // namespace cosegraph::tools
