// The schema is put to use by a small validator of the keywords that it is written in.
#include <gmock/gmock.h>
#include <yaml-cpp/yaml.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "graph_description/fake_catalog.hpp"

namespace cosegraph::graph::test {
namespace {

using Json = nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const Json& the_schema() {
  static const Json schema = Json::parse(json_schema(fake_catalog()));
  return schema;
}

bool is_a(const Json& value, const std::string& type) {
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "string") return value.is_string();
  if (type == "boolean") return value.is_boolean();
  if (type == "integer") return value.is_number_integer();
  if (type == "number") return value.is_number();
  ADD_FAILURE() << "unknown type " << type;
  return false;
}

bool valid(const Json& value, const Json& schema);

bool valid_type(const Json& value, const Json& type) {
  if (type.is_string()) return is_a(value, type);
  return std::ranges::any_of(type, [&](const Json& one) { return is_a(value, one); });
}

bool valid_object(const Json& value, const Json& schema) {
  for (const auto& key : schema.value("required", Json::array()))
    if (!value.contains(key.get<std::string>())) return false;
  for (const auto& [key, member] : value.items()) {
    if (schema.contains("propertyNames") && !valid(key, schema["propertyNames"])) return false;
    const Json properties = schema.value("properties", Json::object());
    const Json rest = schema.value("additionalProperties", Json(true));
    if (!valid(member, properties.contains(key) ? properties[key] : rest)) return false;
  }
  return value.size() >= schema.value("minProperties", 0U);
}

// Any other keyword than these fails the test, so that none goes untested.
bool valid(const Json& value, const Json& schema) {
  if (schema.is_boolean()) return schema;
  for (const auto& [key, rule] : schema.items()) {
    bool fine = true;
    if (key == "$ref") {
      fine = valid(value, the_schema().at(Json::json_pointer(rule.get<std::string>().substr(1))));
    } else if (key == "type") {
      fine = valid_type(value, rule);
    } else if (key == "const") {
      fine = value == rule;
    } else if (key == "enum") {
      fine = std::ranges::find(rule, value) != rule.end();
    } else if (key == "minimum") {
      fine = !value.is_number() || value >= rule;
    } else if (key == "maximum") {
      fine = !value.is_number() || value <= rule;
    } else if (key == "pattern") {
      fine = !value.is_string() ||
             std::regex_search(value.get<std::string>(), std::regex(rule.get<std::string>()));
    } else if (key == "items") {
      fine = !value.is_array() ||
             std::ranges::all_of(value, [&](const Json& one) { return valid(one, rule); });
    } else if (key == "minItems") {
      fine = !value.is_array() || value.size() >= rule.get<std::size_t>();
    } else if (key == "oneOf") {
      fine = std::ranges::count_if(rule, [&](const Json& one) { return valid(value, one); }) == 1;
    } else if (key == "allOf") {
      fine = std::ranges::all_of(rule, [&](const Json& one) { return valid(value, one); });
    } else if (key == "not") {
      fine = !valid(value, rule);
    } else if (key == "if") {
      fine = !valid(value, rule) || valid(value, schema.at("then"));
    } else if (key == "properties" || key == "required" || key == "additionalProperties" ||
               key == "propertyNames" || key == "minProperties") {
      fine = !value.is_object() || valid_object(value, schema);
    } else {
      static const std::vector<std::string> kSilent = {"$schema", "$defs",       "title",
                                                       "then",    "description", "default"};
      EXPECT_THAT(kSilent, ::testing::Contains(key));
    }
    if (!fine) return false;
  }
  return true;
}

// As an editor's YAML reader takes plain scalars.
Json to_json(const YAML::Node& node) {
  Json result;
  if (node.IsMap())
    for (const auto& pair : node) result[pair.first.Scalar()] = to_json(pair.second);
  if (node.IsSequence()) {
    result = Json::array();
    for (const auto& element : node) result.push_back(to_json(element));
  }
  if (!node.IsScalar()) return node.IsMap() && result.is_null() ? Json::object() : result;
  const Json guess = Json::parse(node.Scalar(), nullptr, false);
  const bool plain = node.Tag() == "?" && !guess.is_discarded();
  return plain ? guess : Json(node.Scalar());
}

bool accepts(const std::string& yaml) {
  return valid(to_json(YAML::Load(yaml)), the_schema());
}

std::string with_stage(const std::string& stage) {
  return "{version: 1, graph: g, stages: {camera: {use: source}, s: " + stage + "}}";
}

const Json& rule_for(const std::string& kind) {
  static const Json kNone;
  for (const auto& rule : the_schema()["$defs"]["stage"]["allOf"])
    if (rule["if"]["properties"]["use"]["const"] == kind) return rule["then"];
  return kNone;
}

TEST(JsonSchema, AcceptsGoodGraphs) {
  EXPECT_TRUE(accepts(kSegmentGraph));
  EXPECT_TRUE(accepts(to_yaml(parsed(kSegmentGraph))));
  EXPECT_TRUE(
      accepts("{version: 1, graph: g, dds: {discovery: {server: a:1}}, stages: "
              "{a: {exec: ./a, outputs: {x: Cloud}}}}"));
  EXPECT_TRUE(accepts(with_stage("{use: source, params: {path: 2024}}")));
  EXPECT_TRUE(
      accepts(with_stage("{use: descriptors, inputs: {cloud: camera/cloud}, params: "
                         "{channels: shot:0.1, threads: 0}}")));
  EXPECT_TRUE(
      accepts(with_stage("{use: fisher, inputs: {cloud: a/b, descriptors: a/b, segments: "
                         "a/b, appearance: a/b}, params: {seed: 18446744073709551615}}")));
}

TEST(JsonSchema, RefusesFaultyGraphs) {
  EXPECT_FALSE(accepts("{graph: g, stages: {a: {use: source}}}"));
  EXPECT_FALSE(accepts("{version: 1, graph: g, stages: {}}"));
  EXPECT_FALSE(accepts("{version: 1, graph: G, stages: {a: {use: source}}}"));
  EXPECT_FALSE(accepts("{version: 1, graph: g, window: 65, stages: {a: {use: source}}}"));
  EXPECT_FALSE(accepts("{version: 1, graph: g, windw: 4, stages: {a: {use: source}}}"));
  EXPECT_FALSE(accepts("{version: 1, graph: g, hosts: {h: {}}, stages: {a: {use: source}}}"));
  EXPECT_FALSE(
      accepts("{version: 1, graph: g, dds: {discovery: unicast}, stages: {a: {use: source}}}"));
  EXPECT_FALSE(accepts(with_stage("{use: nothing}")));
  EXPECT_FALSE(accepts(with_stage("{use: source, exec: ./a}")));
  EXPECT_FALSE(accepts(with_stage("{use: source, outputs: {x: Cloud}}")));
  EXPECT_FALSE(accepts(with_stage("{exec: ./a, outputs: {x: Nothing}}")));
  EXPECT_FALSE(accepts(with_stage("{inputs: {a: b/c}}")));
  EXPECT_FALSE(accepts(with_stage("{use: cpc}")));
  EXPECT_FALSE(accepts(with_stage("{use: cpc, inputs: {supervoxel: a/b}}")));
  EXPECT_FALSE(accepts(with_stage("{use: cpc, inputs: {supervoxels: ab}}")));
  EXPECT_FALSE(accepts(with_stage("{use: source, params: {size: 0.3}}")));
  EXPECT_FALSE(accepts(with_stage("{use: source, params: {loop: 1}}")));
  EXPECT_FALSE(accepts(with_stage("{use: source, params: {path: [a]}}")));
  EXPECT_FALSE(accepts(with_stage("{use: source, params: {nothing: 1}}")));
  EXPECT_FALSE(accepts(with_stage("{use: source, restart: {policy: always}}")));
}

TEST(JsonSchema, CarriesBoundsChoicesDefaultsAndDescriptions) {
  const Json& size = rule_for("source")["properties"]["params"]["properties"]["size"];
  EXPECT_EQ(size["type"], "number");
  EXPECT_EQ(size["minimum"], 0.01);
  EXPECT_EQ(size["maximum"], 0.2);
  EXPECT_EQ(size["default"], 0.04);
  EXPECT_EQ(size["description"], "Size of one. Unit: scale.");
  const Json& mode = rule_for("astar")["properties"]["params"]["properties"]["mode"];
  EXPECT_THAT(mode["enum"], ElementsAre("exact", "greedy"));
  EXPECT_EQ(mode["default"], "exact");
  const Json& seed = rule_for("fisher")["properties"]["params"]["properties"]["seed"];
  EXPECT_EQ(seed["maximum"].get<std::uint64_t>(), ~0ULL);
  const Json& inputs = rule_for("astar")["properties"]["inputs"];
  EXPECT_THAT(inputs["required"], ElementsAre("scores", "segments"));
  EXPECT_THAT(inputs["properties"]["relation"]["description"].get<std::string>(),
              HasSubstr("RelationModel"));
}

TEST(JsonSchema, HasARuleForEveryKind) {
  const Json& use = the_schema()["$defs"]["stage"]["properties"]["use"];
  EXPECT_EQ(use["oneOf"].size(), fake_catalog().size());
  for (const auto& [kind, make] : fake_catalog()) {
    ASSERT_TRUE(rule_for(kind).is_object()) << kind;
    EXPECT_EQ(rule_for(kind)["properties"]["params"]["properties"].size(),
              make().parameters.size());
  }
}

TEST(JsonSchema, NamesItsDraft) {
  EXPECT_EQ(the_schema()["$schema"], "https://json-schema.org/draft/2020-12/schema");
}

}  // namespace
}  // namespace cosegraph::graph::test
