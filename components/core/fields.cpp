#include "core/fields.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>
#include <utility>

namespace cosegraph {
namespace {

using Text = std::vector<std::string>;

const std::string& single(const Text& text) {
  if (text.size() != 1) throw ParameterError("expected one value, not a list");
  return text[0];
}

std::string shortest(double value) {
  char buffer[32];
  char* const last = buffer + sizeof buffer;
  const bool is_plain = value == std::trunc(value) && std::abs(value) < 1e15;  // 100000, not 1e+05
  const auto [end, error] = is_plain ? std::to_chars(buffer, last, value, std::chars_format::fixed)
                                     : std::to_chars(buffer, last, value);
  return {buffer, end};
}

template <class T>
T parse(const std::string& text, const char* what) {
  T value{};
  const char* last = text.data() + text.size();
  const bool plus = text.starts_with('+') && !text.starts_with("+-");
  const auto [end, error] = std::from_chars(text.data() + (plus ? 1 : 0), last, value);
  if (error == std::errc::result_out_of_range && end == last)
    throw ParameterError("'" + text + "' is too large or too small to be " + what);
  if (error != std::errc() || end != last) throw ParameterError("'" + text + "' is not " + what);
  return value;
}

void check_bounds(double value, double min, double max) {
  if (std::isfinite(value) && value >= min && value <= max) return;
  throw ParameterError(shortest(value) + " is outside " + shortest(min) + " .. " + shortest(max));
}

std::vector<std::string> all_names(const Fields& fields) {
  std::vector<std::string> result;
  for (const auto& field : fields) result.push_back(field.name);
  return result;
}

// A value inside a recipe: separators are escaped, an empty element of a list is "\\0".
std::string escaped(const std::string& value) {
  std::string result;
  for (const char c : value) {
    if (c == '\\' || c == ';' || c == ',') result += '\\';
    result += c;
  }
  return result;
}

std::string unescaped(std::string_view text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool escape = text[i] == '\\' && i + 1 < text.size();
    if (escape && text[++i] == '0') continue;
    result += text[i];
  }
  return result;
}

// The pieces between separators that are not escaped; none of an empty text.
std::vector<std::string_view> split(std::string_view text, char separator) {
  if (text.empty()) return {};
  std::vector<std::string_view> result;
  std::size_t begin = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\\') {
      ++i;
    } else if (text[i] == separator) {
      result.push_back(text.substr(begin, i - begin));
      begin = i + 1;
    }
  }
  result.push_back(text.substr(begin));
  return result;
}

Text recipe_elements(FieldType type, std::string_view value) {
  if (type != FieldType::list) return {unescaped(value)};
  Text result;
  for (const auto element : split(value, ',')) result.push_back(unescaped(element));
  return result;
}

// Fewest insertions, deletions, substitutions and swaps of neighbours, no letter edited twice
// (optimal string alignment), one row of the table at a time.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before_last;
  std::vector<std::size_t> last(b.size() + 1);
  std::iota(last.begin(), last.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::vector<std::size_t> row(b.size() + 1, i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t substituted = last[j] + (a[i] == b[j] ? 0 : 1);
      row[j + 1] = std::min({last[j + 1] + 1, row[j] + 1, substituted});
      if (i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j])
        row[j + 1] = std::min(row[j + 1], before_last[j - 1] + 1);
    }
    before_last = std::exchange(last, std::move(row));
  }
  return last.back();
}

}  // namespace

std::string Field::text() const {
  std::string result;
  for (const auto& element : get()) result += (result.empty() ? "" : ",") + element;
  return result;
}

Field boolean_field(std::string name, bool& value, std::string doc) {
  Field field{.name = std::move(name), .type = FieldType::boolean, .doc = std::move(doc)};
  field.get = [&value] { return Text{value ? "true" : "false"}; };
  field.set = [&value](const Text& text) {
    const std::string& word = single(text);
    if (word != "true" && word != "false")
      throw ParameterError("'" + word + "' is neither true nor false");
    value = word == "true";
  };
  return field;
}

Field integer_field(std::string name, int& value, int min, int max, std::string unit,
                    std::string doc) {
  Field field{.name = std::move(name),
              .type = FieldType::integer,
              .unit = std::move(unit),
              .doc = std::move(doc),
              .min = static_cast<double>(min),
              .max = static_cast<double>(max)};
  field.get = [&value] { return Text{std::to_string(value)}; };
  field.set = [&value, min, max](const Text& text) {
    const auto number = parse<long long>(single(text), "an integer");
    check_bounds(static_cast<double>(number), min, max);
    value = static_cast<int>(number);
  };
  return field;
}

Field seed_field(std::string name, std::uint64_t& value, std::string doc) {
  Field field{.name = std::move(name),
              .type = FieldType::integer,
              .doc = std::move(doc),
              .min = 0.0,
              .max = static_cast<double>(std::numeric_limits<std::uint64_t>::max())};
  field.get = [&value] { return Text{std::to_string(value)}; };
  field.set = [&value](const Text& text) {
    value = parse<std::uint64_t>(single(text), "a non-negative integer");
  };
  return field;
}

Field number_field(std::string name, double& value, double min, double max, std::string unit,
                   std::string doc) {
  Field field{.name = std::move(name),
              .type = FieldType::number,
              .unit = std::move(unit),
              .doc = std::move(doc),
              .min = min,
              .max = max};
  field.get = [&value] { return Text{shortest(value)}; };
  field.set = [&value, min, max](const Text& text) {
    const auto number = parse<double>(single(text), "a number");
    check_bounds(number, min, max);
    value = number;
  };
  return field;
}

Field text_field(std::string name, std::string& value, std::string doc) {
  Field field{.name = std::move(name), .type = FieldType::text, .doc = std::move(doc)};
  field.get = [&value] { return Text{value}; };
  field.set = [&value](const Text& text) { value = single(text); };
  return field;
}

Field list_field(std::string name, std::vector<std::string>& value, std::string doc,
                 std::function<void(const std::string&)> check) {
  Field field{.name = std::move(name), .type = FieldType::list, .doc = std::move(doc)};
  field.get = [&value] { return value; };
  field.set = [&value, check = std::move(check)](const Text& text) {
    if (check)
      for (const auto& element : text) check(element);
    value = text;
  };
  return field;
}

Fields prefixed(std::string_view prefix, Fields fields) {
  for (auto& field : fields) field.name = std::string(prefix) + "." + field.name;
  return fields;
}

Fields concatenated(Fields first, Fields second) {
  for (auto& field : second) first.push_back(std::move(field));
  return first;
}

const Field* find(const Fields& fields, std::string_view name) {
  const auto found = std::ranges::find(fields, name, &Field::name);
  return found == fields.end() ? nullptr : &*found;
}

void set_field(const Fields& fields, std::string_view name, const Text& value) {
  const Field* field = find(fields, name);
  if (field == nullptr)
    throw ParameterError("unknown parameter '" + std::string(name) + "'" +
                         did_you_mean(name, all_names(fields)));
  try {
    field->set(value);
  } catch (const ParameterError& error) {
    throw ParameterError(std::string(name) + ": " + error.what());
  }
}

std::string recipe(const Fields& fields) {
  std::string result;
  for (const auto& field : fields) {
    std::string value;
    for (const auto& element : field.get()) {
      if (!value.empty()) value += ',';
      value += element.empty() && field.type == FieldType::list ? "\\0" : escaped(element);
    }
    result += (result.empty() ? "" : ";") + field.name + "=" + value;
  }
  return result;
}

void apply_recipe(const Fields& fields, std::string_view text) {
  std::set<std::string_view> given;
  for (const auto item : split(text, ';')) {
    const std::size_t equals = item.find('=');
    if (equals == std::string_view::npos)
      throw ParameterError("recipe item '" + std::string(item) + "' has no '='");
    const std::string_view name = item.substr(0, equals);
    if (!given.insert(name).second)
      throw ParameterError("recipe gives '" + std::string(name) + "' twice");
    const Field* field = find(fields, name);
    const FieldType type = field == nullptr ? FieldType::text : field->type;
    set_field(fields, name, recipe_elements(type, item.substr(equals + 1)));
  }
  for (const auto& field : fields)
    if (!given.contains(field.name))
      throw ParameterError("recipe lacks '" + field.name + "': '" + std::string(text) + "'");
}

std::optional<std::string> nearest_name(std::string_view word,
                                        const std::vector<std::string>& candidates) {
  std::optional<std::string> best;
  std::size_t best_distance = std::max<std::size_t>(1, word.size() / 3) + 1;
  for (const auto& candidate : candidates) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance >= std::min(best_distance, std::max(word.size(), candidate.size()))) continue;
    best_distance = distance;
    best = candidate;
  }
  return best;
}

std::string did_you_mean(std::string_view word, const std::vector<std::string>& candidates) {
  const auto nearest = nearest_name(word, candidates);
  return nearest ? "; did you mean '" + *nearest + "'?" : "";
}

}  // namespace cosegraph
