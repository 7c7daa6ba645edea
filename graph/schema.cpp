// The JSON schema of graph files, made from the same declarations as the check.
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "graph/description.hpp"

namespace cosegraph::graph {
namespace {

using Json = nlohmann::ordered_json;

Json text(const std::string& description) {
  return {{"type", "string"}, {"description", description}};
}

// What an editor's reader takes for a number or a truth value is text as well, where text belongs.
Json any_scalar() {
  return {{"type", {"string", "number", "boolean"}}};
}

Json object(Json properties, std::vector<std::string> required = {}) {
  Json result = {
      {"type", "object"}, {"properties", std::move(properties)}, {"additionalProperties", false}};
  if (!required.empty()) result["required"] = std::move(required);
  return result;
}

// A mapping from names to `values`.
Json named(Json values) {
  return {{"type", "object"},
          {"propertyNames", {{"pattern", "^" + std::string(kNamePattern) + "$"}}},
          {"additionalProperties", std::move(values)}};
}

// Whole numbers are written without a fraction; the bounds of seeds do not fit a signed integer.
Json bound(double value, FieldType type) {
  if (type != FieldType::integer) return value;
  if (value >= 0x1p64) return std::numeric_limits<std::uint64_t>::max();
  return static_cast<std::int64_t>(value);
}

// The default as JSON: numbers and truth values as such.
Json default_of(const Field& field) {
  const auto value = field.get();
  switch (field.type) {
    case FieldType::list:
      return value;
    case FieldType::boolean:
    case FieldType::integer:
    case FieldType::number:
      return Json::parse(value.at(0), nullptr, false);
    default:
      return value.at(0);
  }
}

Json type_of(const Field& field) {
  switch (field.type) {
    case FieldType::boolean:
      return {{"type", "boolean"}};
    case FieldType::integer:
    case FieldType::number:
      return {{"type", field.type == FieldType::integer ? "integer" : "number"},
              {"minimum", bound(field.min, field.type)},
              {"maximum", bound(field.max, field.type)}};
    case FieldType::choice:
      return {{"enum", field.choices}};
    case FieldType::list:
      return {{"type", {"array", "string", "number", "boolean"}}, {"items", any_scalar()}};
    case FieldType::text:
      return any_scalar();
  }
  return {};
}

Json schema_of(const Field& field) {
  Json result = type_of(field);
  result["description"] = field.doc + (field.unit.empty() ? "" : " Unit: " + field.unit + ".");
  result["default"] = default_of(field);
  return result;
}

Json properties_of(const Fields& fields) {
  Json result = Json::object();
  for (const auto& field : fields) result[field.name] = schema_of(field);
  return result;
}

Json connection(const std::string& description) {
  return {{"type", "string"},
          {"pattern", "^[^/]+/[^/]+$"},
          {"description", description + " As STAGE/PORT."}};
}

// What holds for the inputs and parameters of a stage whose `use` names this kind.
Json rule_for(const StageInfo& info) {
  Json inputs = Json::object();
  std::vector<std::string> required;
  for (const auto& port : info.inputs) {
    inputs[port.name] = connection(port.doc + " Takes " + port.type + ".");
    if (!port.optional) required.push_back(port.name);
  }
  Json then = {{"properties",
                {{"inputs", object(std::move(inputs), required)},
                 {"params", object(properties_of(info.parameters))}}}};
  if (!required.empty()) then["required"] = {"inputs"};
  return {{"if", {{"properties", {{"use", {{"const", info.kind}}}}}, {"required", {"use"}}}},
          {"then", std::move(then)}};
}

Json kinds_of(const Catalog& catalog) {
  Json result = Json::array();
  for (const auto& [kind, make] : catalog)
    result.push_back({{"const", kind}, {"description", make().summary}});
  return result;
}

Json message_types_of(const Catalog& catalog) {
  std::set<std::string> types;
  for (const auto& [kind, make] : catalog) {
    const StageInfo info = make();
    for (const auto* ports : {&info.inputs, &info.outputs})
      for (const auto& port : *ports) types.insert(port.type);
  }
  return types;
}

Json stage_schema(const Catalog& catalog) {
  Restart restart;
  const Json count = {{"type", "integer"}, {"minimum", 1}, {"maximum", 64}};
  Json properties = {
      {"use", {{"oneOf", kinds_of(catalog)}, {"description", "Kind of stage."}}},
      {"exec", text("Executable of a stage of your own, relative to the graph file.")},
      {"host", text("Name of the host that the stage runs on; this one if none is given.")},
      {"inputs",
       {{"description", "What feeds each input."},
        {"type", "object"},
        {"additionalProperties", connection("Where it comes from.")}}},
      {"outputs", named({{"enum", message_types_of(catalog)},
                         {"description", "Message type of this output of an exec stage."}})},
      {"params",
       {{"type", "object"}, {"description", "Parameters that differ from their defaults."}}},
      {"replicas",
       {{"description",
         "How many processes share the frames of this stage out: a number, or a number per host."},
        {"oneOf", {count, {{"type", "object"}, {"additionalProperties", count}}}}}},
      {"restart", object(properties_of(describe(restart)))}};
  Json result = object(std::move(properties));
  result["oneOf"] = {{{"required", {"use"}}, {"not", {{"required", {"outputs"}}}}},
                     {{"required", {"exec"}}}};
  result["allOf"] = Json::array();
  for (const auto& [kind, make] : catalog) result["allOf"].push_back(rule_for(make()));
  return result;
}

Json discovery_schema() {
  const Json peers = {{"type", "array"},
                      {"items", text("Address of a host.")},
                      {"minItems", 1},
                      {"description", "Hosts to look for participants on, without multicast."}};
  Json server = text("HOST:PORT of a discovery server.");
  server["pattern"] = "^.+:[0-9]+$";
  Json result = {{"description", "How participants find each other."}, {"default", "multicast"}};
  result["oneOf"] =
      Json::array({Json{{"const", "multicast"}}, object({{"peers", peers}}, {"peers"}),
                   object({{"server", server}}, {"server"})});
  return result;
}

Json dds_schema() {
  Dds dds;
  Json properties = properties_of(describe(dds));
  properties["discovery"] = discovery_schema();
  properties["security"] = text(
      "Folder of keys, relative to the graph file; participants are authenticated and what they "
      "send is encrypted if it is given. Made by 'cosegraph keys'.");
  return object(std::move(properties));
}

}  // namespace

std::string json_schema(const Catalog& catalog) {
  GraphDescription graph;
  Json name = text("Name of the graph: first part of its topics' names, and its DDS partition.");
  name["pattern"] = "^" + std::string(kNamePattern) + "$";
  Json properties = {{"version", {{"const", 1}, {"description", "Of the file format."}}},
                     {"graph", std::move(name)},
                     {"dds", dds_schema()}};
  properties.update(properties_of(describe(graph)));
  properties["hosts"] = named(object({{"address", text("Name or IP address.")}}, {"address"}));
  properties["stages"] = named({{"$ref", "#/$defs/stage"}});
  properties["stages"]["minProperties"] = 1;

  Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"},
                 {"title", "cosegraph graph file"}};
  schema.update(object(std::move(properties), {"version", "graph", "stages"}));
  schema["$defs"] = {{"stage", stage_schema(catalog)}};
  return schema.dump(2) + "\n";
}

}  // namespace cosegraph::graph
