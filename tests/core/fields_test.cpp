#include "core/fields.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <tuple>

#include "core/random.hpp"

namespace cosegraph {

enum class Shade { dark, mid_grey, light };

template <>
Names<Shade> names<Shade>() {
  static constexpr std::pair<Shade, std::string_view> table[] = {
      {Shade::dark, "dark"}, {Shade::mid_grey, "mid-grey"}, {Shade::light, "light"}};
  return table;
}

namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Optional;
using ::testing::ThrowsMessage;

using Text = std::vector<std::string>;

struct Params {
  bool on = false;
  int count = 3;
  std::uint64_t seed = 1;
  double size = 0.25;
  std::string note = "plain";
  Shade shade = Shade::dark;
  std::vector<std::string> parts = {"a", "b"};
};

Fields describe(Params& params) {
  return {
      boolean_field("on", params.on, "Whether it is on."),
      integer_field("count", params.count, -2, 10, "", "How many."),
      seed_field("seed", params.seed, "Seed."),
      number_field("size", params.size, -1e300, 1e300, "m", "How large."),
      text_field("note", params.note, "A remark."),
      choice_field("shade", params.shade, "How bright."),
      list_field("parts", params.parts, "Its parts.",
                 [](const std::string& part) {
                   if (part == "bad") throw ParameterError("'bad' is no part");
                 }),
  };
}

std::string recipe_of(Params params) {
  return recipe(describe(params));
}

// Setting `name` to `value` is refused with exactly `message`, and changes nothing.
void expect_refused(std::string_view name, const Text& value, const std::string& message) {
  Params params;
  const std::string before = recipe_of(params);
  EXPECT_THAT([&] { set_field(describe(params), name, value); },
              ThrowsMessage<ParameterError>(message));
  EXPECT_EQ(recipe_of(params), before);
}

template <class T>
void expect_refused_recipe(const std::string& text, const T& message) {
  Params params;
  EXPECT_THAT([&] { apply_recipe(describe(params), text); },
              ThrowsMessage<ParameterError>(message));
}

std::string random_text(Random& random) {
  static constexpr std::string_view kLetters = "ab0 =;,\\'\"\n#~";
  std::string result;
  for (std::size_t i = random.below(6); i > 0; --i)
    result += kLetters[random.below(kLetters.size())];
  return result;
}

Params random_params(Random& random) {
  Params params;
  params.on = random.below(2) == 1;
  params.count = static_cast<int>(random.below(13)) - 2;
  params.seed = random.next();
  params.size = random.normal() * std::pow(10.0, random.uniform(-200.0, 200.0));
  params.note = random_text(random);
  params.shade = static_cast<Shade>(random.below(3));
  params.parts.resize(random.below(4));
  for (auto& part : params.parts) part = random_text(random);
  return params;
}

bool equal(const Params& a, const Params& b) {
  return std::tie(a.on, a.count, a.seed, a.size, a.note, a.shade, a.parts) ==
         std::tie(b.on, b.count, b.seed, b.size, b.note, b.shade, b.parts);
}

TEST(Recipe, IsTheCanonicalTextOfAllValues) {
  EXPECT_EQ(recipe_of({}), "on=false;count=3;seed=1;size=0.25;note=plain;shade=dark;parts=a,b");
  EXPECT_EQ(recipe({}), "");
}

TEST(Recipe, RoundTripsWhateverTheValues) {
  Random random(1);
  for (int i = 0; i < 5000; ++i) {
    const Params params = random_params(random);
    Params copy;
    ASSERT_NO_THROW(apply_recipe(describe(copy), recipe_of(params))) << recipe_of(params);
    ASSERT_TRUE(equal(params, copy)) << recipe_of(params) << "\n" << recipe_of(copy);
  }
}

TEST(Recipe, TellsDifferentValuesApart) {
  const auto with_parts = [](Text parts) { return recipe_of({.parts = std::move(parts)}); };
  EXPECT_NE(with_parts({}), with_parts({""}));
  EXPECT_NE(with_parts({""}), with_parts({"", ""}));
  EXPECT_NE(with_parts({"a", "b"}), with_parts({"a,b"}));
  EXPECT_NE(with_parts({"\\0"}), with_parts({""}));
  EXPECT_NE(recipe_of({.note = "x;shade=dark"}), recipe_of({.note = "x"}));
  EXPECT_NE(recipe_of({.size = 0.1}), recipe_of({.size = std::nextafter(0.1, 1.0)}));
}

TEST(Recipe, KeepsExtremeNumbers) {
  constexpr double kLeast = std::numeric_limits<double>::denorm_min();
  for (const double value : {0.0, -0.0, kLeast, -kLeast, 1e300, -1e300, 0.1, 1.0 / 3.0, 1e22}) {
    const Params params{.seed = ~0ULL, .size = value};
    Params copy;
    apply_recipe(describe(copy), recipe_of(params));
    EXPECT_EQ(copy.size, value);
    EXPECT_EQ(std::signbit(copy.size), std::signbit(value));
    EXPECT_EQ(copy.seed, ~0ULL);
  }
}

TEST(Recipe, RefusesWhatIsMissingUnknownRepeatedOrMalformed) {
  const std::string fine = recipe_of({});
  expect_refused_recipe("", HasSubstr("recipe lacks 'on'"));
  expect_refused_recipe(fine.substr(0, fine.find(";parts")), HasSubstr("recipe lacks 'parts'"));
  expect_refused_recipe("on=true;" + fine, std::string("recipe gives 'on' twice"));
  expect_refused_recipe("on=true;on=true;seed=1;size=0.25;note=;shade=dark;parts=a",
                        std::string("recipe gives 'on' twice"));
  expect_refused_recipe(fine + ";coutn=1",
                        std::string("unknown parameter 'coutn'; did you mean 'count'?"));
  expect_refused_recipe(fine + ";loose", std::string("recipe item 'loose' has no '='"));
  expect_refused_recipe(fine + ";", std::string("recipe item '' has no '='"));
  expect_refused_recipe("count=11", std::string("count: 11 is outside -2 .. 10"));
}

TEST(Recipe, OfNoFieldsIsEmpty) {
  EXPECT_NO_THROW(apply_recipe({}, ""));
  EXPECT_THROW(apply_recipe({}, "a=1"), ParameterError);
}

TEST(Fields, TakeValuesUpToTheirBounds) {
  Params params;
  const Fields fields = describe(params);
  for (const int value : {-2, 0, 10}) {
    set_field(fields, "count", {std::to_string(value)});
    EXPECT_EQ(params.count, value);
  }
  set_field(fields, "count", {"+7"});
  EXPECT_EQ(params.count, 7);
  set_field(fields, "size", {"-1e300"});
  EXPECT_EQ(params.size, -1e300);
  set_field(fields, "size", {"+.5"});
  EXPECT_EQ(params.size, 0.5);
  set_field(fields, "seed", {"18446744073709551615"});
  EXPECT_EQ(params.seed, ~0ULL);
}

TEST(Fields, RefuseWhatIsOutOfBounds) {
  expect_refused("count", {"-3"}, "count: -3 is outside -2 .. 10");
  expect_refused("count", {"11"}, "count: 11 is outside -2 .. 10");
  expect_refused("count", {"4294967299"}, "count: 4294967299 is outside -2 .. 10");
  expect_refused("size", {"1.1e300"}, "size: 1.1e+300 is outside -1e+300 .. 1e+300");
  expect_refused("size", {"inf"}, "size: inf is outside -1e+300 .. 1e+300");
  expect_refused("size", {"nan"}, "size: nan is outside -1e+300 .. 1e+300");
  expect_refused("size", {"1e999"}, "size: '1e999' is too large or too small to be a number");
  expect_refused("seed", {"18446744073709551616"},
                 "seed: '18446744073709551616' is too large or too small to be a non-negative "
                 "integer");
}

TEST(Fields, RefuseWhatIsOfAnotherType) {
  expect_refused("on", {"yes"}, "on: 'yes' is neither true nor false");
  expect_refused("seed", {"-1"}, "seed: '-1' is not a non-negative integer");
  for (const std::string text : {"", "+", "+-5", "1.0", "1x", " 1", "1 ", "0x10", "one"})
    expect_refused("count", {text}, "count: '" + text + "' is not an integer");
  for (const std::string text : {"", "-", "+-1", "1,5", "0.5m", "1e", "half"})
    expect_refused("size", {text}, "size: '" + text + "' is not a number");
  expect_refused("shade", {"grey"}, "shade: 'grey' is none of: dark, mid-grey, light");
  expect_refused("parts", {"a", "bad"}, "parts: 'bad' is no part");
}

TEST(Fields, RefuseListsWhereOneValueBelongs) {
  for (const std::string name : {"on", "count", "seed", "size", "note", "shade"}) {
    expect_refused(name, {"1", "2"}, name + ": expected one value, not a list");
    expect_refused(name, {}, name + ": expected one value, not a list");
  }
}

TEST(Fields, SayWhatIsMeantByAnUnknownName) {
  expect_refused("cuont", {"1"}, "unknown parameter 'cuont'; did you mean 'count'?");
  expect_refused("elephant", {"1"}, "unknown parameter 'elephant'");
}

TEST(Fields, FollowTheObjectTheyAreBoundTo) {
  Params params;
  const Fields fields = describe(params);
  params.parts = {"x", "y", "z"};
  params.on = true;
  EXPECT_EQ(find(fields, "parts")->text(), "x,y,z");
  EXPECT_THAT(find(fields, "on")->get(), ElementsAre("true"));
  params.parts.clear();
  EXPECT_EQ(find(fields, "parts")->text(), "");
  EXPECT_EQ(find(fields, "nothing"), nullptr);
}

TEST(Fields, CarryTheirDescription) {
  Params params;
  const Fields fields = describe(params);
  const Field& size = *find(fields, "size");
  EXPECT_EQ(size.type, FieldType::number);
  EXPECT_EQ(size.unit, "m");
  EXPECT_EQ(size.doc, "How large.");
  EXPECT_EQ(size.min, -1e300);
  EXPECT_EQ(size.max, 1e300);
  EXPECT_THAT(find(fields, "shade")->choices, ElementsAre("dark", "mid-grey", "light"));
}

TEST(Fields, ArePrefixedAndConcatenatedInOrder) {
  Params a;
  Params b;
  const Fields both = concatenated(prefixed("first", describe(a)), describe(b));
  ASSERT_EQ(both.size(), 14U);
  EXPECT_EQ(both[0].name, "first.on");
  EXPECT_EQ(both[7].name, "on");
  set_field(both, "first.count", {"5"});
  EXPECT_EQ(a.count, 5);
  EXPECT_EQ(b.count, 3);
}

TEST(Names, RoundTripOverAllValues) {
  for (const auto& [value, name] : names<Shade>()) {
    EXPECT_EQ(to_name(value), name);
    EXPECT_EQ(from_name<Shade>(name), value);
  }
  EXPECT_THROW(from_name<Shade>("Dark"), ParameterError);
  EXPECT_THROW(from_name<Shade>(""), ParameterError);
  EXPECT_THROW(to_name(static_cast<Shade>(17)), Error);
}

TEST(NearestName, FindsTheUsualMistakes) {
  const Text names = {"seed", "host", "supervoxels", "inputs", "x"};
  EXPECT_THAT(nearest_name("sed", names), Optional(std::string("seed")));    // deletion
  EXPECT_THAT(nearest_name("hosts", names), Optional(std::string("host")));  // insertion
  EXPECT_THAT(nearest_name("hast", names), Optional(std::string("host")));   // substitution
  EXPECT_THAT(nearest_name("hsot", names), Optional(std::string("host")));   // swap
  EXPECT_THAT(nearest_name("super_voxel", names), Optional(std::string("supervoxels")));
  EXPECT_THAT(nearest_name("host", names), Optional(std::string("host")));
}

TEST(NearestName, KeepsSilentWhereNothingIsNear) {
  EXPECT_EQ(nearest_name("elephant", {"seed", "host"}), std::nullopt);
  EXPECT_EQ(nearest_name("abc", {}), std::nullopt);
  EXPECT_EQ(nearest_name("", {"a", ""}), std::nullopt);
  EXPECT_EQ(nearest_name("y", {"x"}), std::nullopt);
}

TEST(NearestName, PrefersTheNearestAndThenTheFirst) {
  EXPECT_THAT(nearest_name("abcdef", {"abcxyf", "abcdxf"}), Optional(std::string("abcdxf")));
  EXPECT_THAT(nearest_name("abcd", {"abce", "abcf"}), Optional(std::string("abce")));
}

TEST(DidYouMean, IsASentenceOrNothing) {
  EXPECT_EQ(did_you_mean("sed", {"seed"}), "; did you mean 'seed'?");
  EXPECT_THAT(did_you_mean("elephant", {"seed"}), IsEmpty());
}

}  // namespace
}  // namespace cosegraph
