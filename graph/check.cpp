// Everything about a graph that can be wrong before it starts.
#include <unistd.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <set>

#include "graph/description.hpp"
#include "graph/security.hpp"

namespace cosegraph::graph {
namespace {

// A connection between stages that are known.
struct Edge {
  std::size_t from;
  std::size_t to;
  const PortInfo* from_port;
  const Connection* connection;
};

std::string in_quotes(std::string_view text) {
  return "'" + std::string(text) + "'";
}

// "; did you mean 'X'?", or all that there is.
std::string offer(std::string_view word, const std::vector<std::string>& candidates) {
  const std::string nearest = did_you_mean(word, candidates);
  if (!nearest.empty() || candidates.empty()) return nearest;
  std::string all;
  for (const auto& candidate : candidates) all += (all.empty() ? "" : ", ") + candidate;
  return "; there are: " + all;
}

template <class T, class Name>
std::vector<std::string> names_of(const std::vector<T>& items, Name name) {
  std::vector<std::string> result;
  for (const auto& item : items) result.push_back(item.*name);
  return result;
}

// Where the value of a stage's key stands.
Mark mark_of(const StageNode& stage, const std::string& key) {
  const auto found = stage.marks.find(key);
  return found == stage.marks.end() ? stage.mark : found->second;
}

class Checker {
 public:
  Checker(const GraphDescription& graph, const Catalog& catalog)
      : graph_(graph), catalog_(catalog), stages_(graph.stages) {}

  std::vector<Fault> run();

 private:
  void fault(Mark mark, std::string message) {
    faults_.push_back({graph_.file, mark, std::move(message)});
  }
  void fault(const StageNode& stage, Mark mark, const std::string& message) {
    fault(mark, "stage " + in_quotes(stage.name) + ": " + message);
  }

  void check_kind(const StageNode& stage);
  void check_outputs(const StageNode& stage);
  void check_host(const StageNode& stage);
  void check_replicas(std::size_t index);
  void check_executable(const StageNode& stage);
  void check_params(const StageNode& stage, const StageInfo& info);
  void check_param(const StageNode& stage, const Setting& setting, const Fields& fields);
  void check_inputs(std::size_t index);
  void check_input(std::size_t index, const Connection& connection);
  const PortInfo* find_input(std::size_t index, const Connection& connection);
  const PortInfo* find_output(const StageNode& stage, const Connection& connection,
                              std::optional<std::size_t> from);
  void check_edge(const StageNode& stage, const Connection& connection, const PortInfo& from_port,
                  const PortInfo& to_port);
  void check_missing_inputs(const StageNode& stage, const StageInfo& info);
  void check_unique_names();

  // Of the whole graph.
  void check_cycles();
  void check_sources();
  void check_purpose();
  void check_reach();
  void check_security();

  std::optional<std::size_t> find_stage(std::string_view name) const;
  bool takes_frames(std::size_t index) const;
  bool is_source(std::size_t index) const;
  bool is_read(std::size_t index) const;
  std::vector<const Edge*> shortest_cycle(std::size_t start) const;
  // The stages that frames of `start` come to, itself included.
  std::vector<bool> fed_by(std::size_t start) const;
  // The stages that edges of any kind, taken in any direction, connect with `start`.
  std::vector<bool> connected_with(std::size_t start) const;

  const GraphDescription& graph_;
  const Catalog& catalog_;
  const std::vector<StageNode>& stages_;
  std::vector<std::optional<StageInfo>> infos_;  // per stage; none if the kind is not known
  std::set<std::string> types_;                  // of messages, as the kinds have them
  std::vector<Edge> edges_;
  std::vector<std::size_t> sources_;

  // What is unknown or wrong leads to more that looks wrong, about which nothing is said.
  bool wiring_is_known_ = true;  // every kind, and both ends of every connection
  bool wiring_is_sound_ = true;  // what must be fed is, with what fits, without cycles
  std::vector<Fault> faults_;
};

std::optional<std::size_t> Checker::find_stage(std::string_view name) const {
  const auto found = std::ranges::find(stages_, name, &StageNode::name);
  if (found == stages_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - stages_.begin());
}

void Checker::check_kind(const StageNode& stage) {
  infos_.emplace_back();
  const bool use = !stage.use.empty() || stage.marks.contains("use");
  const bool exec = !stage.exec.empty() || stage.marks.contains("exec");
  if (use == exec) {
    fault(stage, stage.mark, use ? "either 'use' or 'exec', not both" : "needs 'use' or 'exec'");
  } else if (!stage.exec.empty() || catalog_.contains(stage.use)) {
    infos_.back() = info_of(stage, catalog_);
  } else if (!stage.use.empty()) {
    std::vector<std::string> kinds;
    for (const auto& [kind, make] : catalog_) kinds.push_back(kind);
    fault(stage, mark_of(stage, "use"),
          "unknown kind " + in_quotes(stage.use) + offer(stage.use, kinds));
  }
  if (!infos_.back()) wiring_is_known_ = false;
}

void Checker::check_outputs(const StageNode& stage) {
  if (!stage.use.empty() && !stage.outputs.empty())
    fault(stage, stage.mark, "only an exec stage declares outputs; those of a kind are known");
  if (stage.exec.empty()) return;
  if (stage.inputs.empty() && stage.outputs.empty())
    fault(stage, stage.mark, "has neither inputs nor outputs");
  for (const auto& output : stage.outputs) {
    if (output.type.empty() || types_.contains(output.type)) continue;
    fault(stage, mark_of(stage, "outputs." + output.name),
          "unknown message type " + in_quotes(output.type) +
              offer(output.type, {types_.begin(), types_.end()}));
  }
}

void Checker::check_host(const StageNode& stage) {
  const auto names = names_of(graph_.hosts, &Host::name);
  const auto check_name = [&](const std::string& host, Mark mark) {
    if (host.empty() || std::ranges::find(names, host) != names.end()) return;
    fault(stage, mark, "unknown host " + in_quotes(host) + offer(host, names));
  };
  check_name(stage.host, mark_of(stage, "host"));
  for (const auto& share : stage.replicas) check_name(share.host, share.mark);
}

// Frames are shared out over replicas and brought together again by the stages that read them:
// there must be some, and what is published once must have one author.
void Checker::check_replicas(std::size_t index) {
  const StageNode& stage = stages_[index];
  if (stage.replicas.empty() || !infos_[index] || !wiring_is_known_) return;
  const char* why = nullptr;
  if (is_source(index) || !takes_frames(index)) why = "it takes no frames";
  if (std::ranges::any_of(infos_[index]->outputs, &PortInfo::latched))
    why = "what it gives is latched";
  const bool read = std::ranges::any_of(
      edges_, [&](const Edge& edge) { return edge.from == index && !edge.from_port->latched; });
  if (why == nullptr && !read) why = "no stage reads what it gives";
  if (why != nullptr)
    fault(stage, stage.replicas[0].mark, std::string("cannot have replicas: ") + why);
}

void Checker::check_executable(const StageNode& stage) {
  if (stage.exec.empty()) return;
  const auto host = std::ranges::find(graph_.hosts, stage.host, &Host::name);
  if (!stage.host.empty() && (host == graph_.hosts.end() || !is_loopback(host->address))) return;
  const auto path = std::filesystem::path(graph_.file).parent_path() / stage.exec;
  const Mark where = mark_of(stage, "exec");
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    fault(stage, where, "there is no " + in_quotes(path.string()));
  } else if (!std::filesystem::is_regular_file(path, error) || access(path.c_str(), X_OK) != 0) {
    fault(stage, where, in_quotes(path.string()) + " is not executable");
  }
}

void Checker::check_params(const StageNode& stage, const StageInfo& info) {
  if (!stage.exec.empty()) return;  // its own affair
  std::set<std::string> given;
  for (const auto& setting : stage.params) {
    if (!given.insert(setting.name).second)
      fault(stage, setting.mark, "parameter " + in_quotes(setting.name) + " is given twice");
    check_param(stage, setting, info.parameters);
  }
}

void Checker::check_param(const StageNode& stage, const Setting& setting, const Fields& fields) {
  const Field* field = find(fields, setting.name);
  if (field == nullptr) {
    fault(stage, setting.mark,
          "unknown parameter " + in_quotes(setting.name) +
              offer(setting.name, names_of(fields, &Field::name)));
    return;
  }
  try {
    if (setting.is_list && field->type != FieldType::list)
      throw ParameterError("expected one value, not a list");
    field->set(setting.value);
  } catch (const ParameterError& error) {
    fault(stage, setting.value_mark, setting.name + ": " + error.what());
  }
}

void Checker::check_inputs(std::size_t index) {
  const StageNode& stage = stages_[index];
  std::set<std::string> fed;
  for (const auto& connection : stage.inputs) {
    if (!fed.insert(connection.port).second)
      fault(stage, connection.mark, "input " + in_quotes(connection.port) + " is fed twice");
    check_input(index, connection);
  }
  if (infos_[index] && stage.exec.empty()) check_missing_inputs(stage, *infos_[index]);
}

void Checker::check_input(std::size_t index, const Connection& connection) {
  const StageNode& stage = stages_[index];
  const bool has_kind = infos_[index] && stage.exec.empty();
  const PortInfo* to_port = has_kind ? find_input(index, connection) : nullptr;
  const auto from = find_stage(connection.from_stage);
  const PortInfo* from_port = find_output(stage, connection, from);
  if (from_port == nullptr || (has_kind && to_port == nullptr)) wiring_is_known_ = false;
  if (from_port == nullptr) return;
  edges_.push_back({*from, index, from_port, &connection});
  if (to_port != nullptr) check_edge(stage, connection, *from_port, *to_port);
}

const PortInfo* Checker::find_input(std::size_t index, const Connection& connection) {
  const PortInfo* port = infos_[index]->input(connection.port);
  if (port == nullptr)
    fault(stages_[index], connection.mark,
          "unknown input " + in_quotes(connection.port) +
              offer(connection.port, names_of(infos_[index]->inputs, &PortInfo::name)));
  return port;
}

const PortInfo* Checker::find_output(const StageNode& stage, const Connection& connection,
                                     std::optional<std::size_t> from) {
  const Mark mark = connection.value_mark;
  if (connection.from_stage.empty()) {
    if (mark.line == 0)
      fault(stage, mark, "input " + in_quotes(connection.port) + " names no stage");
    return nullptr;  // in a file, parse() has said what is wrong with it
  }
  if (!from) {
    fault(stage, mark,
          "unknown stage " + in_quotes(connection.from_stage) +
              offer(connection.from_stage, names_of(stages_, &StageNode::name)));
    return nullptr;
  }
  if (!infos_[*from]) return nullptr;
  const PortInfo* port = infos_[*from]->output(connection.from_port);
  if (port == nullptr)
    fault(stage, mark,
          in_quotes(connection.from_stage) + " has no output " + in_quotes(connection.from_port) +
              offer(connection.from_port, names_of(infos_[*from]->outputs, &PortInfo::name)));
  return port;
}

void Checker::check_edge(const StageNode& stage, const Connection& connection,
                         const PortInfo& from_port, const PortInfo& to_port) {
  const std::string from = in_quotes(connection.from_stage + "/" + connection.from_port);
  const std::string to = "input " + in_quotes(connection.port);
  if (!types_.contains(from_port.type)) return;  // said already
  std::string message;
  if (from_port.type != to_port.type) {
    message = " takes " + to_port.type + ", but " + from + " gives " + from_port.type;
  } else if (from_port.latched && !to_port.latched) {
    message = " takes one message per frame, but " + from + " is latched";
  } else if (!from_port.latched && to_port.latched) {
    message = " is latched, but " + from + " gives one message per frame";
  }
  if (message.empty()) return;
  wiring_is_sound_ = false;
  fault(stage, connection.value_mark, to + message);
}

// A misspelt input counts as the one that is meant.
void Checker::check_missing_inputs(const StageNode& stage, const StageInfo& info) {
  const auto ports = names_of(info.inputs, &PortInfo::name);
  std::set<std::string> fed;
  for (const auto& input : stage.inputs) fed.insert(nearest_name(input.port, ports).value_or(""));
  for (const auto& port : info.inputs) {
    if (port.optional || fed.contains(port.name)) continue;
    wiring_is_sound_ = false;
    fault(stage, stage.mark, "input " + in_quotes(port.name) + " (" + port.type + ") is not fed");
  }
}

void Checker::check_unique_names() {
  std::set<std::string> stages;
  for (const auto& stage : stages_)
    if (!stages.insert(stage.name).second)
      fault(stage.mark, "two stages are called " + in_quotes(stage.name));
  std::set<std::string> hosts;
  for (const auto& host : graph_.hosts)
    if (!hosts.insert(host.name).second)
      fault(host.mark, "two hosts are called " + in_quotes(host.name));
}

bool Checker::takes_frames(std::size_t index) const {
  if (stages_[index].exec.empty()) return infos_[index]->has_frame_inputs();
  return std::ranges::any_of(
      edges_, [&](const Edge& edge) { return edge.to == index && !edge.from_port->latched; });
}

// An exec stage is one only if all that feeds it is known.
bool Checker::is_source(std::size_t index) const {
  if (!infos_[index] || !infos_[index]->has_frame_outputs() || takes_frames(index)) return false;
  const auto fed = static_cast<std::size_t>(std::ranges::count(edges_, index, &Edge::to));
  return stages_[index].exec.empty() || fed == stages_[index].inputs.size();
}

bool Checker::is_read(std::size_t index) const {
  return std::ranges::any_of(edges_, [&](const Edge& edge) { return edge.from == index; });
}

// Breadth first along the edges, back to where it began; none if it leads nowhere.
std::vector<const Edge*> Checker::shortest_cycle(std::size_t start) const {
  std::vector<const Edge*> reached_by(stages_.size(), nullptr);
  std::vector<std::size_t> queue = {start};
  for (std::size_t i = 0; i < queue.size() && reached_by[start] == nullptr; ++i) {
    for (const Edge& edge : edges_) {
      if (edge.from != queue[i] || reached_by[edge.to] != nullptr) continue;
      reached_by[edge.to] = &edge;
      queue.push_back(edge.to);
    }
  }
  std::vector<const Edge*> cycle;
  for (const Edge* edge = reached_by[start]; edge != nullptr; edge = reached_by[edge->from]) {
    cycle.push_back(edge);
    if (edge->from == start) break;
  }
  std::ranges::reverse(cycle);
  return cycle;
}

// Every stage on a cycle is in one that is named; no cycle is named twice.
void Checker::check_cycles() {
  std::vector<bool> named(stages_.size(), false);
  for (std::size_t i = 0; i < stages_.size(); ++i) {
    if (named[i]) continue;
    const auto cycle = shortest_cycle(i);
    if (cycle.empty()) continue;
    std::string text = stages_[i].name;
    for (const Edge* edge : cycle) {
      text += " -> " + stages_[edge->to].name;
      named[edge->to] = true;
    }
    wiring_is_sound_ = false;
    fault(cycle.back()->connection->value_mark, "the stages form a cycle: " + text);
  }
}

void Checker::check_sources() {
  for (std::size_t i = 0; i < stages_.size(); ++i)
    if (is_source(i)) sources_.push_back(i);
  for (std::size_t i = 1; i < sources_.size(); ++i)
    fault(stages_[sources_[i]], stages_[sources_[i]].mark,
          "a second source of frames beside " + in_quotes(stages_[sources_[0]].name) +
              "; a graph has one");
  if (wiring_is_known_ && sources_.empty() && wiring_is_sound_)
    fault(graph_.mark, "no stage is a source of frames");
}

void Checker::check_purpose() {
  if (!wiring_is_known_) return;
  bool any_takes_frames = false;
  for (std::size_t i = 0; i < stages_.size(); ++i) {
    any_takes_frames = any_takes_frames || takes_frames(i);
    if (!takes_frames(i) && !is_source(i) && !infos_[i]->outputs.empty() && !is_read(i))
      fault(stages_[i], stages_[i].mark, "no stage reads what it gives");
  }
  if (!any_takes_frames) fault(graph_.mark, "no stage takes frames: none would ever be done");
}

std::vector<bool> Checker::fed_by(std::size_t start) const {
  std::vector<bool> reached(stages_.size(), false);
  reached[start] = true;
  for (std::size_t round = 0; round < stages_.size(); ++round)
    for (const Edge& edge : edges_)
      if (reached[edge.from] && !edge.from_port->latched) reached[edge.to] = true;
  return reached;
}

std::vector<bool> Checker::connected_with(std::size_t start) const {
  std::vector<bool> reached(stages_.size(), false);
  reached[start] = true;
  for (std::size_t round = 0; round < stages_.size(); ++round)
    for (const Edge& edge : edges_)
      if (reached[edge.from] || reached[edge.to]) reached[edge.from] = reached[edge.to] = true;
  return reached;
}

void Checker::check_reach() {
  if (!wiring_is_known_ || !wiring_is_sound_ || sources_.size() != 1) return;
  const auto fed = fed_by(sources_[0]);
  const auto connected = connected_with(sources_[0]);
  for (std::size_t i = 0; i < stages_.size(); ++i) {
    const bool unused = !takes_frames(i) && !infos_[i]->outputs.empty() && !is_read(i);
    if (unused) continue;  // said already
    if (takes_frames(i) && !fed[i]) {
      fault(stages_[i], stages_[i].mark, "no frames come to it");
    } else if (!connected[i] && infos_[i]->inputs.size() + infos_[i]->outputs.size() > 0) {
      fault(stages_[i], stages_[i].mark,
            "is not connected with " + in_quotes(stages_[sources_[0]].name));
    }
  }
}

// Permissions are compared with the wiring, which must be right for that.
void Checker::check_security() {
  if (graph_.dds.security.empty() || !faults_.empty()) return;
  std::ranges::move(check_keys(graph_, catalog_), std::back_inserter(faults_));
}

std::vector<Fault> Checker::run() {
  for (const auto& [kind, make] : catalog_) {
    const StageInfo info = make();
    for (const auto* ports : {&info.inputs, &info.outputs})
      for (const auto& port : *ports) types_.insert(port.type);
  }
  check_unique_names();
  for (const auto& stage : stages_) check_kind(stage);
  for (std::size_t i = 0; i < stages_.size(); ++i) {
    check_outputs(stages_[i]);
    check_host(stages_[i]);
    check_executable(stages_[i]);
    check_inputs(i);
    if (infos_[i]) check_params(stages_[i], *infos_[i]);
  }
  check_cycles();
  check_sources();
  check_purpose();
  check_reach();
  for (std::size_t i = 0; i < stages_.size(); ++i) check_replicas(i);
  check_security();
  std::ranges::stable_sort(faults_, {}, &Fault::mark);
  return std::move(faults_);
}

}  // namespace

std::vector<Fault> check(const GraphDescription& graph, const Catalog& catalog) {
  return Checker(graph, catalog).run();
}

}  // namespace cosegraph::graph
