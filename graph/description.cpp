#include "graph/description.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <utility>

template <>
cosegraph::Names<cosegraph::graph::RestartPolicy>
cosegraph::names<cosegraph::graph::RestartPolicy>() {
  using cosegraph::graph::RestartPolicy;
  static constexpr std::pair<RestartPolicy, std::string_view> table[] = {
      {RestartPolicy::never, "never"}, {RestartPolicy::on_failure, "on-failure"}};
  return table;
}

namespace cosegraph::graph {
namespace {

std::string all_lines(const std::vector<Fault>& faults) {
  std::string result;
  for (const auto& fault : faults) result += (result.empty() ? "" : "\n") + to_text(fault);
  return result;
}

// Relative executables and keys are meant relative to the graph file.
void resolve_paths(GraphDescription& graph, const std::filesystem::path& folder) {
  if (!graph.dds.security.empty())
    graph.dds.security = (folder / graph.dds.security).lexically_normal().string();
  for (auto& stage : graph.stages)
    if (!stage.exec.empty()) stage.exec = (folder / stage.exec).lexically_normal().string();
}

}  // namespace

std::string to_text(const Fault& fault) {
  std::string result = fault.file;
  if (fault.mark.line > 0)
    result += ":" + std::to_string(fault.mark.line) + ":" + std::to_string(fault.mark.column);
  return result + ": " + fault.message;
}

GraphError::GraphError(std::vector<Fault> faults)
    : Error(all_lines(faults)), faults_(std::move(faults)) {}

const StageNode* GraphDescription::stage(std::string_view name) const {
  const auto found = std::ranges::find(stages, name, &StageNode::name);
  return found == stages.end() ? nullptr : &*found;
}

StageNode* GraphDescription::stage(std::string_view name) {
  return const_cast<StageNode*>(std::as_const(*this).stage(name));
}

bool is_loopback(std::string_view address) {
  return address == "localhost" || address == "::1" || address.starts_with("127.");
}

Fields describe(GraphDescription& graph) {
  return {integer_field("window", graph.window, 1, 64, "",
                        "Frames in flight at most; a source waits or drops beyond it."),
          number_field("deadline", graph.deadline, 0.001, 86400.0, "s",
                       "A frame that is not done this long after its admission fails.")};
}

Fields describe(Dds& dds) {
  return {integer_field("domain", dds.domain, 0, 232, "",
                        "DDS domain; participants of different domains do not meet."),
          number_field("rate", dds.rate, 0.0, 100000.0, "Mbit/s",
                       "What a stage sends to other hosts at most, for links that drop what is too "
                       "much for them; 0: as fast as it goes.")};
}

Fields describe(Restart& restart) {
  return {choice_field("policy", restart.policy, "When a stage that ended is started again."),
          integer_field("max", restart.max, 0, 1000, "",
                        "How many times at most; it is given up after that."),
          number_field("backoff", restart.backoff, 0.0, 60.0, "s",
                       "Before the first time; twice as long before each further one.")};
}

std::vector<std::string> hosts_of(const StageNode& stage) {
  if (stage.replicas.empty()) return {stage.host};
  std::vector<std::string> result;
  for (const auto& share : stage.replicas)
    result.insert(result.end(), static_cast<std::size_t>(share.count),
                  share.host.empty() ? stage.host : share.host);
  return result;
}

GraphDescription load(const std::filesystem::path& file, const Catalog& catalog) {
  if (std::filesystem::is_directory(file)) throw GraphError({{file.string(), {}, "is a folder"}});
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw GraphError({{file.string(), {}, "cannot be opened"}});
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  if (stream.bad()) throw GraphError({{file.string(), {}, "cannot be read"}});

  std::vector<Fault> faults;
  GraphDescription graph = parse(text, file.string(), faults);
  resolve_paths(graph, std::filesystem::absolute(file).parent_path());
  if (!graph.stages.empty()) std::ranges::move(check(graph, catalog), std::back_inserter(faults));
  std::ranges::stable_sort(faults, {}, &Fault::mark);
  if (!faults.empty()) throw GraphError(std::move(faults));
  return graph;
}

void set_param(GraphDescription& graph, std::string_view stage, std::string_view name,
               std::vector<std::string> value) {
  StageNode* node = graph.stage(stage);
  if (node == nullptr) {
    std::vector<std::string> names;
    for (const auto& other : graph.stages) names.push_back(other.name);
    throw ParameterError("unknown stage '" + std::string(stage) + "'" + did_you_mean(stage, names));
  }
  const bool is_list = value.size() != 1;
  Setting setting{.name = std::string(name), .value = std::move(value), .is_list = is_list};
  const auto found = std::ranges::find(node->params, name, &Setting::name);
  if (found == node->params.end()) {
    node->params.push_back(std::move(setting));
  } else {
    *found = std::move(setting);
  }
}

std::string topic_name(const GraphDescription& graph, std::string_view stage,
                       std::string_view port) {
  return graph.graph + "/" + std::string(stage) + "/" + std::string(port);
}

}  // namespace cosegraph::graph
