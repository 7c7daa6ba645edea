// Writing graph files: GraphDescription to YAML.
#include <algorithm>

#include "graph/description.hpp"

namespace cosegraph::graph {
namespace {

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}
bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

// Words that YAML readers take for something else than text.
bool is_reserved(std::string_view text) {
  static constexpr std::string_view kWords[] = {"~",   "null", "Null", "NULL", "yes", "Yes",
                                                "YES", "no",   "No",   "NO",   "on",  "On",
                                                "ON",  "off",  "Off",  "OFF",  "y",   "n"};
  return std::ranges::find(kWords, text) != std::end(kWords);
}

// Whether the text reads back as it stands, anywhere in a file. Rather too strict than too lax.
bool is_plain(std::string_view text) {
  if (text.empty() || is_reserved(text) || text.back() == ':') return false;
  const bool number = text[0] == '-' && text.size() > 1 && (is_digit(text[1]) || text[1] == '.');
  return (is_letter(text[0]) || is_digit(text[0]) || text[0] == '/' || number) &&
         std::ranges::all_of(text.substr(1), [](char c) {
           return is_letter(c) || is_digit(c) ||
                  std::string_view("_-./+:").find(c) != std::string::npos;
         });
}

std::string escape(char c) {
  static constexpr char kHex[] = "0123456789abcdef";
  if (c == '"' || c == '\\') return {'\\', c};
  if (c == '\n') return "\\n";
  if (c == '\t') return "\\t";
  const auto code = static_cast<unsigned char>(c);
  if (code < 0x20 || code == 0x7f) return {'\\', 'x', kHex[code / 16], kHex[code % 16]};
  return {c};
}

std::string scalar(std::string_view text) {
  if (is_plain(text)) return std::string(text);
  std::string result = "\"";
  for (const char c : text) result += escape(c);
  return result + "\"";
}

// Elements separated by ", ".
class Joined {
 public:
  void add(const std::string& element) { text_ += (text_.empty() ? "" : ", ") + element; }
  void add(std::string_view key, const std::string& value) { add(scalar(key) + ": " + value); }
  std::string map() const { return "{" + text_ + "}"; }
  std::string list() const { return "[" + text_ + "]"; }

 private:
  std::string text_;
};

std::string flow_list(const std::vector<std::string>& values) {
  Joined result;
  for (const auto& value : values) result.add(scalar(value));
  return result.list();
}

std::string discovery(const Dds& dds) {
  Joined result;
  if (dds.discovery == Discovery::multicast) return "multicast";
  if (dds.discovery == Discovery::peers) result.add("peers", flow_list(dds.peers));
  if (dds.discovery == Discovery::server) result.add("server", scalar(dds.server));
  return result.map();
}

// All fields as "key: value".
Joined values(const Fields& fields) {
  Joined result;
  for (const auto& field : fields) result.add(field.name, scalar(field.text()));
  return result;
}

std::string line(int depth, std::string_view key, const std::string& value) {
  return std::string(2 * static_cast<std::size_t>(depth), ' ') + scalar(key) + ":" +
         (value.empty() ? "" : " ") + value + "\n";
}

// On one line, or where that gets long on a line each.
std::string inputs_text(const StageNode& stage) {
  if (stage.inputs.empty()) return "";
  Joined inputs;
  std::string lines = line(2, "inputs", "");
  for (const auto& input : stage.inputs) {
    const std::string from = scalar(input.from_stage + "/" + input.from_port);
    inputs.add(input.port, from);
    lines += line(3, input.port, from);
  }
  const std::string single = line(2, "inputs", inputs.map());
  return single.size() <= 100 ? single : lines;
}

std::string stage_text(StageNode stage) {
  std::string result = line(1, stage.name, "");
  if (!stage.use.empty()) result += line(2, "use", scalar(stage.use));
  if (!stage.exec.empty()) result += line(2, "exec", scalar(stage.exec));
  if (!stage.host.empty()) result += line(2, "host", scalar(stage.host));
  result += inputs_text(stage);
  Joined outputs;
  for (const auto& output : stage.outputs) outputs.add(output.name, scalar(output.type));
  if (!stage.outputs.empty()) result += line(2, "outputs", outputs.map());
  if (!stage.params.empty()) result += line(2, "params", "");
  for (const auto& [name, value, is_list, mark, value_mark] : stage.params)
    result += line(3, name, is_list || value.size() != 1 ? flow_list(value) : scalar(value[0]));
  if (stage.replicas.size() == 1 && stage.replicas[0].host.empty()) {
    result += line(2, "replicas", std::to_string(stage.replicas[0].count));
  } else if (!stage.replicas.empty()) {
    Joined shares;
    for (const auto& share : stage.replicas) shares.add(share.host, std::to_string(share.count));
    result += line(2, "replicas", shares.map());
  }
  Restart defaults;
  if (recipe(describe(stage.restart)) != recipe(describe(defaults)))
    result += line(2, "restart", values(describe(stage.restart)).map());
  return result;
}

}  // namespace

std::string to_yaml(const GraphDescription& graph) {
  GraphDescription copy = graph;  // Fields bind to what can be changed
  Joined dds = values(describe(copy.dds));
  dds.add("discovery", discovery(copy.dds));
  if (!copy.dds.security.empty()) dds.add("security", scalar(copy.dds.security));
  std::string result =
      line(0, "version", "1") + line(0, "graph", scalar(graph.graph)) + line(0, "dds", dds.map());
  for (const auto& field : describe(copy)) result += line(0, field.name, scalar(field.text()));
  if (!graph.hosts.empty()) result += line(0, "hosts", "");
  for (const auto& host : graph.hosts) {
    Joined keys;
    keys.add("address", scalar(host.address));
    result += line(1, host.name, keys.map());
  }
  result += line(0, "stages", "");
  for (const auto& stage : graph.stages) result += stage_text(stage);
  return result;
}

}  // namespace cosegraph::graph
