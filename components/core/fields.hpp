// Parameters that describe themselves.
//
// Every component has a plain `struct Params` (a default is written there, once) and a function
// `Fields describe(Params&)` that binds each member to its name, unit, bounds and meaning. The
// graph checker, --help, the JSON schema, the parameter reference and the recipe text in models
// all read these Fields.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/names.hpp"

namespace cosegraph {

enum class FieldType { boolean, integer, number, text, choice, list };

// One parameter, bound to a member of a living Params object.
struct Field {
  std::string name;
  FieldType type = FieldType::number;
  std::string unit;  // "m", "deg", "scale" (multiples of the cloud's scale), "" (a plain number)
  std::string doc;   // one sentence
  double min = 0.0;  // inclusive; integer and number only
  double max = 0.0;
  std::vector<std::string> choices;  // choice only

  // The value as text, one element unless `type` is list. Numbers round-trip exactly.
  std::function<std::vector<std::string>()> get;
  // Throws ParameterError (without the field's name) on text of the wrong type or out of bounds.
  std::function<void(const std::vector<std::string>&)> set;

  std::string text() const;  // get(), a list joined with ","
};

using Fields = std::vector<Field>;

Field boolean_field(std::string name, bool& value, std::string doc);
Field integer_field(std::string name, int& value, int min, int max, std::string unit,
                    std::string doc);
Field seed_field(std::string name, std::uint64_t& value, std::string doc);
Field number_field(std::string name, double& value, double min, double max, std::string unit,
                   std::string doc);
Field text_field(std::string name, std::string& value, std::string doc);
// Each element goes through `check`, which throws ParameterError.
Field list_field(std::string name, std::vector<std::string>& value, std::string doc,
                 std::function<void(const std::string&)> check = {});

template <class E>
Field choice_field(std::string name, E& value, std::string doc) {
  Field field{.name = std::move(name), .type = FieldType::choice, .doc = std::move(doc)};
  for (const auto& [key, text] : names<E>()) field.choices.emplace_back(text);
  field.get = [&value] { return std::vector<std::string>{std::string(to_name(value))}; };
  field.set = [&value](const std::vector<std::string>& text) {
    if (text.size() != 1) throw ParameterError("expected one value, not a list");
    value = from_name<E>(text[0]);
  };
  return field;
}

// `fields` with "PREFIX." before every name: parameters of a component inside another's.
Fields prefixed(std::string_view prefix, Fields fields);

// Both lists, in order.
Fields concatenated(Fields first, Fields second);

const Field* find(const Fields& fields, std::string_view name);

// Sets one field by name. Throws ParameterError "NAME: reason", with a "did you mean" for an
// unknown name.
void set_field(const Fields& fields, std::string_view name, const std::vector<std::string>& value);

// The canonical text of all values, "name=value;name=value", list elements separated by ','; in a
// value '\\', ';' and ',' have a '\\' before them. Two Params objects are equal exactly if their
// recipes are: results made with different recipes are not comparable.
std::string recipe(const Fields& fields);

// Sets all fields from a recipe. Throws ParameterError on an unknown, missing or repeated name or a
// bad value; the fields before it are then set already.
void apply_recipe(const Fields& fields, std::string_view text);

// The candidate nearest to `word` by edit distance (a swap of neighbours counts once), for "did you
// mean"; the first of equally near ones, none if all are far.
std::optional<std::string> nearest_name(std::string_view word,
                                        const std::vector<std::string>& candidates);

// "; did you mean 'X'?" or nothing.
std::string did_you_mean(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace cosegraph
