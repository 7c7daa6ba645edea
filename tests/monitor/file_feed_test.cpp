#include "tools/monitor/file_feed.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "core/error.hpp"
#include "io/cloud_io.hpp"
#include "io/file.hpp"
#include "model/model.hpp"

namespace cosegraph::monitor {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class Files : public testing::Test {
 protected:
  std::string write_cloud(const std::string& name, bool answered) const {
    const Cloud cloud{
        .xyz = {0, 0, 1, 0, 1, 1}, .label = {1, 0}, .label_names = {"body", "handle"}, .width = 2};
    const std::vector<float> confidence = {0.5F, 0.75F};
    const io::Column column{.name = "confidence", .value = confidence};
    io::write_cloud(folder_ / name, cloud, {&column, answered ? 1U : 0U});
    return (folder_ / name).string();
  }

  static std::vector<std::string> topics(const Feed& feed) {
    std::vector<std::string> names;
    for (const auto& channel : feed.channels()) names.push_back(channel.topic);
    return names;
  }
  static std::vector<Message> messages(Feed& feed, const std::string& topic) {
    for (std::size_t i = 0; i < feed.channels().size(); ++i)
      if (feed.channels()[i].topic == topic) return feed.subscribe(i, {});
    return {};
  }

  const io::TemporaryFolder folder_;
};

TEST_F(Files, TrueLabelsStayWithTheCloud) {
  FileFeed feed({write_cloud("a.ply", false)});
  EXPECT_THAT(topics(feed), ElementsAre("file/cloud", "file/cloud/points", "file/monitor"));
  const auto clouds = messages(feed, "file/cloud");
  ASSERT_THAT(clouds, SizeIs(1));
  EXPECT_TRUE(clouds[0].keep);
  EXPECT_THAT(idl::decode<Cloud>(*clouds[0].payload).label, ElementsAre(1, 0));
  EXPECT_EQ(idl::decode_header(*clouds[0].payload).name, "a");
}

TEST_F(Files, LabelsWithConfidenceAreALabelling) {
  FileFeed feed({write_cloud("a.ply", true), write_cloud("b.ply", false)});
  const auto labellings = messages(feed, "file/labelling");
  ASSERT_THAT(labellings, SizeIs(1));
  const auto labelling = idl::decode<Labelling>(*labellings[0].payload);
  EXPECT_THAT(labelling.point_label, ElementsAre(1, 0));
  EXPECT_THAT(labelling.point_confidence, ElementsAre(0.5F, 0.75F));
  EXPECT_THAT(labelling.label_names, ElementsAre("body", "handle"));
  const auto clouds = messages(feed, "file/cloud");
  ASSERT_THAT(clouds, SizeIs(2));
  EXPECT_THAT(idl::decode<Cloud>(*clouds[0].payload).label, IsEmpty());
  EXPECT_EQ(idl::decode_header(*clouds[1].payload).sequence, 1U);
  const auto state = messages(feed, "file/monitor");
  ASSERT_THAT(state, SizeIs(1));
  EXPECT_EQ(json::parse(*state[0].payload)["state"], "file");
  const json frames = json::parse(*state[0].payload)["frames"];
  ASSERT_THAT(frames, SizeIs(2));
  EXPECT_EQ(frames[0]["name"], "a");
  EXPECT_EQ(frames[1]["name"], "b");
  EXPECT_EQ(frames[1]["sequence"], 1);
}

TEST_F(Files, ManyAreHandedOutInParts) {
  std::vector<std::string> files;
  for (std::size_t i = 0; i <= FrameIndex::kPartFrames; ++i)
    files.push_back(write_cloud(std::to_string(100 + i) + ".ply", false));
  FileFeed feed(files);
  ASSERT_EQ(feed.parts(), 2U);
  EXPECT_THAT(feed.subscribe(0, 0), SizeIs(FrameIndex::kPartFrames));
  ASSERT_THAT(feed.subscribe(0, 1), SizeIs(1));
  EXPECT_EQ(idl::decode_header(*feed.subscribe(0, 1)[0].payload).name, "140");
  EXPECT_THAT(feed.subscribe(2, 1), SizeIs(1));  // the state belongs to no frame
}

TEST_F(Files, BadOnesAreNamed) {
  io::write_file(folder_ / "bad.ply", "ply\nnonsense\n");
  io::write_file(folder_ / "bad.coseg", "nonsense");
  for (const auto name : {"bad.ply", "bad.coseg", "missing.ply"}) {
    try {
      const FileFeed feed({(folder_ / name).string()});
      FAIL() << name;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(name));
    }
  }
}

// A bent sheet, large enough to have a spectrum.
TEST_F(Files, SpectraOnRequest) {
  Cloud sheet{.origin = {0.5F, 0.5F, 3.0F}};
  constexpr int kSide = 80;
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const float x = static_cast<float>(i) / kSide;
      const float y = static_cast<float>(j) / kSide;
      sheet.xyz.insert(sheet.xyz.end(), {x, y, 0.2F * x * x});
    }
  sheet.width = kSide * kSide;
  io::write_cloud(folder_ / "sheet.ply", sheet, {});
  FileFeed feed({(folder_ / "sheet.ply").string()}, true);
  const auto spectra = messages(feed, "file/spectrum");
  ASSERT_THAT(spectra, SizeIs(1));
  const auto spectrum = idl::decode<Spectrum>(*spectra[0].payload);
  const auto reduced = idl::decode<Cloud>(*messages(feed, "file/reduced")[0].payload);
  EXPECT_EQ(spectrum.nearest_sample.size(), reduced.size());
  ASSERT_FALSE(spectrum.sample.empty());
  // A sample is where the point of the file is that stands for it.
  for (std::size_t s = 0; s < spectrum.sample.size(); ++s)
    for (std::size_t axis = 0; axis < 2; ++axis)
      EXPECT_NEAR(sheet.xyz[3 * static_cast<std::size_t>(spectrum.sample_dense[s]) + axis],
                  reduced.xyz[3 * static_cast<std::size_t>(spectrum.sample[s]) + axis], 0.05);
  EXPECT_THROW(FileFeed({write_cloud("small.ply", false)}, true), InputError);
}

TEST_F(Files, GraphFilesAreNotForViewing) {
  io::write_file(folder_ / "graph.yaml", "version: 1\n");
  EXPECT_FALSE(is_viewable(folder_ / "graph.yaml"));
  EXPECT_FALSE(is_viewable(folder_ / "missing.ply"));
  EXPECT_TRUE(is_viewable(write_cloud("a.ply", true)));
  EXPECT_TRUE(is_viewable(folder_.path()));
}

}  // namespace
}  // namespace cosegraph::monitor
