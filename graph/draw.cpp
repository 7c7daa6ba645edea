// Drawing graphs with Graphviz.
#include <algorithm>
#include <cctype>
#include <map>
#include <set>

#include "graph/description.hpp"

namespace cosegraph::graph {
namespace {

constexpr const char* kFrames = "#33475b";   // edges that carry one message per frame
constexpr const char* kLatched = "#9a5b00";  // edges that keep the newest message

// Frames of the boxes of a running graph.
constexpr const char* kIdle = "#9aa5b1";
constexpr const char* kBusy = "#1d8a2f";
constexpr const char* kWrong = "#c62020";

// Role of a stage in the graph, which its colour shows.
enum class Role { source, work, leaf, provider };

struct Look {
  const char* name;
  const char* fill;
  const char* border;
};

Look look_of(Role role) {
  switch (role) {
    case Role::source:
      return {"source", "#d9ead3", "#4c7a34"};
    case Role::leaf:
      return {"leaf", "#fde3cf", "#b8662a"};
    case Role::provider:
      return {"latched", "#fff2c2", "#9a7b00"};
    case Role::work:
      break;
  }
  return {"stage", "#e4ecf5", "#3f6291"};
}

// Text inside an HTML-like label.
std::string html(std::string_view text) {
  static const std::map<char, std::string> kEntities = {
      {'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}};
  std::string result;
  for (const char c : text) {
    const auto entity = kEntities.find(c);
    const bool control = static_cast<unsigned char>(c) < 0x20;
    result += entity != kEntities.end() ? entity->second : std::string(1, control ? ' ' : c);
  }
  return result;
}

// The end of a long text, which tells more of a path than its beginning; whole UTF-8 characters.
std::string shortened(std::string_view text) {
  constexpr std::size_t kLongest = 36;
  if (text.size() <= kLongest) return std::string(text);
  text.remove_prefix(text.size() - kLongest + 3);
  while (!text.empty() && (static_cast<unsigned char>(text[0]) & 0xc0) == 0x80)
    text.remove_prefix(1);
  return std::string("...").append(text);
}

// A string of Graphviz's own grammar.
std::string dot_string(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + "\"";
}

// The second line may be empty.
std::string two_lines(std::string_view first, std::string_view second) {
  std::string text = dot_string(first);
  if (second.empty()) return text;
  text.pop_back();
  return text + "\\n" + dot_string(second).substr(1);
}

std::string font(const std::string& attributes, const std::string& content) {
  return "<FONT " + attributes + ">" + content + "</FONT>";
}

std::string row(const std::string& align, const std::string& content) {
  return "<TR><TD ALIGN=\"" + align + "\">" + content + "</TD></TR>";
}

// "name = value" of every parameter that is not at its default.
std::vector<std::string> changed_parameters(const StageNode& stage, const StageInfo& info) {
  std::vector<std::string> result;
  for (const auto& setting : stage.params) {
    if (const Field* field = find(info.parameters, setting.name); field != nullptr) {
      const auto by_default = field->get();
      field->set(setting.value);
      if (field->get() == by_default) continue;
    }
    std::string value;
    for (const auto& element : setting.value) value += (value.empty() ? "" : ", ") + element;
    result.push_back(setting.name + " = " + shortened(value));
  }
  return result;
}

std::string stage_label(const StageNode& stage, const StageInfo& info,
                        const std::vector<std::string>& lines) {
  std::string kind = (stage.exec.empty() ? "" : "exec ") + info.kind;
  if (kind == stage.name) kind.clear();
  std::string second = html(kind);
  if (!stage.host.empty()) second += (kind.empty() ? "" : " ") + html("on " + stage.host);
  std::string rows = row("CENTER", font("POINT-SIZE=\"13\"", "<B>" + html(stage.name) + "</B>"));
  if (!second.empty()) rows += row("CENTER", font("POINT-SIZE=\"10\" COLOR=\"#555555\"", second));
  for (const auto& text : lines) rows += row("LEFT", font("POINT-SIZE=\"10\"", html(text)));
  return "<<TABLE BORDER=\"0\" CELLBORDER=\"0\" CELLSPACING=\"1\" CELLPADDING=\"1\">" + rows +
         "</TABLE>>";
}

const char* color_of(LiveStage::Mood mood) {
  switch (mood) {
    case LiveStage::Mood::busy:
      return kBusy;
    case LiveStage::Mood::wrong:
      return kWrong;
    case LiveStage::Mood::idle:
      break;
  }
  return kIdle;
}

// A stage of a running graph; null: nobody has heard of it.
std::string live_node(const StageNode& stage, const StageInfo& info, Role role,
                      const LiveStage* live) {
  std::vector<std::string> lines{live == nullptr ? "not heard" : live->state};
  if (live != nullptr) lines.insert(lines.end(), live->figures.begin(), live->figures.end());
  return "  " + dot_string(stage.name) + " [label=" + stage_label(stage, info, lines) +
         ", fillcolor=\"" + look_of(role).fill + "\", color=\"" +
         (live == nullptr ? kWrong : color_of(live->mood)) + "\", penwidth=2.4" +
         (live == nullptr ? ", style=\"rounded,filled,dashed\"" : "") + "];\n";
}

Role role_of(const StageNode& stage, const StageInfo& info, const std::set<std::string>& leaves) {
  if (info.is_source()) return Role::source;
  if (leaves.contains(stage.name)) return Role::leaf;
  return info.has_frame_inputs() ? Role::work : Role::provider;
}

std::string node(const StageNode& stage, const StageInfo& info, Role role) {
  const Look look = look_of(role);
  return "  " + dot_string(stage.name) +
         " [label=" + stage_label(stage, info, changed_parameters(stage, info)) + ", fillcolor=\"" +
         look.fill + "\", color=\"" + look.border + "\"];\n";
}

// The message type, and the output's name where the stage gives several of that type.
std::string edge_label(const Connection& input, const PortInfo& port, const StageInfo& from) {
  std::string plain_name = port.type;
  for (char& c : plain_name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  const auto same = std::ranges::count(from.outputs, port.type, &PortInfo::type);
  const bool ambiguous = same > 1 && input.from_port != plain_name;
  return " " + port.type + (ambiguous ? " (" + input.from_port + ") " : " ");
}

std::string edge(const StageNode& stage, const Connection& input, const PortInfo& port,
                 const StageInfo& from, const std::string& live) {
  const std::string color = port.latched ? kLatched : kFrames;
  return "  " + dot_string(input.from_stage) + " -> " + dot_string(stage.name) +
         " [label=" + two_lines(edge_label(input, port, from), live) + ", color=\"" + color +
         "\", fontcolor=\"" + color + "\"" + (port.latched ? ", style=dashed" : "") + "];\n";
}

template <class Value>
const Value* value_of(const std::map<std::string, Value>& map, const std::string& key) {
  const auto found = map.find(key);
  return found == map.end() ? nullptr : &found->second;
}

std::string legend(const std::string& title, const std::set<Role>& roles, bool any_latched) {
  std::string cells;
  for (const Role role : roles) {
    const Look look = look_of(role);
    cells += "<TD BGCOLOR=\"" + std::string(look.fill) + "\" COLOR=\"" + look.border +
             "\" BORDER=\"1\">" + look.name + "</TD>";
  }
  const auto line = [](const char* color, const char* text) {
    return "<TD>" + font(std::string("COLOR=\"") + color + "\"", text) + "</TD>";
  };
  cells += line(kFrames, "&#8212;&#8212; one message per frame");
  if (any_latched) cells += line(kLatched, "&#8211; &#8211; the newest counts (latched)");
  return "<<TABLE BORDER=\"0\" CELLBORDER=\"0\" CELLSPACING=\"6\" CELLPADDING=\"3\"><TR>"
         "<TD><B>" +
         html(title) + "</B></TD>" + cells + "</TR></TABLE>>";
}

}  // namespace

std::string to_dot(const GraphDescription& graph, const Catalog& catalog, const Overlay* overlay) {
  const auto infos = infos_of(graph, catalog);
  const auto leaf_names = leaves_of(graph, catalog);
  const std::set<std::string> leaves(leaf_names.begin(), leaf_names.end());
  std::string nodes;
  std::string edges;
  std::set<Role> roles;
  bool any_latched = false;
  for (std::size_t i = 0; i < infos.size(); ++i) {
    const StageNode& stage = graph.stages[i];
    const Role role = role_of(stage, infos[i], leaves);
    roles.insert(role);
    const LiveStage* live = overlay == nullptr ? nullptr : value_of(overlay->stages, stage.name);
    nodes +=
        overlay == nullptr ? node(stage, infos[i], role) : live_node(stage, infos[i], role, live);
    for (const auto& input : stage.inputs) {
      const PortInfo* port = infos[i].input(input.port);
      if (port == nullptr) throw Error("stage '" + stage.name + "' has no input " + input.port);
      const auto from = std::ranges::find(graph.stages, input.from_stage, &StageNode::name);
      const std::string* text =
          overlay == nullptr
              ? nullptr
              : value_of(overlay->topics, topic_name(graph, input.from_stage, input.from_port));
      edges += edge(stage, input, *port, infos[from - graph.stages.begin()],
                    text == nullptr ? "" : *text);
      any_latched = any_latched || port->latched;
    }
  }
  return "digraph " + dot_string(graph.graph) + " {\n" +
         "  graph [rankdir=TB, fontname=\"Helvetica,Arial,sans-serif\", fontsize=10, labelloc=b,"
         " nodesep=0.45, ranksep=0.5, bgcolor=white,\n    label=" +
         legend(graph.graph + (overlay == nullptr ? "" : overlay->title), roles, any_latched) +
         "];\n" +
         "  node [shape=box, style=\"rounded,filled\", margin=\"0.12,0.06\", penwidth=1.2,"
         " fontname=\"Helvetica,Arial,sans-serif\"];\n" +
         "  edge [fontsize=9, arrowsize=0.7, fontname=\"Helvetica,Arial,sans-serif\"];\n" + nodes +
         edges + "}\n";
}

}  // namespace cosegraph::graph
