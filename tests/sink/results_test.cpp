#include "sink/results.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <nlohmann/json.hpp>

namespace cosegraph::sink {
namespace {

using testing::ElementsAre;

// Four input points, one of them removed; dense points 0 1 2 in segments 0 0 1.
const Cloud kInput{.xyz = {0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1},
                   .label = {0, 0, 1, 1},
                   .label_names = {"body", "handle"},
                   .dense_index = {0, 1, 2, kNoPoint},
                   .notes = {"one point removed"},
                   .width = 4};
const Segments kSegments{.of_supervoxel = {0, 1}, .of_point = {0, 0, 1}, .count = 2};
const Labelling kLabelling{.label_names = {"body", "handle"},
                           .majority = 0,
                           .segment_label = {0, 0},
                           .segment_confidence = {0.9F, 0.6F},
                           .point_label = {0, 0, 0},
                           .point_confidence = {0.9F, 0.9F, 0.6F},
                           .energy = 1.5,
                           .proven_optimal = true};

// The file after these frames.
std::string text_of(const std::vector<Result>& results, std::string_view earlier = "",
                    std::string_view redone = "") {
  ResultsText text(earlier, redone);
  std::string file = text.begun();
  for (const auto& result : results) {
    const auto growth = text.add(result);
    file.replace(growth.at, std::string::npos, growth.bytes);
  }
  return file;
}

TEST(Results, CountOnlyPointsThatWereNotRemoved) {
  const Result result = result_of("mug", kInput, kSegments, kLabelling);
  EXPECT_EQ(result.points, 4);
  EXPECT_EQ(result.labelled_points, 3);
  EXPECT_THAT(result.points_per_label, ElementsAre(3, 0));
  EXPECT_NEAR(result.mean_confidence, 0.8, 1e-6);
  ASSERT_TRUE(result.evaluation);
  EXPECT_NEAR(result.evaluation->accuracy, 2.0 / 3.0, 1e-12);
}

TEST(Results, JsonHoldsFramesAndTheirMean) {
  Result labelled = result_of("mug", kInput, kSegments, kLabelling);
  Result bare = labelled;
  bare.name = "scan";
  bare.evaluation.reset();
  const auto json = nlohmann::json::parse(text_of({labelled, bare}));
  ASSERT_EQ(json["frames"].size(), 2U);
  EXPECT_EQ(json["frames"][0]["points_per_label"]["body"], 3);
  EXPECT_EQ(json["frames"][0]["notes"][0], "one point removed");
  EXPECT_FALSE(json["frames"][1].contains("accuracy"));
  EXPECT_EQ(json["mean"]["frames"], 1);
  EXPECT_NEAR(json["mean"]["accuracy"].get<double>(), 2.0 / 3.0, 1e-12);
}

// A sink that is started again adds to what its predecessor has written.
TEST(Results, EarlierOnesStayUnlessTheyAreDoneAgain) {
  Result first = result_of("first", kInput, kSegments, kLabelling);
  Result second = result_of("second", kInput, kSegments, kLabelling);
  Result third = result_of("third", kInput, kSegments, kLabelling);
  const std::string two = text_of({first, second});
  const std::string whole = text_of({first, second, third});
  EXPECT_EQ(text_of({third}, two), whole);
  EXPECT_TRUE(ResultsText(two).began_with("second"));
  EXPECT_FALSE(ResultsText(two).began_with("third"));
  EXPECT_EQ(text_of({second, third}, two, "second"), whole);
  EXPECT_THROW(ResultsText("[1, 2"), InputError);
  EXPECT_THROW(ResultsText("{\"frames\": [{\"label\": 1}]}"), InputError);
  EXPECT_THROW(ResultsText("something else"), InputError);
}

// What there is does not grow with what was there before.
TEST(Results, GrowByAFrame) {
  const Result frame = result_of("mug", kInput, kSegments, kLabelling);
  ResultsText text;
  std::size_t size = text.begun().size();
  for (int i = 0; i < 100; ++i) {
    const auto growth = text.add(frame);
    EXPECT_LE(growth.at, size);
    EXPECT_LT(growth.bytes.size(), 2000U);
    size = growth.at + growth.bytes.size();
  }
}

// A sink that is killed in the middle of a frame leaves the others.
TEST(Results, CutOffInAFrameLackOnlyThat) {
  const Result first = result_of("first", kInput, kSegments, kLabelling);
  const Result second = result_of("second", kInput, kSegments, kLabelling);
  ResultsText text;
  const std::string none = text.begun();
  const auto with_one = text.add(first);
  std::string one = none;
  one.replace(with_one.at, std::string::npos, with_one.bytes);
  const auto with_two = text.add(second);
  const auto cut = [](std::string file, const ResultsText::Growth& growth, std::size_t written) {
    file.replace(growth.at, written, growth.bytes.substr(0, written));
    return file;
  };
  for (std::size_t n = 0; n < with_one.bytes.size(); ++n) {
    const std::string mended = ResultsText(cut(none, with_one, n)).begun();
    EXPECT_TRUE(mended == none || mended == one) << n;
  }
  for (std::size_t n = 0; n < with_two.bytes.size(); ++n) {
    const std::string mended = ResultsText(cut(one, with_two, n)).begun();
    EXPECT_TRUE(mended == one || mended == text_of({first, second})) << n;
  }
}

TEST(Results, WithoutTrueLabelsThereIsNoMean) {
  EXPECT_FALSE(nlohmann::json::parse(text_of({})).contains("mean"));
}

TEST(Results, PictureIsWiderWithReferenceAndTrueLabels) {
  const PictureOf with{.name = "mug",
                       .input = &kInput,
                       .segments = &kSegments,
                       .labelling = &kLabelling,
                       .reference = &kInput};
  Cloud bare = kInput;
  bare.label.clear();
  bare.label_names.clear();
  const PictureOf without{
      .name = "mug", .input = &bare, .segments = &kSegments, .labelling = &kLabelling};
  // Bytes 16..19 of a PNG are its width, big endian.
  const auto width = [](const std::string& png) {
    return static_cast<unsigned char>(png[18]) * 256 + static_cast<unsigned char>(png[19]);
  };
  EXPECT_GT(width(picture_of(with)), width(picture_of(without)));
}

TEST(Results, OfAnInputThatIsTheDenseCloudNeedNoIndices) {
  Cloud dense = kInput;
  dense.dense_index.clear();
  dense.label.clear();
  dense.label_names.clear();
  dense.xyz.resize(9);
  dense.width = 3;
  EXPECT_EQ(result_of("mug", dense, kSegments, kLabelling).labelled_points, 3);
  const PictureOf frame{
      .name = "mug", .input = &dense, .segments = &kSegments, .labelling = &kLabelling};
  EXPECT_FALSE(picture_of(frame).empty());
}

TEST(Results, OfCloudsThatDoNotFitTogetherAreRefused) {
  Cloud bare = kInput;
  bare.label.clear();
  bare.label_names.clear();
  Segments fewer = kSegments;
  fewer.of_point.pop_back();
  EXPECT_THROW(
      picture_of({.name = "mug", .input = &bare, .segments = &fewer, .labelling = &kLabelling}),
      MismatchError);
  bare.dense_index.clear();
  EXPECT_THROW(result_of("mug", bare, kSegments, kLabelling), MismatchError);
  EXPECT_THROW(
      picture_of({.name = "mug", .input = &bare, .segments = &kSegments, .labelling = &kLabelling}),
      MismatchError);
}

// One frame of an odd name must not keep the figures of all others from being written.
TEST(Results, JsonReplacesWhatIsNotUtf8) {
  Result odd = result_of("mug", kInput, kSegments, kLabelling);
  odd.name = "m\xffg";
  odd.notes = {"\xc3"};
  odd.energy = std::numeric_limits<double>::quiet_NaN();
  const auto json = nlohmann::json::parse(text_of({odd}));
  EXPECT_EQ(json["frames"][0]["name"], "m\xef\xbf\xbdg");
  EXPECT_TRUE(json["frames"][0]["energy"].is_null());
}

}  // namespace
}  // namespace cosegraph::sink
