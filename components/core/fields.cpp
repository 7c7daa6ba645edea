#include "core/fields.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numeric>

namespace cosegraph {
namespace {

using Text = std::vector<std::string>;

const std::string& single(const Text& text) {
  if (text.size() != 1) throw ParameterError("expected one value, not a list");
  return text[0];
}

std::string shortest(double value) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value);
  return {buffer, end};
}

template <class T>
T parse(const std::string& text, const char* what) {
  T value{};
  const char* begin = text.data() + (text.starts_with('+') ? 1 : 0);
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    throw ParameterError("'" + text + "' is not " + what);
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
  for (const auto& field : fields)
    result += (result.empty() ? "" : ";") + field.name + "=" + field.text();
  return result;
}

void apply_recipe(const Fields& fields, std::string_view text) {
  std::size_t count = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(';', begin), text.size());
    const std::string_view item = text.substr(begin, end - begin);
    const std::size_t equals = item.find('=');
    if (equals == std::string_view::npos)
      throw ParameterError("recipe item '" + std::string(item) + "' has no '='");
    const std::string_view name = item.substr(0, equals);
    const std::string_view value = item.substr(equals + 1);
    const Field* field = find(fields, name);
    Text elements;
    if (field != nullptr && field->type == FieldType::list) {
      for (std::size_t at = 0; at < value.size();) {
        const std::size_t comma = std::min(value.find(',', at), value.size());
        elements.emplace_back(value.substr(at, comma - at));
        at = comma + 1;
      }
    } else {
      elements.emplace_back(value);
    }
    set_field(fields, name, elements);
    ++count;
    begin = end + 1;
  }
  if (count != fields.size())
    throw ParameterError("recipe has " + std::to_string(count) + " values where " +
                         std::to_string(fields.size()) + " are needed: '" + std::string(text) +
                         "'");
}

std::optional<std::string> nearest_name(std::string_view word,
                                        const std::vector<std::string>& candidates) {
  std::optional<std::string> best;
  std::size_t best_distance = std::max<std::size_t>(1, word.size() / 3) + 1;
  for (const auto& candidate : candidates) {
    std::vector<std::size_t> row(candidate.size() + 1);  // Levenshtein, one row at a time
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 0; i < word.size(); ++i) {
      std::size_t diagonal = row[0];
      row[0] = i + 1;
      for (std::size_t j = 0; j < candidate.size(); ++j) {
        const std::size_t substituted = diagonal + (word[i] == candidate[j] ? 0 : 1);
        diagonal = row[j + 1];
        row[j + 1] = std::min({row[j + 1] + 1, row[j] + 1, substituted});
      }
    }
    if (row.back() < best_distance) {
      best_distance = row.back();
      best = candidate;
    }
  }
  return best;
}

std::string did_you_mean(std::string_view word, const std::vector<std::string>& candidates) {
  const auto nearest = nearest_name(word, candidates);
  return nearest ? "; did you mean '" + *nearest + "'?" : "";
}

}  // namespace cosegraph
