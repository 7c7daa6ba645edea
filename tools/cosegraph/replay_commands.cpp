// replay, compare: recordings given to readers and stages of today.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "graph/runs.hpp"
#include "graph/runtime.hpp"
#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/durations.hpp"
#include "tools/cosegraph/run_graph.hpp"
#include "tools/cosegraph/stop_signals.hpp"
#include "tools/recording/compare.hpp"
#include "tools/recording/recording.hpp"
#include "tools/recording/replay.hpp"

namespace cosegraph::tools {
namespace {

using nlohmann::ordered_json;
using recording::FrameComparison;
using Verdict = FrameComparison::Verdict;

// A part of a recording, in seconds from its start.
struct Part {
  double from = 0.0;
  double to = 0.0;  // 0: the end

  std::pair<std::uint64_t, std::uint64_t> times_in(const recording::McapReader& reader) const {
    const std::uint64_t start = reader.statistics().start_time;
    const auto at = [&](double seconds) {
      return start + static_cast<std::uint64_t>(std::llround(1e9 * seconds));
    };
    return {at(from), to > 0.0 ? at(to) : std::numeric_limits<std::uint64_t>::max()};
  }
};

void add_part(CLI::App& command, Part& part) {
  constexpr double kLongest = 1e9;
  takes_seconds(command.add_option("--from", part.from, "after the start of the recording"), 0.0,
                kLongest);
  takes_seconds(command.add_option("--to", part.to, "after the start of the recording; 0: its end"),
                0.0, kLongest);
}

void report_damage(const recording::McapReader& reader) {
  if (!reader.damage().empty())
    std::cerr << reader.file().string() << ": read up to " << reader.damage() << '\n';
}

// -- a recorded stage ----------------------------------------------------------------------------

struct StageArguments {
  std::string file;
  std::string stage;
  std::vector<std::string> params;  // NAME=VALUE
  Part part;
};

// The stage as it was when it was recorded, but for `params`. Throws ParameterError.
std::unique_ptr<graph::Stage> make_stage(graph::GraphDescription& graph,
                                         const StageArguments& arguments) {
  const graph::StageNode* node = graph.stage(arguments.stage);
  if (node == nullptr) {
    std::vector<std::string> names;
    for (const auto& other : graph.stages) names.push_back(other.name);
    throw ParameterError(arguments.file + ": there is no stage '" + arguments.stage + "'" +
                         did_you_mean(arguments.stage, names));
  }
  const auto kind = stage_table().find(node->use);
  if (kind == stage_table().end())
    throw ParameterError("stage '" + arguments.stage + "' is not one of this program's");
  std::vector<std::string> settings;
  for (const auto& param : arguments.params) settings.push_back(arguments.stage + "." + param);
  apply_overrides(graph, settings);
  auto stage = kind->second();
  graph::apply_params(graph, *node, *stage);
  return stage;
}

// -- compare -------------------------------------------------------------------------------------

struct CompareArguments {
  StageArguments stage;
  double tolerance = 0.0;
  bool json = false;
};

std::string difference_text(const recording::Difference& one) {
  char text[96];
  if (one.size != one.size_before)
    std::snprintf(text, sizeof text, "has %zu values instead of %zu", one.size, one.size_before);
  else if (one.is_real)
    std::snprintf(text, sizeof text, "differs by up to %.3g, %zu of %zu values", one.largest,
                  one.changed, one.size);
  else
    std::snprintf(text, sizeof text, "differs, %zu of %zu values", one.changed, one.size);
  return text;
}

void print_frame(const FrameComparison& frame) {
  if (frame.verdict == Verdict::identical) return;
  std::printf("%s: %s%s%s\n", frame.name.c_str(), std::string(to_name(frame.verdict)).c_str(),
              frame.note.empty() ? "" : ": ", frame.note.c_str());
  for (const auto& [port, differences] : frame.ports)
    for (const auto& one : differences)
      std::printf("  %s.%s %s\n", port.c_str(), one.member.c_str(), difference_text(one).c_str());
}

ordered_json frame_json(const FrameComparison& frame) {
  ordered_json differences = ordered_json::array();
  for (const auto& [port, all] : frame.ports)
    for (const auto& one : all) {
      ordered_json entry{{"port", port},
                         {"member", one.member},
                         {"size_before", one.size_before},
                         {"size", one.size},
                         {"changed", one.changed}};
      if (one.is_real) entry["largest"] = one.largest;
      differences.push_back(std::move(entry));
    }
  return {{"frame", frame.name},
          {"epoch", frame.epoch},
          {"sequence", frame.sequence},
          {"verdict", to_name(frame.verdict)},
          {"note", frame.note},
          {"ms", frame.milliseconds},
          {"differences", std::move(differences)}};
}

// What is seen of one member over all frames.
struct MemberSummary {
  std::size_t frames = 0;  // in which it differs
  std::size_t changed = 0;
  std::size_t resized = 0;  // frames in which its size differs
  bool is_real = false;
  double largest = 0.0;
};
using Summaries = std::map<std::string, MemberSummary>;

void add(const FrameComparison& frame, Summaries& summaries) {
  for (const auto& [port, differences] : frame.ports)
    for (const auto& one : differences) {
      MemberSummary& summary = summaries[port + "." + one.member];
      ++summary.frames;
      summary.changed += one.changed;
      summary.resized += one.size != one.size_before ? 1 : 0;
      summary.is_real = one.is_real;
      summary.largest = std::max(summary.largest, one.largest);
    }
}

void print(const Summaries& summaries) {
  if (summaries.empty()) return;
  std::printf("%-36s %8s %8s %10s %10s\n", "in all", "frames", "resized", "values", "largest");
  for (const auto& [member, one] : summaries) {
    std::printf("%-36s %8zu %8zu %10zu", member.c_str(), one.frames, one.resized, one.changed);
    if (one.is_real) std::printf(" %10.3g", one.largest);
    std::printf("\n");
  }
}

ordered_json to_json(const Summaries& summaries) {
  ordered_json result = ordered_json::object();
  for (const auto& [member, one] : summaries) {
    result[member] = {{"frames", one.frames}, {"resized", one.resized}, {"changed", one.changed}};
    if (one.is_real) result[member]["largest"] = one.largest;
  }
  return result;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  return values[values.size() / 2];
}

int compare(const CompareArguments& arguments) {
  const recording::McapReader reader(arguments.stage.file);
  graph::GraphDescription graph = recording::graph_in(reader);
  const auto stage = make_stage(graph, arguments.stage);
  const std::string& name = arguments.stage.stage;
  const graph::StageNode& node = *graph.stage(name);
  const recording::StageWiring wiring =
      recording::wiring_of(graph, name, graph::info_of(node.use, stage_table().at(node.use)));
  if (wiring.frame_inputs.empty() || wiring.frame_outputs.empty())
    throw ParameterError("stage '" + name + "' does not turn recorded messages into messages");
  for (const auto& input : node.inputs) stage->connect(input.port);
  stage->start();

  const StopSignals signals;
  const auto [from, to] = arguments.stage.part.times_in(reader);
  recording::StageFrames frames(reader, wiring, recording::StageFrames::Want::inputs_and_outputs,
                                graph.window, from, to);
  std::map<Verdict, std::size_t> counts;
  std::vector<double> times;
  Summaries summaries;
  ordered_json all = ordered_json::array();
  while (const auto frame = signals.asked() ? std::nullopt : frames.next()) {
    const FrameComparison result = recording::compare(*frame, wiring, *stage, arguments.tolerance);
    ++counts[result.verdict];
    add(result, summaries);
    if (result.verdict != Verdict::not_comparable) times.push_back(result.milliseconds);
    if (arguments.json)
      all.push_back(frame_json(result));
    else
      print_frame(result);
  }
  const bool fine = counts[Verdict::differs] == 0 && counts[Verdict::identical] > 0;
  if (!arguments.json) print(summaries);
  if (arguments.json)
    std::cout << ordered_json{{"stage", name},
                              {"identical", counts[Verdict::identical]},
                              {"differ", counts[Verdict::differs]},
                              {"not_comparable", counts[Verdict::not_comparable]},
                              {"ms_median", median(times)},
                              {"fine", fine},
                              {"members", to_json(summaries)},
                              {"frames", std::move(all)}}
                     .dump(2)
              << '\n';
  else
    std::printf("%s: %zu frames identical, %zu differ, %zu not comparable; %.1f ms per frame\n",
                name.c_str(), counts[Verdict::identical], counts[Verdict::differs],
                counts[Verdict::not_comparable], median(times));
  report_damage(reader);
  return fine ? 0 : 1;
}

// -- replay --------------------------------------------------------------------------------------

struct ReplayArguments {
  StageArguments stage;  // its name is empty unless there is one to replay into
  std::string instance;
  std::vector<std::string> topics;
  double speed = 1.0;
  bool loop = false;
  bool wait = false;
  bool json = false;
  bool without_security = false;
};

int replay_to_all(const recording::McapReader& reader, const graph::GraphDescription& graph,
                  const recording::ReplayOptions& options, bool json) {
  const recording::ReplayReport report = recording::replay(reader, graph, options);
  if (json)
    std::cout << ordered_json{{"messages", report.messages}, {"rounds", report.rounds}}.dump(2)
              << '\n';
  else
    std::printf("%llu messages published\n", static_cast<unsigned long long>(report.messages));
  return 0;
}

int replay_to_stage(const recording::McapReader& reader, graph::GraphDescription graph,
                    const recording::ReplayOptions& options, const ReplayArguments& arguments) {
  const std::string& name = arguments.stage.stage;
  auto stage = make_stage(graph, arguments.stage);
  const recording::IntoReport report =
      recording::replay_into(reader, graph, name, std::move(stage), options);
  if (arguments.json)
    std::cout << ordered_json{{"stage", name},
                              {"frames", report.frames},
                              {"failed", report.failed},
                              {"skipped", report.skipped},
                              {"ms_median", report.status.latency_median},
                              {"ms_p99", report.status.latency_p99},
                              {"ms_total", report.status.latency_sum},
                              {"interrupted", report.interrupted}}
                     .dump(2)
              << '\n';
  else
    std::printf(
        "%s: %llu frames, %llu failed, %llu skipped; ms median %.1f, p99 %.1f, total %.1f\n",
        name.c_str(), static_cast<unsigned long long>(report.frames),
        static_cast<unsigned long long>(report.failed),
        static_cast<unsigned long long>(report.skipped), report.status.latency_median,
        report.status.latency_p99, report.status.latency_sum);
  return report.failed == 0 && report.frames > 0 && !report.interrupted ? 0 : 1;
}

int replay(const ReplayArguments& arguments) {
  const recording::McapReader reader(arguments.stage.file);
  graph::GraphDescription graph = graph::fresh_instance(recording::graph_in(reader));
  if (!arguments.instance.empty()) graph.instance = arguments.instance;
  if (!graph.dds.security.empty() && !arguments.without_security)
    throw ParameterError("graph '" + graph.graph +
                         "' has security, but no key lets a replay speak for its stages; with "
                         "--without-security it publishes in the clear");
  graph.dds.security.clear();
  graph.one_process = !arguments.stage.stage.empty();
  const auto [from, to] = arguments.stage.part.times_in(reader);
  const StopSignals signals;
  const recording::ReplayOptions options{.from = from,
                                         .to = to,
                                         .speed = arguments.speed,
                                         .loop = arguments.loop,
                                         .topics = arguments.topics,
                                         .wait = arguments.wait,
                                         .stop = &signals.asked()};
  const graph::RunFolder folder(graph, "");  // so that other commands find this run
  std::cerr << "replaying graph " << graph.graph << " as instance " << graph.instance << '\n';
  const int status = arguments.stage.stage.empty()
                         ? replay_to_all(reader, graph, options, arguments.json)
                         : replay_to_stage(reader, graph, options, arguments);
  report_damage(reader);
  return status;
}

void add_replay_command(CLI::App& app, const Choose& choose) {
  auto* command = app.add_subcommand(
      "replay", "Publishes a recording as a run of its graph, or gives it to one stage");
  auto arguments = std::make_shared<ReplayArguments>();
  command->add_option("recording", arguments->stage.file, "MCAP file")->required();
  auto* into = command->add_option("--into", arguments->stage.stage,
                                   "run this stage, as fast as it takes its recorded inputs");
  command->add_option("--param", arguments->stage.params, "NAME=VALUE of that stage")
      ->take_all()
      ->needs(into);
  command->add_option("--instance", arguments->instance, "name of the run; else one of its own");
  command->add_option("--speed", arguments->speed, "times the recorded speed")
      ->check(CLI::Range(0.01, 1000.0))
      ->excludes(into);
  command->add_flag("--loop", arguments->loop, "begin anew until Ctrl-C")->excludes(into);
  command
      ->add_option("--topics", arguments->topics,
                   "only topics whose name contains one of these, separated by commas")
      ->delimiter(',')
      ->excludes(into);
  command->add_flag("--wait", arguments->wait, "until the topics are read")->excludes(into);
  command->add_flag("--without-security", arguments->without_security,
                    "publish in the clear what was recorded of a graph with security");
  command->add_flag("--json", arguments->json, "the report as JSON");
  add_part(*command, arguments->stage.part);
  command->footer(
      "Example:\n"
      "  cosegraph replay run.mcap --speed 0.5 --loop\n"
      "  cosegraph replay run.mcap --into descriptors --param threads=2");
  command->callback([=] { choose([=] { return replay(*arguments); }); });
}

void add_stage_options(CLI::App& command, StageArguments& arguments) {
  command.add_option("recording", arguments.file, "MCAP file")->required();
  command.add_option("stage", arguments.stage, "stage of the recorded graph")->required();
  command.add_option("--param", arguments.params, "NAME=VALUE of the stage, may be repeated")
      ->take_all();
  add_part(command, arguments.part);
}

}  // namespace

void add_replay_commands(CLI::App& app, const Choose& choose) {
  add_replay_command(app, choose);
  auto* command = app.add_subcommand(
      "compare", "Gives a stage its recorded inputs and compares with its recorded outputs");
  auto arguments = std::make_shared<CompareArguments>();
  add_stage_options(*command, arguments->stage);
  command->add_option("--tolerance", arguments->tolerance, "by which real numbers may differ")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--json", arguments->json, "the report as JSON");
  command->footer(
      "Exit status 0: every frame that can be compared is as it was.\n"
      "Example:\n"
      "  cosegraph compare run.mcap astar --param spatial=none");
  command->callback([=] { choose([=] { return compare(*arguments); }); });
}

}  // namespace cosegraph::tools
