// Why a stage gets nothing on an input.
#include "graph/why.hpp"

#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "tools/cosegraph/commands.hpp"
#include "tools/cosegraph/watching.hpp"

namespace cosegraph::tools {
namespace {

using Json = nlohmann::ordered_json;

// The input that "STAGE/INPUT" names. Throws ParameterError with a "did you mean".
const graph::Connection& require_input(const graph::GraphDescription& graph,
                                       const std::string& name) {
  const std::size_t slash = name.find('/');
  if (slash == std::string::npos)
    throw ParameterError("'" + name + "': name an input, as STAGE/INPUT");
  const graph::StageNode& stage = require_stage(graph, name.substr(0, slash));
  const std::string port = name.substr(slash + 1);
  std::vector<std::string> inputs;
  for (const auto& input : stage.inputs) {
    if (input.port == port) return input;
    inputs.push_back(input.port);
  }
  std::string all;
  for (const auto& input : inputs) all += (all.empty() ? "" : ", ") + input;
  throw ParameterError("stage '" + stage.name + "' has no connected input '" + port + "'" +
                       did_you_mean(port, inputs) +
                       (all.empty() ? "; it has none" : "; it has: " + all));
}

bool is_latched(const graph::GraphDescription& graph, const graph::Connection& input) {
  const auto topic = find_topic(graph, input.from_stage + "/" + input.from_port);
  return topic && topic->latched;
}

void print_links(const std::vector<graph::Link>& links, const std::string& what) {
  for (const auto& link : links) {
    const char* mark = link.verdict == graph::Verdict::fine     ? "ok"
                       : link.verdict == graph::Verdict::broken ? "BROKEN"
                                                                : "?";
    std::printf("%-7s %-20s %s\n", mark, link.name.c_str(), link.text.c_str());
  }
  const graph::Link* broken = graph::first_broken(links);
  if (broken == nullptr) {
    std::printf("%s: nothing is broken\n", what.c_str());
    return;
  }
  std::printf("%s: the first broken link is %s: %s\n", what.c_str(), broken->name.c_str(),
              broken->text.c_str());
  if (!broken->remedy.empty()) std::printf("remedy: %s\n", broken->remedy.c_str());
}

int tell_why(const Watched& watched) {
  const graph::GraphDescription graph = watched.find();
  const graph::Connection& input = require_input(graph, watched.name());
  const graph::StageNode& stage =
      require_stage(graph, watched.name().substr(0, watched.name().find('/')));
  graph::DomainWatch watch(graph);
  graph::Observer observer(graph);
  look_twice(observer, graph, watched.patience());
  const graph::Domain domain = watch.wait(
      watched.patience(), [&](const graph::Domain& now) { return is_complete(now, graph); });
  const auto links = graph::links_of({.graph = graph,
                                      .stage = stage,
                                      .input = input,
                                      .latched = is_latched(graph, input),
                                      .domain = domain,
                                      .look = observer.stages(),
                                      .failures = observer.failures(),
                                      .now = std::chrono::steady_clock::now()});
  const graph::Link* broken = graph::first_broken(links);
  const std::string what = input.from_stage + "/" + input.from_port + " -> " + watched.name();
  if (watched.json) {
    Json json{{"from", input.from_stage + "/" + input.from_port},
              {"to", watched.name()},
              {"broken", nullptr},
              {"links", Json::array()}};
    if (broken != nullptr) json["broken"] = broken->name;
    for (const auto& link : links)
      json["links"].push_back({{"name", link.name},
                               {"verdict", to_name(link.verdict)},
                               {"text", link.text},
                               {"remedy", link.remedy}});
    std::cout << json.dump(2) << '\n';
  } else {
    print_links(links, what);
  }
  return broken == nullptr ? 0 : 1;
}

}  // namespace

void add_why_command(CLI::App& app, const Choose& choose) {
  auto* why = app.add_subcommand(
      "why", "Finds the first broken link between a stage's input and what feeds it");
  auto watched = std::make_shared<Watched>();
  add_watched(*why, *watched, "input, as STAGE/INPUT");
  add_timeout(*why, *watched, 3.0, "how long to wait for all stages to be heard");
  why->footer(
      "The exit status is 1 if a link is broken.\n"
      "Example:\n  cosegraph why segment.yaml fisher/segments");
  why->callback([=] { choose([=] { return tell_why(*watched); }); });
}

}  // namespace cosegraph::tools
