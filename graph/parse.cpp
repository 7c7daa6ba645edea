// Reading graph files: YAML to GraphDescription, with all faults of syntax, keys and types.
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>

#include "graph/description.hpp"

namespace cosegraph::graph {
namespace {

Mark mark_of(const YAML::Mark& mark) {
  return {mark.line + 1, mark.column + 1};
}

// One "key: value" of a mapping. Faults about a value stand at the value, or at the key if there
// is no value.
struct Entry {
  std::string key;
  Mark mark;
  YAML::Node value;

  Mark value_mark() const { return value.IsNull() ? mark : mark_of(value.Mark()); }
};

std::string kind_of(const YAML::Node& node) {
  if (node.IsMap()) return "a mapping";
  if (node.IsSequence()) return "a list";
  return node.IsScalar() ? "a single value" : "an empty place";
}

bool is_name(std::string_view text) {
  const auto lower = [](char c) { return c >= 'a' && c <= 'z'; };
  const auto other = [](char c) { return (c >= '0' && c <= '9') || c == '_' || c == '-'; };
  return !text.empty() && lower(text[0]) &&
         std::ranges::all_of(text, [&](char c) { return lower(c) || other(c); });
}

bool is_host_and_port(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos || colon == 0) return false;
  const std::string_view digits = text.substr(colon + 1);
  int port = 0;
  const auto [end, error] = std::from_chars(digits.begin(), digits.end(), port);
  return error == std::errc() && end == digits.end() && port >= 1 && port <= 65535;
}

class Reader {
 public:
  Reader(std::string file, std::vector<Fault>& faults) : file_(std::move(file)), faults_(faults) {}

  GraphDescription read(std::string_view yaml);

 private:
  void fault(Mark mark, std::string message) { faults_.push_back({file_, mark, message}); }
  void expected(const Entry& entry, const std::string& what) {
    const std::string found =
        entry.value.IsNull() ? "; it is empty" : ", not " + kind_of(entry.value);
    fault(entry.value_mark(), entry.key + ": expected " + what + found);
  }

  // The entries of a mapping in order, each key once. Any key goes if none is `known`.
  std::vector<Entry> entries(const YAML::Node& map, const std::vector<std::string>& known = {});
  std::vector<Entry> entries(const Entry& entry, const std::vector<std::string>& known = {});
  std::optional<std::string> scalar(const Entry& entry);
  std::optional<std::vector<std::string>> list(const Entry& entry);
  void require(const YAML::Node& map, std::initializer_list<const char*> keys);

  // Sets the field that is called like the entry.
  void set(const Fields& fields, const Entry& entry);
  void check_name(std::string_view name, Mark mark);

  void read_graph(const YAML::Node& root, GraphDescription& graph);
  void read_version(const Entry& entry);
  void read_dds(const Entry& entry, Dds& dds);
  void read_discovery(const Entry& entry, Dds& dds);
  void read_security(const Entry& entry, Dds& dds);
  Host read_host(const Entry& entry);
  StageNode read_stage(const Entry& entry);
  void read_stage_entry(const Entry& entry, StageNode& stage);
  void read_replicas(const Entry& entry, StageNode& stage);
  Connection read_input(const Entry& entry);
  PortInfo read_output(const Entry& entry);
  std::optional<Setting> read_setting(const Entry& entry);

  std::string file_;
  std::vector<Fault>& faults_;
};

std::vector<Entry> Reader::entries(const YAML::Node& map, const std::vector<std::string>& known) {
  std::vector<Entry> result;
  for (const auto& pair : map) {
    const Mark mark = mark_of(pair.first.Mark());
    if (!pair.first.IsScalar()) {
      fault(mark, "a key must be a single value, not " + kind_of(pair.first));
      continue;
    }
    const std::string& key = pair.first.Scalar();
    if (const auto same = std::ranges::find(result, key, &Entry::key); same != result.end()) {
      fault(mark, "'" + key + "' is given twice, first on line " + std::to_string(same->mark.line));
    } else if (!known.empty() && std::ranges::find(known, key) == known.end()) {
      fault(mark, "unknown key '" + key + "'" + did_you_mean(key, known));
    } else {
      result.push_back({key, mark, pair.second});
    }
  }
  return result;
}

std::vector<Entry> Reader::entries(const Entry& entry, const std::vector<std::string>& known) {
  if (entry.value.IsMap()) return entries(entry.value, known);
  expected(entry, "a mapping");
  return {};
}

std::optional<std::string> Reader::scalar(const Entry& entry) {
  if (entry.value.IsScalar()) return entry.value.Scalar();
  expected(entry, "a single value");
  return std::nullopt;
}

std::optional<std::vector<std::string>> Reader::list(const Entry& entry) {
  if (!entry.value.IsSequence()) {
    expected(entry, "a list");
    return std::nullopt;
  }
  std::vector<std::string> result;
  for (const auto& element : entry.value) {
    if (element.IsScalar()) {
      result.push_back(element.Scalar());
    } else {
      const Mark mark = element.IsNull() ? entry.value_mark() : mark_of(element.Mark());
      fault(mark, entry.key + ": expected a list of single values; one is " + kind_of(element));
    }
  }
  return result;
}

void Reader::require(const YAML::Node& map, std::initializer_list<const char*> keys) {
  for (const char* key : keys)
    if (!map[key].IsDefined())
      fault(mark_of(map.Mark()), "key '" + std::string(key) + "' is missing");
}

void Reader::set(const Fields& fields, const Entry& entry) {
  const auto text = scalar(entry);
  if (!text) return;
  try {
    set_field(fields, entry.key, {*text});
  } catch (const ParameterError& error) {
    fault(entry.value_mark(), error.what());
  }
}

void Reader::check_name(std::string_view name, Mark mark) {
  if (is_name(name)) return;
  fault(mark,
        "'" + std::string(name) +
            "' is not a name: a lower-case letter, then lower-case letters, digits, '_', '-'");
}

void Reader::read_version(const Entry& entry) {
  const auto version = scalar(entry);
  if (version && *version != "1")
    fault(entry.value_mark(), "version '" + *version + "' is not known, only version 1");
}

void Reader::read_dds(const Entry& entry, Dds& dds) {
  for (const auto& item : entries(entry, {"domain", "rate", "discovery", "security"})) {
    if (item.key == "domain" || item.key == "rate") set(describe(dds), item);
    if (item.key == "discovery") read_discovery(item, dds);
    if (item.key == "security") read_security(item, dds);
  }
}

void Reader::read_security(const Entry& entry, Dds& dds) {
  dds.security = scalar(entry).value_or("");
  dds.security_mark = entry.value_mark();
  if (entry.value.IsScalar() && dds.security.empty())
    fault(entry.value_mark(), "security: expected a folder of keys; it is empty");
}

void Reader::read_discovery(const Entry& entry, Dds& dds) {
  const auto items =
      entry.value.IsMap() ? entries(entry, {"peers", "server"}) : std::vector<Entry>{};
  if (entry.value.IsScalar() && entry.value.Scalar() == "multicast") {
    dds.discovery = Discovery::multicast;
  } else if (items.size() != 1) {
    fault(entry.value_mark(),
          "discovery is one of: multicast, {peers: [ADDRESS, ...]}, {server: HOST:PORT}");
  } else if (items[0].key == "peers") {
    dds.discovery = Discovery::peers;
    dds.peers = list(items[0]).value_or(std::vector<std::string>{});
    if (items[0].value.IsSequence() && items[0].value.size() == 0)
      fault(items[0].value_mark(), "peers: at least one address is needed");
  } else {
    dds.discovery = Discovery::server;
    dds.server = scalar(items[0]).value_or("");
    if (items[0].value.IsScalar() && !is_host_and_port(dds.server))
      fault(items[0].value_mark(), "server: '" + dds.server + "' is not of the form HOST:PORT");
  }
}

Host Reader::read_host(const Entry& entry) {
  check_name(entry.key, entry.mark);
  Host host{.name = entry.key, .mark = entry.mark};
  for (const auto& item : entries(entry, {"address"})) host.address = scalar(item).value_or("?");
  if (entry.value.IsMap() && host.address.empty())
    fault(entry.mark, "host '" + host.name + "' has no address");
  return host;
}

Connection Reader::read_input(const Entry& entry) {
  Connection connection{.port = entry.key, .mark = entry.mark, .value_mark = entry.value_mark()};
  const auto text = scalar(entry);
  if (!text) return connection;
  const std::size_t slash = text->find('/');
  const std::string from_stage = text->substr(0, slash);
  const std::string from_port = slash == std::string::npos ? "" : text->substr(slash + 1);
  if (from_stage.empty() || from_port.empty() || from_port.find('/') != std::string::npos) {
    fault(connection.value_mark, entry.key + ": '" + *text + "' is not of the form STAGE/PORT");
  } else {
    connection.from_stage = from_stage;
    connection.from_port = from_port;
  }
  return connection;
}

PortInfo Reader::read_output(const Entry& entry) {
  check_name(entry.key, entry.mark);
  return {.name = entry.key, .type = scalar(entry).value_or("")};
}

std::optional<Setting> Reader::read_setting(const Entry& entry) {
  Setting setting{.name = entry.key,
                  .is_list = entry.value.IsSequence(),
                  .mark = entry.mark,
                  .value_mark = entry.value_mark()};
  if (setting.is_list) {
    setting.value = *list(entry);
  } else if (entry.value.IsScalar()) {
    setting.value = {entry.value.Scalar()};
  } else {
    expected(entry, "a single value or a list");
    return std::nullopt;
  }
  return setting;
}

void Reader::read_stage_entry(const Entry& entry, StageNode& stage) {
  const auto read_text = [&](std::string& text) {
    stage.marks[entry.key] = entry.value_mark();
    text = scalar(entry).value_or("");
    if (entry.value.IsScalar() && text.empty())
      fault(entry.value_mark(), entry.key + ": expected a single value; it is empty");
  };
  if (entry.key == "use") read_text(stage.use);
  if (entry.key == "exec") read_text(stage.exec);
  if (entry.key == "host") read_text(stage.host);
  if (entry.key == "inputs")
    for (const auto& item : entries(entry)) stage.inputs.push_back(read_input(item));
  if (entry.key == "outputs") {
    for (const auto& item : entries(entry)) {
      stage.outputs.push_back(read_output(item));
      stage.marks["outputs." + item.key] = item.value_mark();
    }
  }
  if (entry.key == "params")
    for (const auto& item : entries(entry))
      if (auto setting = read_setting(item)) stage.params.push_back(std::move(*setting));
  if (entry.key == "replicas") read_replicas(entry, stage);
  if (entry.key == "restart")
    for (const auto& item : entries(entry, {"policy", "max", "backoff"}))
      set(describe(stage.restart), item);
}

// "replicas: 3" on the stage's host, or "replicas: {HOST: 2, OTHER: 1}".
void Reader::read_replicas(const Entry& entry, StageNode& stage) {
  const auto read_count = [&](const Entry& item, std::string host) {
    ReplicaShare share{.host = std::move(host), .mark = item.mark};
    const Fields field{integer_field(item.key, share.count, 1, 64, "", "")};
    set(field, item);
    stage.replicas.push_back(std::move(share));
  };
  if (!entry.value.IsMap()) return read_count(entry, "");
  for (const auto& item : entries(entry)) read_count(item, item.key);
  if (stage.replicas.empty())
    fault(entry.value_mark(), "replicas: expected a number, or numbers per host");
}

StageNode Reader::read_stage(const Entry& entry) {
  check_name(entry.key, entry.mark);
  StageNode stage{.name = entry.key, .mark = entry.mark};
  if (!entry.value.IsMap()) stage.marks["use"] = entry.value_mark();  // what it is was unreadable
  for (const auto& item : entries(
           entry, {"use", "exec", "host", "inputs", "outputs", "params", "replicas", "restart"}))
    read_stage_entry(item, stage);
  return stage;
}

void Reader::read_graph(const YAML::Node& root, GraphDescription& graph) {
  require(root, {"version", "graph", "stages"});
  for (const auto& entry :
       entries(root, {"version", "graph", "dds", "window", "deadline", "hosts", "stages"})) {
    if (entry.key == "version") read_version(entry);
    if (entry.key == "graph") {
      graph.graph = scalar(entry).value_or("");
      if (entry.value.IsScalar()) check_name(graph.graph, entry.value_mark());
    }
    if (entry.key == "dds") read_dds(entry, graph.dds);
    if (entry.key == "window" || entry.key == "deadline") set(describe(graph), entry);
    if (entry.key == "hosts")
      for (const auto& item : entries(entry)) graph.hosts.push_back(read_host(item));
    if (entry.key == "stages") {
      graph.mark = entry.mark;
      for (const auto& item : entries(entry)) graph.stages.push_back(read_stage(item));
      if (entry.value.IsMap() && graph.stages.empty())
        fault(entry.value_mark(), "stages: a graph needs a source and a stage that takes frames");
    }
  }
}

GraphDescription Reader::read(std::string_view yaml) {
  GraphDescription graph{.file = file_};
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(std::string(yaml));
    if (documents.empty() || !documents[0].IsMap()) {
      fault({1, 1}, "expected a mapping with the keys version, graph, stages");
    } else {
      read_graph(documents[0], graph);
      if (documents.size() > 1)
        fault(mark_of(documents[1].Mark()), "a graph file is one document, not several");
    }
  } catch (const YAML::Exception& error) {
    fault(mark_of(error.mark), "not YAML: " + error.msg);
  }
  return graph;
}

}  // namespace

GraphDescription parse(std::string_view yaml, const std::string& file, std::vector<Fault>& faults) {
  return Reader(file, faults).read(yaml);
}

GraphDescription parse(std::string_view yaml, const std::string& file) {
  std::vector<Fault> faults;
  GraphDescription graph = parse(yaml, file, faults);
  if (!faults.empty()) throw GraphError(std::move(faults));
  return graph;
}

}  // namespace cosegraph::graph
