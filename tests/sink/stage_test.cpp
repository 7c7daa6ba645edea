#include <gtest/gtest.h>

#include "core/fields.hpp"
#include "graph/stage.hpp"
#include "io/file.hpp"

namespace cosegraph::stages {

std::unique_ptr<graph::Stage> make_sink_stage();

namespace {

namespace fs = std::filesystem;

// The sink of a folder, given one small frame of that name.
void label(const fs::path& folder, const std::string& name) {
  const auto stage = make_sink_stage();
  set_field(stage->parameters(), "folder", {folder.string()});
  stage->start();
  const idl::FrameHeader header{.name = name};
  const auto message = [&](const auto& value) {
    return std::make_shared<const idl::Bytes>(idl::encode(header, value));
  };
  graph::Frame frame(
      header, {{"input", message(Cloud{.xyz = {0, 0, 1}, .width = 1})},
               {"segments", message(Segments{.of_supervoxel = {0}, .of_point = {0}, .count = 1})},
               {"labelling", message(Labelling{.label_names = {"a"},
                                               .segment_label = {0},
                                               .segment_confidence = {1.0F},
                                               .point_label = {0},
                                               .point_confidence = {1.0F}})}});
  stage->process(frame);
}

TEST(SinkStage, NamesFilesAfterFrames) {
  const io::TemporaryFolder folder;
  label(folder.path(), "mug 1");
  EXPECT_TRUE(fs::exists(folder / "mug 1.ply"));
}

// The name comes with a message.
TEST(SinkStage, DoesNotWriteOutsideOfItsFolder) {
  const io::TemporaryFolder folder;
  for (const std::string& name :
       {std::string(), std::string("../escaped"), (folder / "absolute").string(),
        std::string("a/../../b"), std::string("cut\0off", 7)})
    EXPECT_THROW(label(folder / "out", name), InputError) << name;
  EXPECT_FALSE(fs::exists(folder / "escaped.ply"));
  EXPECT_FALSE(fs::exists(folder / "absolute.ply"));
}

}  // namespace
}  // namespace cosegraph::stages
