#include "model/model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "core/error.hpp"

namespace cosegraph::model {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

// A small model with every kind of content: two channels, one projected, and a pair never seen.
Model example() {
  Model model;
  AppearanceModel& a = model.appearance;
  a.label_names = {"body", "handle"};
  a.label_share = {0.75F, 0.25F};
  a.cloud_recipe = "spacing=0.014";
  a.descriptor_recipe = "channels=fpfh:0.08,shot:0.13";
  a.encoding_recipe = "method=fv";
  a.channels.push_back({.name = "fpfh:0.08",
                        .dimension = 2,
                        .mixture = {1, 2, {1.0F}, {0.5F, -2.0F}, {1.0F, 0.1F}},
                        .block_scale = 0.5F});
  a.channels.push_back({.name = "shot:0.13",
                        .dimension = 2,
                        .projection = {2, 1, {0.0F, 1.0F}, {0.6F, 0.8F}},
                        .mixture = {2, 1, {0.25F, 0.75F}, {0.0F, 3.0F}, {1.0F, 2.0F}}});
  a.classifier = {.kernel = "linear", .dimension = 8, .label_count = 2, .bias = {0.1F, -0.1F}};
  for (int i = 0; i < 16; ++i) a.classifier.weight.push_back(0.25F * static_cast<float>(i));
  RelationModel& r = model.relation;
  r.label_names = a.label_names;
  r.spectrum_recipe = "eigenpairs=25";
  r.pairs = {{{1.0F}, {0.5F}, {0.1F}}, {{0.5F, 0.5F}, {1.0F, 2.0F}, {0.1F, 0.2F}}, {}};
  r.neighbours = {1, 0, 0, 1};
  a.id = r.id = content_id(model);
  return model;
}

Model rbf_example() {
  Model model = example();
  model.appearance.classifier = {.kernel = "rbf",
                                 .dimension = 3,  // of bags of words
                                 .label_count = 2,
                                 .support = {0.F, 1.F, 2.F, 3.F, 4.F, 5.F, 6.F, 7.F, 8.F},
                                 .coefficient = {1.F, -1.F, 0.F, 0.F, 0.F, 2.F},
                                 .bias = {0.F, 1.F},
                                 .gamma = 0.5};
  model.appearance.id = model.relation.id = content_id(model);
  return model;
}

std::string refusal(std::string_view bytes) {
  try {
    from_bytes(bytes, "cup.model");
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

// Bytes of `model` although it is inconsistent: the checksum is right, the content is not.
std::string refusal_of(const std::function<void(Model&)>& spoil, Model model = example()) {
  spoil(model);
  return refusal(to_bytes(model));
}

TEST(Bytes, RoundTrip) {
  for (const Model& model : {example(), rbf_example()}) {
    const std::string bytes = to_bytes(model);
    const Model back = from_bytes(bytes, "x");
    EXPECT_EQ(to_bytes(back), bytes);
    EXPECT_EQ(back.appearance.id, model.appearance.id);
    EXPECT_EQ(back.appearance.label_share, model.appearance.label_share);
    EXPECT_EQ(back.appearance.channels[1].projection.basis,
              model.appearance.channels[1].projection.basis);
    EXPECT_EQ(back.appearance.channels[0].mixture.mean, model.appearance.channels[0].mixture.mean);
    EXPECT_EQ(back.appearance.classifier.weight, model.appearance.classifier.weight);
    EXPECT_EQ(back.appearance.classifier.support, model.appearance.classifier.support);
    EXPECT_EQ(back.relation.spectrum_recipe, model.relation.spectrum_recipe);
    EXPECT_EQ(back.relation.pairs[1].sigma, model.relation.pairs[1].sigma);
    EXPECT_EQ(back.relation.neighbours, model.relation.neighbours);
  }
}

TEST(Bytes, OfAModelWithoutSpectraRoundTrip) {
  Model model = example();
  model.relation.spectrum_recipe.clear();
  model.relation.pairs.clear();
  EXPECT_EQ(to_bytes(from_bytes(to_bytes(model), "x")), to_bytes(model));
}

TEST(Bytes, StartWithTheMagicWordsAndTheVersion) {
  const std::string bytes = to_bytes(example());
  EXPECT_THAT(bytes, StartsWith("COSEGRAPH-MODEL"));
  EXPECT_EQ(bytes.substr(15, 5), std::string("\0\1\0\0\0", 5));
}

TEST(Bytes, AreRefusedAnywhereTruncated) {
  const std::string bytes = to_bytes(example());
  EXPECT_EQ(refusal(""), "cup.model: not a cosegraph model");
  for (std::size_t size = 1; size < bytes.size(); ++size)
    EXPECT_THAT(refusal(std::string_view(bytes).substr(0, size)), HasSubstr("truncated")) << size;
}

TEST(Bytes, AreRefusedWithAnyByteChanged) {
  const std::string good = to_bytes(example());
  for (std::size_t at = 0; at < good.size(); ++at)
    for (const unsigned char flip : {0x01, 0x80, 0xff}) {
      std::string bytes = good;
      bytes[at] = static_cast<char>(static_cast<unsigned char>(bytes[at]) ^ flip);
      EXPECT_NE(refusal(bytes), "accepted") << "byte " << at;
    }
}

TEST(Bytes, AreRefusedWithBytesBehind) {
  EXPECT_THAT(refusal(to_bytes(example()) + "x"), HasSubstr("after the end"));
}

TEST(Bytes, OfAnythingElseAreNoModel) {
  EXPECT_EQ(refusal("ply\nformat ascii 1.0\n"), "cup.model: not a cosegraph model");
}

TEST(Bytes, OfANewerVersionSaySo) {
  std::string bytes = to_bytes(example());
  bytes[16] = 2;
  EXPECT_THAT(refusal(bytes), HasSubstr("newer version"));
}

TEST(Id, IsAHashOfAllButTheIds) {
  Model model = example();
  const std::uint64_t id = content_id(model);
  EXPECT_NE(id, 0U);
  model.appearance.id = model.relation.id = 5;
  EXPECT_EQ(content_id(model), id);
  model.appearance.classifier.bias[1] = 0.0F;
  EXPECT_NE(content_id(model), id);
  model = example();
  model.relation.neighbours = {1, 1, 1, 1};
  EXPECT_NE(content_id(model), id);
}

TEST(Check, AcceptsAModelThatFits) {
  EXPECT_NO_THROW(check(example().appearance));
  EXPECT_NO_THROW(check(example().relation));
  EXPECT_NO_THROW(check(rbf_example().appearance));
}

TEST(Check, RefusesHalvesOfDifferentModels) {
  EXPECT_THAT(refusal_of([](Model& m) { m.relation.id += 1; }), HasSubstr("different models"));
  EXPECT_THAT(refusal_of([](Model& m) { m.relation.label_names[1] = "lid"; }),
              HasSubstr("different models"));
}

TEST(Check, RefusesEveryInconsistency) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<std::function<void(Model&)>> spoilers = {
      [](Model& m) { m.appearance.label_names = m.relation.label_names = {}; },
      [](Model& m) {
        m.appearance.label_names = {"handle", "body"};
      },
      [](Model& m) {
        m.appearance.label_names = {"body", "body"};
      },
      [](Model& m) { m.appearance.label_names[0] = ""; },
      [](Model& m) { m.appearance.label_share = {0.75F}; },
      [](Model& m) {
        m.appearance.label_share = {0.75F, 0.75F};
      },
      [](Model& m) {
        m.appearance.label_share = {1.5F, -0.5F};
      },
      [](Model& m) { m.appearance.channels.clear(); },
      [](Model& m) { m.appearance.channels.pop_back(); },
      [](Model& m) { m.appearance.channels[0].name = ""; },
      [](Model& m) { m.appearance.channels[0].dimension = 3; },
      [](Model& m) { m.appearance.channels[0].dimension = -2; },
      [](Model& m) { m.appearance.channels[0].block_scale = 0.0F; },
      [=](Model& m) { m.appearance.channels[0].block_scale = nan; },
      [](Model& m) { m.appearance.channels[0].projection.basis = {1.0F}; },
      [](Model& m) { m.appearance.channels[1].projection.output = 2; },
      [](Model& m) { m.appearance.channels[1].projection.output = -1; },
      [](Model& m) { m.appearance.channels[1].projection.input = 3; },
      [](Model& m) { m.appearance.channels[1].projection.mean.pop_back(); },
      [=](Model& m) { m.appearance.channels[1].projection.basis[0] = nan; },
      [](Model& m) { m.appearance.channels[0].mixture.components = 0; },
      [](Model& m) { m.appearance.channels[0].mixture.components = 1 << 30; },
      [](Model& m) { m.appearance.channels[0].mixture.dimension = 1; },
      [](Model& m) { m.appearance.channels[0].mixture.mean.push_back(0.0F); },
      [=](Model& m) { m.appearance.channels[0].mixture.mean[0] = nan; },
      [](Model& m) { m.appearance.channels[0].mixture.sigma[0] = 0.0F; },
      [](Model& m) { m.appearance.channels[0].mixture.sigma[0] = -1.0F; },
      [](Model& m) {
        m.appearance.channels[1].mixture.weight = {0.0F, 1.0F};
      },
      [](Model& m) {
        m.appearance.channels[1].mixture.weight = {0.5F, 0.75F};
      },
      [](Model& m) { m.appearance.classifier.kernel = "cubic"; },
      [](Model& m) { m.appearance.classifier.dimension = 0; },
      [](Model& m) { m.appearance.classifier.dimension = 4; },
      [](Model& m) { m.appearance.classifier.label_count = 1; },
      [](Model& m) { m.appearance.classifier.weight.pop_back(); },
      [=](Model& m) { m.appearance.classifier.weight[3] = nan; },
      [](Model& m) { m.appearance.classifier.bias.pop_back(); },
      [](Model& m) { m.appearance.classifier.support = {1.0F}; },
      [](Model& m) { m.appearance.classifier.sharpness = 0.0; },
      [](Model& m) { m.relation.neighbours.pop_back(); },
      [](Model& m) {
        m.relation.neighbours = {1, 1, 0, 1};
      },
      [](Model& m) {
        m.relation.neighbours = {0, 1, 1, 1};
      },
      [](Model& m) {
        m.relation.neighbours = {1, 2, 2, 1};
      },
      [](Model& m) { m.relation.pairs.pop_back(); },
      [](Model& m) { m.relation.spectrum_recipe.clear(); },
      [](Model& m) { m.relation.pairs[0].mean.clear(); },
      [](Model& m) { m.relation.pairs[0].weight[0] = 2.0F; },
      [](Model& m) { m.relation.pairs[0].sigma[0] = 0.0F; },
      [=](Model& m) { m.relation.pairs[0].mean[0] = nan; },
  };
  for (std::size_t i = 0; i < spoilers.size(); ++i)
    EXPECT_THAT(refusal_of(spoilers[i]), StartsWith("cup.model: inconsistent")) << "spoiler " << i;
  const std::vector<std::function<void(Model&)>> rbf_spoilers = {
      [](Model& m) { m.appearance.classifier.gamma = 0.0; },
      [](Model& m) { m.appearance.classifier.support.pop_back(); },
      [](Model& m) { m.appearance.classifier.coefficient.pop_back(); },
      [](Model& m) { m.appearance.classifier.weight = {1.0F}; },
  };
  for (std::size_t i = 0; i < rbf_spoilers.size(); ++i)
    EXPECT_THAT(refusal_of(rbf_spoilers[i], rbf_example()), StartsWith("cup.model: inconsistent"))
        << "rbf spoiler " << i;
}

// A list that claims more elements than there are bytes, under a right checksum.
TEST(Check, RefusesLengthsBeyondTheData) {
  const std::string good = to_bytes(example());
  constexpr std::size_t kHeader = 36;
  for (std::size_t at = kHeader; at + 8 <= good.size(); ++at) {
    std::string bytes = good;
    bytes.replace(at, 8, 8, '\x7f');
    std::uint64_t hash = 0xcbf29ce484222325ULL;  // FNV-1a of version and payload
    const auto add = [&](char c) {
      hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
    };
    for (std::size_t i = 16; i < 20; ++i) add(bytes[i]);
    for (std::size_t i = kHeader; i < bytes.size(); ++i) add(bytes[i]);
    for (int i = 0; i < 8; ++i) bytes[28 + i] = static_cast<char>(hash >> (8 * i));
    const std::string result = refusal(bytes);
    if (result == "accepted")  // ids, names, plain numbers: the content changed, and stayed valid
      EXPECT_EQ(to_bytes(from_bytes(bytes, "x")), bytes);
    else
      EXPECT_THAT(result, StartsWith("cup.model: "));
  }
}

}  // namespace
}  // namespace cosegraph::model
