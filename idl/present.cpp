#include "idl/present.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <ctime>
#include <limits>
#include <nlohmann/json.hpp>
#include <ranges>
#include <span>

#include "core/vectors.hpp"

namespace cosegraph::idl {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kRangesShown = 4;  // columns with a range of their own

// The shortest text that reads back as the same value of its type.
template <class T>
std::string shortest(T value) {
  char text[40];
  const auto [end, error] = std::to_chars(text, text + sizeof text, value);
  return error == std::errc() ? std::string(text, end) : "?";
}

std::string number_text(const Number& number) {
  if (const bool* flag = std::get_if<bool>(&number)) return *flag ? "true" : "false";
  return std::visit(
      [](auto value) -> std::string {
        if constexpr (std::is_same_v<decltype(value), bool>)
          return "";
        else
          return shortest(value);
      },
      number);
}

// For a summary; a few digits tell enough.
std::string rough(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

Json number_json(const Number& number) {
  return std::visit(
      [](auto value) -> Json {
        if constexpr (std::is_same_v<decltype(value), float>) {
          double same = 0.0;  // 0.1 instead of 0.10000000149
          const std::string text = shortest(value);
          std::from_chars(text.data(), text.data() + text.size(), same);
          return std::isfinite(value) ? Json(same) : Json(nullptr);
        } else {
          return value;
        }
      },
      number);
}

std::string quoted(std::string_view text) {
  return Json(std::string(text)).dump(-1, ' ', true, Json::error_handler_t::replace);
}

// As it is where YAML reads it as a text, else quoted.
std::string plain(std::string_view text) {
  const auto harmless = [](unsigned char c) {
    return std::isalnum(c) != 0 ||
           std::string_view("_-./+=;*()': ").find(static_cast<char>(c)) != std::string_view::npos;
  };
  const bool is_plain =
      !text.empty() && std::isalpha(static_cast<unsigned char>(text[0])) != 0 &&
      text.back() != ' ' && text.back() != ':' && text.find(": ") == std::string_view::npos &&
      std::ranges::all_of(text, harmless) && text != "true" && text != "false" && text != "null";
  return is_plain ? std::string(text) : quoted(text);
}

// " # 2026-01-31T12:00:00.250Z"
std::string time_comment(std::int64_t nanoseconds) {
  const auto seconds = static_cast<std::time_t>(nanoseconds / 1'000'000'000);
  std::tm parts{};
  char text[48] = {};
  if (nanoseconds < 0 || ::gmtime_r(&seconds, &parts) == nullptr) return "";
  const std::size_t end = std::strftime(text, sizeof text, "  # %Y-%m-%dT%H:%M:%S", &parts);
  std::snprintf(text + end, sizeof text - end, ".%03dZ",
                static_cast<int>(nanoseconds / 1'000'000 % 1000));
  return text;
}

const char* kind_text(Kind kind) {
  switch (kind) {
    case Kind::boolean:
      return "booleans";
    case Kind::octet:
      return "octets";
    case Kind::float32:
    case Kind::float64:
      return "floats";
    case Kind::text:
      return "texts";
    case Kind::structure:
      return "structures";
    default:
      return "integers";
  }
}

std::string summary_text(const Node& list) {
  const Summary summary = summary_of(list);
  std::string text = std::to_string(summary.rows);
  if (summary.columns > 1) text += " x " + std::to_string(summary.columns);
  text += std::string(" ") + kind_text(list.kind);
  for (std::size_t c = 0; c < summary.least.size(); ++c)
    text += std::string(c == 0 ? ", " : " x ") + "[" + rough(summary.least[c]) + " .. " +
            rough(summary.greatest[c]) + "]";
  if (summary.nans > 0) text += ", " + std::to_string(summary.nans) + " NaN";
  return text;
}

std::string flow_list(const Node& list, std::size_t begin, std::size_t end) {
  std::string text = "[";
  for (std::size_t i = begin; i < end; ++i)
    text += (i == begin ? "" : ", ") +
            (list.kind == Kind::text ? plain(list.texts[i]) : number_text(list.number(i)));
  return text + "]";
}

class Writer {
 public:
  explicit Writer(const Presentation& presentation) : presentation_(presentation) {}

  void value(const Node& node, int depth) {
    if (node.kind == Kind::structure)
      node.is_list ? structures(node, depth) : members(node, depth);
    else if (node.is_list)
      list(node, depth);
    else if (node.kind == Kind::text)
      text_ += " " + plain(node.texts[0]) + "\n";
    else
      text_ += " " + number_text(node.number(0)) +
               (node.is_time ? time_comment(std::get<std::int64_t>(node.number(0))) : "") + "\n";
  }

  void members(const Node& node, int depth) {
    if (depth > 0) text_ += "\n";
    for (const auto& member : node.members) named(member, depth);
  }

  std::string take() { return std::move(text_); }

 private:
  void named(const Node& member, int depth) {
    indent(depth);
    text_ += std::string(member.name) + ":";
    value(member, depth + 1);
  }

  void list(const Node& list, int depth) {
    if (!presentation_.whole && list.size() > presentation_.longest) {
      if (list.kind == Kind::text)
        text_ += " " + flow_list(list, 0, presentation_.longest) + "  # the first of " +
                 std::to_string(list.size()) + "\n";
      else
        text_ += " " + summary_text(list) + "\n";
    } else if (list.columns > 1) {
      text_ += "\n";
      for (std::size_t i = 0; i < list.size(); i += list.columns) {
        indent(depth);
        text_ += "- " + flow_list(list, i, i + list.columns) + "\n";
      }
    } else {
      text_ += " " + flow_list(list, 0, list.size()) + "\n";
    }
  }

  void structures(const Node& list, int depth) {
    if (list.members.empty()) text_ += " []";
    text_ += "\n";
    const std::size_t shown =
        presentation_.whole ? list.size() : std::min(list.size(), presentation_.longest);
    for (std::size_t i = 0; i < shown; ++i) {
      bool first = true;
      for (const auto& member : list.members[i].members) {
        if (first) {
          indent(depth);
          text_.append("- ").append(member.name).append(":");
          value(member, depth + 2);
        } else {
          named(member, depth + 1);
        }
        first = false;
      }
    }
    if (shown == list.size()) return;
    indent(depth);
    text_ += "# " + std::to_string(list.size() - shown) + " more\n";
  }

  void indent(int depth) { text_.append(2 * static_cast<std::size_t>(depth), ' '); }

  Presentation presentation_;
  std::string text_;
};

Json list_json(const Node& list, const Presentation& presentation);

Json element_json(const Node& list, std::size_t index, const Presentation& presentation) {
  // A text of a stranger may be no UTF-8, which JSON has to be.
  if (list.kind == Kind::text) return Json::parse(quoted(list.texts[index]));
  if (list.kind == Kind::structure) return to_json(list.members[index], presentation);
  return number_json(list.number(index));
}

Json summary_json(const Node& list, const Presentation& presentation) {
  Json result{{"count", list.size()}};
  if (!list.is_number()) {
    Json first = Json::array();
    for (std::size_t i = 0; i < presentation.longest; ++i)
      first.push_back(element_json(list, i, presentation));
    result["first"] = std::move(first);
    return result;
  }
  const Summary summary = summary_of(list);
  result["rows"] = summary.rows;
  result["columns"] = summary.columns;
  result["nan"] = summary.nans;
  result["min"] = summary.least;
  result["max"] = summary.greatest;
  return result;
}

Json list_json(const Node& list, const Presentation& presentation) {
  if (!presentation.whole && list.size() > presentation.longest)
    return summary_json(list, presentation);
  Json result = Json::array();
  for (std::size_t i = 0; i < list.size(); ++i)
    result.push_back(element_json(list, i, presentation));
  return result;
}

// -- summaries -----------------------------------------------------------------------------------

// Range of each column, and how many are NaN. No comparison with NaN is true.
void summarise(std::span<const double> values, std::size_t columns, Summary& summary) {
  std::size_t c = 0;
  for (const double value : values) {
    if (value < summary.least[c]) summary.least[c] = value;
    if (value > summary.greatest[c]) summary.greatest[c] = value;
    summary.nans += std::isnan(value) ? 1 : 0;
    if (++c == columns) c = 0;
  }
}

// The same for long lists: in lanes whose number is a multiple of 1, 2, 3 and 4 columns.
void summarise(std::span<const float> values, std::size_t columns, Summary& summary) {
  constexpr std::size_t kVectors = 3;
  constexpr std::size_t kLanes = kVectors * kWidth<Narrow>;
  using Counts [[gnu::vector_size(sizeof(Narrow))]] = std::int32_t;
  std::array<Narrow, kVectors> least;
  std::array<Narrow, kVectors> greatest;
  std::array<Counts, kVectors> nans{};
  least.fill(Narrow{} + std::numeric_limits<float>::infinity());
  greatest.fill(Narrow{} - std::numeric_limits<float>::infinity());
  const std::size_t whole = values.size() / kLanes * kLanes;
  for (std::size_t at = 0; at < whole; at += kLanes)
    for (std::size_t v = 0; v < kVectors; ++v) {
      const auto value = load<Narrow>(values.data() + at + v * kWidth<Narrow>);
      least[v] = value < least[v] ? value : least[v];
      greatest[v] = value > greatest[v] ? value : greatest[v];
      nans[v] -= value != value;  // true is -1
    }
  for (std::size_t lane = 0; lane < (whole > 0 ? kLanes : 0); ++lane) {
    const std::size_t v = lane / kWidth<Narrow>;
    const std::size_t i = lane % kWidth<Narrow>;
    double& low = summary.least[lane % columns];
    double& high = summary.greatest[lane % columns];
    low = std::min(low, static_cast<double>(least[v][i]));
    high = std::max(high, static_cast<double>(greatest[v][i]));
    summary.nans += static_cast<std::size_t>(nans[v][i]);
  }
  const std::vector<double> rest(values.begin() + static_cast<std::ptrdiff_t>(whole), values.end());
  summarise(std::span<const double>(rest), columns, summary);
}

}  // namespace

Summary summary_of(const Node& list) {
  Summary summary{.rows = list.size() / list.columns, .columns = list.columns};
  const std::size_t ranges = list.columns <= kRangesShown ? list.columns : 1;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  auto& least = summary.least;
  auto& greatest = summary.greatest;
  least.assign(ranges, kInfinity);
  greatest.assign(ranges, -kInfinity);
  if (list.kind == Kind::float32)
    summarise(std::span<const float>(list.all_as<float>()), ranges, summary);
  else
    summarise(std::span<const double>(list.all_as<double>()), ranges, summary);
  // A column of nothing but NaN has no range; then the list as a whole is described.
  if (std::ranges::any_of(std::views::iota(std::size_t{0}, ranges),
                          [&](std::size_t c) { return least[c] > greatest[c]; })) {
    const double low = *std::ranges::min_element(least);
    const double high = *std::ranges::max_element(greatest);
    least.assign(low <= high ? 1 : 0, low);
    greatest.assign(low <= high ? 1 : 0, high);
  }
  return summary;
}

std::string to_text(const Node& node, const Presentation& presentation) {
  Writer writer(presentation);
  writer.value(node, 0);
  std::string text = writer.take();
  return text.starts_with(' ') || text.starts_with('\n') ? text.substr(1) : text;
}

Json to_json(const Node& node, const Presentation& presentation) {
  if (node.is_list) return list_json(node, presentation);
  if (node.kind != Kind::structure) return element_json(node, 0, presentation);
  Json result = Json::object();
  for (const auto& member : node.members)
    result[std::string(member.name)] = to_json(member, presentation);
  return result;
}

}  // namespace cosegraph::idl
