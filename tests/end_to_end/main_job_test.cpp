// What the README promises, as a user does it.
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "end_to_end/world.hpp"
#include "inputs/inputs.hpp"
#include "io/cloud_io.hpp"
#include "io/file.hpp"
#include "model/model.hpp"
#include "pipeline/pipeline.hpp"
#include "sink/sink.hpp"

namespace cosegraph::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::StartsWith;

TEST(MainJob, SampleTrainSegment) {
  const TemporaryFolder folder;
  const auto path = [&](const char* name) { return (folder / name).string(); };
  World::expect_fine(
      {"cosegraph", "sample", "--kind", "watering_can", "--count", "2", "-o", path("shapes")});
  World::expect_fine({"cosegraph", "view", path("shapes/watering_can1.off"), "--count", "4", "-o",
                      path("reference")});
  World::expect_fine(
      {"cosegraph", "train", "--reference", path("reference"), "-o", path("model.coseg")});
  World::expect_fine({"cosegraph", "view", path("shapes/watering_can2.off"), "--count", "2", "-o",
                      path("queries")});
  const Outcome segmented =
      run({"cosegraph", "segment", "--model", path("model.coseg"), path("queries"), "-o",
           path("out"), "--picture", "--reference", path("reference/watering_can1-view0.ply")});
  ASSERT_EQ(segmented.status, 0) << segmented.errors;
  EXPECT_THAT(segmented.output,
              HasSubstr("admitted 2 = labelled 2 + consumed 0 + failed 0; dropped 0"));

  const auto results = nlohmann::json::parse(slurp(folder / "out/results.json"));
  const double accuracy = results["mean"]["accuracy"];
  EXPECT_GT(accuracy, 0.8);
  EXPECT_GT(accuracy, results["mean"]["majority_floor"].get<double>());
  EXPECT_THAT(slurp(folder / "out/watering_can2-view0.png"), StartsWith("\x89PNG"));
  World::expect_fine({"cosegraph", "picture", path("out/watering_can2-view0.ply"),
                      path("out/watering_can2-view1.ply"), "-o", path("strip.png")});
  EXPECT_THAT(slurp(folder / "strip.png"), StartsWith("\x89PNG"));
}

// The paper's second experiment: a few frames of a moving depth camera, then its stream.
TEST(MainJob, LearnsFromDepthFramesAndLabelsAStream) {
  const TemporaryFolder folder;
  const auto path = [&](const char* name) { return (folder / name).string(); };
  World::expect_fine({"cosegraph", "sample", "--kind", "watering_can", "--sequence", "5", "-o",
                      path("reference")});
  World::expect_fine({"cosegraph", "train", "--reference", path("reference"), "--config",
                      "fused+fv", "-o", path("model.coseg")});
  World::expect_fine({"cosegraph", "sample", "--kind", "watering_can", "--sequence", "4",
                      "--start-azimuth", "40", "--end-azimuth", "400", "--elevation", "35", "-o",
                      path("stream")});
  World::expect_fine(
      {"cosegraph", "segment", "--model", path("model.coseg"), path("stream"), "-o", path("out")});
  const auto results = nlohmann::json::parse(slurp(folder / "out/results.json"));
  EXPECT_EQ(results["mean"]["frames"], 4);
  EXPECT_GT(results["mean"]["accuracy"].get<double>(),
            results["mean"]["majority_floor"].get<double>() + 0.05);
}

TEST(MainJob, OutputHasTheInputsPointsInItsOrder) {
  const World world;
  World::expect_fine({"cosegraph", "segment", "--model", world.path("model.coseg"),
                      world.path("queries"), "-o", world.path("out")});
  const Cloud query = io::read_cloud(world.path("queries/query-view0.ply"));
  const Cloud answer = io::read_cloud(world.path("out/query-view0.ply"));
  EXPECT_EQ(answer.xyz, query.xyz);
  EXPECT_EQ(answer.label_names, (std::vector<std::string>{"body", "handle"}));
  EXPECT_THAT(slurp(world.path("out/query-view0.ply")).substr(0, 600),
              testing::AllOf(HasSubstr("comment label 0 body"), HasSubstr("property int label"),
                             HasSubstr("property float confidence")));
}

TEST(MainJob, OrganisedInputWithHolesKeepsEveryPoint) {
  const World world;
  const Mesh mesh = inputs::read_labelled_mesh(world.path("query.off"));
  camera::Params camera;
  const auto view = camera::choose_views(mesh, camera).at(0);
  const Cloud query = camera::render(mesh, view.direction, view.roll, camera);
  ASSERT_GT(query.height, 1U);
  io::write_cloud(world.path("organised.pcd"), query);
  World::expect_fine({"cosegraph", "segment", "--model", world.path("model.coseg"),
                      world.path("organised.pcd"), "-o", world.path("out"), "--param",
                      "sink.format=pcd"});
  const Cloud answer = io::read_cloud(world.path("out/organised.pcd"));
  EXPECT_EQ(answer.width, query.width);
  EXPECT_EQ(answer.height, query.height);
  for (std::size_t i = 0; i < query.size(); ++i)
    ASSERT_EQ(std::isnan(query.xyz[3 * i]), answer.label[i] == kNoLabel) << i;
}

// A depth camera's image with its intrinsics: the labels of the same view given as a cloud.
TEST(MainJob, DepthImagesAreLabelledLikeClouds) {
  const World world;
  const Mesh mesh = inputs::read_labelled_mesh(world.path("query.off"));
  const auto direction = camera::choose_views(mesh, {}).at(0).direction;
  const double distance = 5.0 * std::sqrt(surface_area(mesh));
  const camera::Pinhole pinhole{
      .width = 320, .height = 240, .fx = 900, .fy = 900, .cx = 159.5, .cy = 119.5};
  const auto pose = camera::look_at(
      {distance * direction[0], distance * direction[1], distance * direction[2]}, {0, 0, 0}, 0.0);
  const camera::DepthImage seen = camera::cast(mesh, pinhole, pose);
  const Cloud cloud = camera::to_cloud(seen, mesh);
  const double step = distance / 40000.0;
  cv::Mat1w depth(static_cast<int>(pinhole.height), static_cast<int>(pinhole.width), ushort{0});
  for (std::size_t i = 0; i < seen.depth.size(); ++i)
    if (seen.face[i] >= 0)
      depth.at<ushort>(static_cast<int>(i)) = cv::saturate_cast<ushort>(seen.depth[i] / step);
  fs::create_directories(world.path("camera"));
  ASSERT_TRUE(cv::imwrite(world.path("camera/frame.png"), depth.reshape(1, 240)));
  io::write_file(
      world.path("camera/frame.json"),
      nlohmann::json{{"fx", 900}, {"fy", 900}, {"cx", 159.5}, {"cy", 119.5}, {"depth_scale", step}}
          .dump());
  io::write_cloud(world.path("frame.ply"), cloud);

  World::expect_fine({"cosegraph", "segment", "--model", world.path("model.coseg"),
                      world.path("camera"), "-o", world.path("of-image")});
  World::expect_fine({"cosegraph", "segment", "--model", world.path("model.coseg"),
                      world.path("frame.ply"), "-o", world.path("of-cloud")});
  const Cloud of_image = io::read_cloud(world.path("of-image/frame.ply"));
  const Cloud of_cloud = io::read_cloud(world.path("of-cloud/frame.ply"));
  ASSERT_EQ(of_image.size(), cloud.size());
  ASSERT_EQ(of_image.label_names, of_cloud.label_names);
  std::size_t points = 0;
  std::size_t same = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_EQ(of_image.label[i] == kNoLabel, seen.face[i] < 0) << i;
    points += seen.face[i] >= 0 ? 1 : 0;
    same += seen.face[i] >= 0 && of_image.label[i] == of_cloud.label[i] ? 1 : 0;
  }
  EXPECT_GT(points, 5000U);
  EXPECT_GT(same, points * 97 / 100);
}

// One process, many processes and plain function calls: the same labels, bit for bit.
TEST(MainJob, ProcessesAndLibraryAgree) {
  const World world;
  World::expect_fine({"cosegraph", "segment", "--model", world.path("model.coseg"),
                      world.path("queries"), "-o", world.path("one")});
  World::expect_fine({"cosegraph", "segment", "--model", world.path("model.coseg"),
                      world.path("queries"), "-o", world.path("many"), "--processes"});
  const Model model = model::from_bytes(io::read_file(world.path("model.coseg")), "model.coseg");
  pipeline::Config config;
  config.astar.spatial = astar::Spatial::iso;
  pipeline::adopt_model(model, config);
  for (const char* name : {"query-view0.ply", "query-view1.ply"}) {
    const std::string one = slurp(world.path("one/") + name);
    ASSERT_FALSE(one.empty());
    EXPECT_EQ(one, slurp(world.path("many/") + name)) << name;
    const pipeline::Result direct =
        pipeline::segment(io::read_cloud(world.path("queries/") + name), model, config);
    const sink::Labelled labelled = sink::to_input(direct.features.frame.input, direct.labelling);
    EXPECT_EQ(io::read_cloud(world.path("one/") + name).label, labelled.cloud.label) << name;
  }
}

TEST(MainJob, TrainingTwiceGivesTheSameBytes) {
  const World world;
  World::expect_fine({"cosegraph", "train", "--reference", world.path("reference.off"), "--param",
                      "source.camera.count=4", "-o", world.path("again.coseg"), "--processes"});
  EXPECT_EQ(slurp(world.path("model.coseg")), slurp(world.path("again.coseg")));
}

TEST(MainJob, WithoutSpatialTermTheGraphHasNoSpectra) {
  const World world("fpfh+fv");
  const Outcome segmented = run({"cosegraph", "segment", "--model", world.path("model.coseg"),
                                 world.path("queries"), "-o", world.path("out"), "--json"});
  ASSERT_EQ(segmented.status, 0) << segmented.errors;
  const auto report = nlohmann::json::parse(segmented.output);
  EXPECT_FALSE(report["stages"].contains("spectra"));
  EXPECT_EQ(report["account"]["labelled"], 2);
}

TEST(MainJob, BagOfWordsAndFusedConfigurationsWork) {
  for (const char* config : {"shot+bow", "best"}) {
    const World world(config);
    const Outcome segmented = run({"cosegraph", "segment", "--model", world.path("model.coseg"),
                                   world.path("queries"), "-o", world.path("out")});
    ASSERT_EQ(segmented.status, 0) << config << segmented.errors;
    const auto results = nlohmann::json::parse(slurp(world.path("out/results.json")));
    EXPECT_GT(results["mean"]["accuracy"].get<double>(), 0.8) << config;
  }
}

TEST(Commands, EveryOneHasHelpWithAnExample) {
  for (const char* command : {"view", "train", "segment", "sample", "picture", "eval", "check",
                              "draw", "run", "up", "stages"}) {
    const Outcome outcome = run({"cosegraph", command, "--help"});
    EXPECT_EQ(outcome.status, 0) << command;
    EXPECT_THAT(outcome.output, HasSubstr("Example:")) << command;
  }
}

TEST(Commands, MisuseHasStatusTwo) {
  EXPECT_EQ(run({"cosegraph"}).status, 2);
  EXPECT_EQ(run({"cosegraph", "fly"}).status, 2);
  EXPECT_EQ(run({"cosegraph", "segment"}).status, 2);
  EXPECT_EQ(run({"cosegraph", "stages", "astra"}).status, 2);
}

TEST(Commands, ShippedGraphsAreSoundAndCanBeDrawn) {
  const TemporaryFolder folder;
  for (const auto& entry :
       fs::directory_iterator(fs::path(COSEGRAPH_SOURCE_DIR) / "config/graphs")) {
    const Outcome checked = run({"cosegraph", "check", entry.path().string()});
    EXPECT_EQ(checked.status, 0) << checked.errors;
    const std::string picture = (folder / (entry.path().stem().string() + ".svg")).string();
    World::expect_fine({"cosegraph", "draw", entry.path().string(), "-o", picture});
    EXPECT_THAT(slurp(picture), HasSubstr("<svg"));
  }
}

TEST(Commands, StagesAreListedForPeopleAndPrograms) {
  EXPECT_THAT(run({"cosegraph", "stages", "spectra"}).output, HasSubstr("eigenpairs"));
  const auto stages = nlohmann::json::parse(run({"cosegraph", "stages", "--json"}).output);
  EXPECT_EQ(stages.size(), 11U);
  const auto schema = nlohmann::json::parse(run({"cosegraph", "stages", "--schema"}).output);
  EXPECT_TRUE(schema.contains("$schema"));
}

}  // namespace
}  // namespace cosegraph::test
