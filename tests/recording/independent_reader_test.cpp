// Recordings read by the libraries of the format's makers: what we write is an MCAP file, and who
// has only that file can decode its messages.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "idl/codec.hpp"
#include "idl/schema.hpp"
#include "support/program.hpp"
#include "tools/recording/mcap_reader.hpp"
#include "tools/recording/mcap_writer.hpp"

namespace cosegraph::recording {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::SizeIs;

const idl::FrameHeader kHeader{.graph = "segment",
                               .stage = "camera",
                               .generation = 3,
                               .source = "camera",
                               .epoch = 12345678901234ULL,
                               .sequence = 42,
                               .stamp = -7,
                               .model_id = 0xfedcba9876543210ULL,
                               .name = "mug \xc3\xa4"};

fs::path program(const std::string& name) {
  std::istringstream folders(std::getenv("PATH") == nullptr ? "" : std::getenv("PATH"));
  for (std::string folder; std::getline(folders, folder, ':');)
    if (fs::exists(fs::path(folder) / name)) return fs::path(folder) / name;
  return {};
}

class IndependentReader : public testing::Test {
 protected:
  // Installs the libraries, once per build folder.
  void SetUp() override {
    if (program("node").empty() || program("npm").empty())
      GTEST_SKIP() << "node and npm are not installed";
    fs::create_directories(libraries_);
    for (const auto name : {"package.json", "package-lock.json", "read.mjs"})
      fs::copy_file(fs::path(COSEGRAPH_SOURCE_DIR) / "tests/recording/npm" / name,
                    libraries_ / name, fs::copy_options::overwrite_existing);
    const std::string lock = test::slurp(libraries_ / "package-lock.json");
    if (fs::exists(libraries_ / "installed") && test::slurp(libraries_ / "installed") == lock)
      return;
    const test::Outcome outcome = test::run(
        {program("npm").string(), "ci", "--prefix", libraries_.string(), "--ignore-scripts",
         "--no-audit", "--no-fund", "--fetch-retries=1", "--fetch-timeout=20000"});
    if (outcome.status != 0) GTEST_SKIP() << "npm cannot install: " << outcome.errors;
    io::write_file(libraries_ / "installed", lock);
  }

  fs::path file() const { return folder_ / "test.mcap"; }

  json read(const std::string& mode = "") const {
    const test::Outcome outcome = test::run(
        {program("node").string(), (libraries_ / "read.mjs").string(), file().string(), mode});
    EXPECT_EQ(outcome.status, 0) << outcome.errors;
    return json::parse(outcome.output, nullptr, false);
  }

  template <class Value>
  void write(McapWriter& writer, const Value& value) {
    const std::string type(idl::type_name<Value>());
    const std::uint16_t schema = writer.add_schema(
        idl::wire_type(type), std::string(idl::kSchemaEncoding), std::string(idl::idl_text(type)));
    const std::uint16_t channel =
        writer.add_channel("segment/" + type, schema, std::string(idl::kMessageEncoding));
    const idl::Bytes bytes = idl::encode(kHeader, value);
    ++time_;
    writer.write({.channel = channel,
                  .sequence = 42,
                  .log_time = time_,
                  .publish_time = time_,
                  .data = bytes});
  }

  static json value_of(const json& all, const std::string& type) {
    for (const auto& message : all["messages"])
      if (message["type"] == "cosegraph::msg::" + type) return message["value"];
    ADD_FAILURE() << "no " << type;
    return {};
  }

 private:
  const fs::path libraries_ = fs::path(COSEGRAPH_BINARY_DIR) / "tests/independent_reader";
  const test::TemporaryFolder folder_;
  std::uint64_t time_ = 1'700'000'000'000'000'000ULL;
};

TEST_F(IndependentReader, DecodesEveryType) {
  {
    McapWriter writer(file(), {.chunk_size = 500});
    writer.attach(
        {.log_time = 1, .name = "graph.yaml", .media_type = "application/yaml", .data = "a: 1"});
    write(writer, Cloud{.xyz = {1, 2, 3, 4, 5, 6.5F},
                        .label = {1, kNoLabel},
                        .label_names = {"body", "handle"},
                        .origin = {0.5F, 0.0F, -1.0F},
                        .scale = 2.5F,
                        .recipe = "spacing=0.014",
                        .notes = {"reduced"},
                        .width = 2,
                        .height = 1});
    write(writer, Supervoxels{.of_point = {0, 1, 1},
                              .centroid = {0, 0, 0, 1, 1, 1},
                              .normal = {0, 0, 1, 0, 1, 0},
                              .point_count = {1, 2},
                              .adjacency = {{0, 1}},
                              .seed_resolution = 0.25F});
    write(writer, Segments{.of_supervoxel = {0, 0, 1, 2},
                           .of_point = {0, 1, 2, 2, 2},
                           .count = 3,
                           .adjacency = {{0, 1}, {1, 2}},
                           .concavity = {0.25F, 1.0F}});
    write(writer, Descriptors{.recipe = "channels=x",
                              .channels = {{"fpfh:0.08", 2, {0, 5}, {1, 2, 3, 4}},
                                           {"shot:0.13", 1, {7}, {9}}}});
    write(writer, Encodings{.segment_count = 2, .dimension = 1, .segment = {1}, .value = {0.5F}});
    write(writer, Scores{.label_names = {"a", "b"},
                         .majority = 1,
                         .segment_count = 1,
                         .probability = {0.25F, 0.75F}});
    write(writer, Spectrum{.recipe = "samples=500", .sample = {1}, .eigenvalue = {2.5F}});
    write(writer, Labelling{.label_names = {"a", "b"},
                            .segment_label = {1, 0},
                            .segment_confidence = {0.5F, 0.25F},
                            .energy = -1.5,
                            .proven_optimal = true,
                            .violations = 3,
                            .expansions = 1LL << 40});
    write(writer, AppearanceModel{.id = 77,
                                  .label_names = {"a", "b"},
                                  .channels = {{.name = "fpfh:0.08", .dimension = 2}},
                                  .classifier = {.kernel = "linear", .gamma = 0.5}});
    write(writer, RelationModel{.id = 78,
                                .label_names = {"a"},
                                .pairs = {{.weight = {1}, .mean = {2}, .sigma = {3}}},
                                .neighbours = {1}});
    write(writer, idl::StreamEnd{9});
    write(writer, idl::FrameFailure{"no points"});
    write(writer, idl::FrameDone{idl::Outcome::failed, "cpc", "no points"});
    write(writer,
          idl::StageStatus{
              .kind = "cpc",
              .state = idl::State::working,
              .progress = 0.5,
              .account = {.admitted = 5, .dropped = 7},
              .ports = {{.name = "out", .topic = "g/cpc/out", .output = true, .bytes = 9}}});
    write(writer, idl::Command{.id = 5, .verb = "drain", .words = {"a", "b"}});
    write(writer, idl::Reply{.id = 5, .state = idl::ReplyState::refused, .text = "busy"});
    write(writer, idl::AgentStatus{.processes = {{.stage = "cpc", .pid = 3, .text = "t"}}});
    write(writer, idl::LogLines{.stage = "cpc", .lines = {"one", "two"}});
    writer.add({.name = "completeness", .values = {{"complete", "true"}}});
    writer.close();
  }
  const json all = read();
  ASSERT_TRUE(all.is_object());
  EXPECT_EQ(all["library"], "cosegraph");
  EXPECT_EQ(all["dataCrcFits"], true);
  EXPECT_GT(all["chunks"], 3);
  EXPECT_THAT(all["messages"], SizeIs(idl::type_names().size()));
  EXPECT_EQ(all["statistics"]["messageCount"], std::to_string(idl::type_names().size()));
  EXPECT_EQ(all["attachments"]["graph.yaml"], "a: 1");
  EXPECT_EQ(all["metadata"]["completeness"]["complete"], "true");
  std::uint64_t time = 1'700'000'000'000'000'000ULL;
  for (const auto& message : all["messages"]) {
    EXPECT_EQ(message["encoding"], "cdr");
    EXPECT_EQ(message["sequence"], 42);
    EXPECT_EQ(message["logTime"], std::to_string(++time));
    const json& header = message["value"]["header"];
    EXPECT_EQ(header["graph"], "segment");
    EXPECT_EQ(header["generation"], 3);
    EXPECT_EQ(header["epoch"], "12345678901234");
    EXPECT_EQ(header["sequence_number"], "42");
    EXPECT_EQ(header["stamp"], "-7");
    EXPECT_EQ(header["model_id"], std::to_string(0xfedcba9876543210ULL));
    EXPECT_EQ(header["name"], "mug \xc3\xa4");
  }
  const json cloud = value_of(all, "Cloud");
  EXPECT_EQ(cloud["xyz"], (json{1, 2, 3, 4, 5, 6.5}));
  EXPECT_EQ(cloud["label"], (json{1, kNoLabel}));
  EXPECT_EQ(cloud["label_names"], (json{"body", "handle"}));
  EXPECT_EQ(cloud["origin"], (json{0.5, 0, -1}));
  EXPECT_EQ(cloud["height"], 1);
  EXPECT_EQ(value_of(all, "Supervoxels")["seed_resolution"], 0.25);
  EXPECT_EQ(value_of(all, "Segments")["adjacency"], (json{0, 1, 1, 2}));
  const json channels = value_of(all, "Descriptors")["channels"];
  ASSERT_THAT(channels, SizeIs(2));
  EXPECT_EQ(channels[0]["values"], (json{1, 2, 3, 4}));
  EXPECT_EQ(channels[1]["name"], "shot:0.13");
  EXPECT_EQ(value_of(all, "Encodings")["values"], (json::array({0.5})));
  EXPECT_EQ(value_of(all, "Scores")["probability"], (json{0.25, 0.75}));
  EXPECT_EQ(value_of(all, "Spectrum")["eigenvalue"], (json::array({2.5})));
  const json labelling = value_of(all, "Labelling");
  EXPECT_EQ(labelling["energy"], -1.5);
  EXPECT_EQ(labelling["proven_optimal"], true);
  EXPECT_EQ(labelling["violations"], 3);
  EXPECT_EQ(labelling["expansions"], std::to_string(1LL << 40));
  const json appearance = value_of(all, "AppearanceModel");
  EXPECT_EQ(appearance["id"], "77");
  EXPECT_EQ(appearance["channels"][0]["dimension"], 2);
  EXPECT_EQ(appearance["gamma"], 0.5);
  EXPECT_EQ(value_of(all, "RelationModel")["neighbours"], (json::array({1})));
  EXPECT_EQ(value_of(all, "StreamEnd")["count"], "9");
  EXPECT_EQ(value_of(all, "FrameFailure")["reason"], "no points");
  EXPECT_EQ(value_of(all, "FrameDone")["outcome"], "failed");
  EXPECT_EQ(value_of(all, "StageStatus")["dropped"], "7");
  EXPECT_EQ(value_of(all, "StageStatus")["ports"][0]["bytes"], "9");
  EXPECT_EQ(value_of(all, "Command")["words"], (json{"a", "b"}));
  EXPECT_EQ(value_of(all, "Reply")["state"], "refused");
  EXPECT_EQ(value_of(all, "AgentStatus")["processes"][0]["text"], "t");
  EXPECT_EQ(value_of(all, "LogLines")["lines"], (json{"one", "two"}));
}

TEST_F(IndependentReader, ReadsUncompressedChunks) {
  {
    McapWriter writer(file(), {.compressed = false});
    write(writer, idl::FrameFailure{"no points"});
    writer.flush();
    write(writer, idl::StreamEnd{9});
    writer.close();
  }
  const json all = read();
  EXPECT_EQ(all["dataCrcFits"], true);
  EXPECT_EQ(all["chunks"], 2);
  EXPECT_EQ(value_of(all, "FrameFailure")["reason"], "no points");
  EXPECT_EQ(value_of(all, "StreamEnd")["count"], "9");
}

TEST_F(IndependentReader, ReadsWhatAKilledWriterLeaves) {
  {
    McapWriter writer(file());
    for (int i = 0; i < 3; ++i) {
      write(writer, idl::StreamEnd{9});
      writer.flush();
    }
  }
  const std::uint64_t size = fs::file_size(file());
  fs::resize_file(file(), size - 60);  // into the last chunk
  const json all = read("--stream");
  EXPECT_EQ(all["done"], false);
  EXPECT_EQ(all["counts"]["Message"], 2);
  EXPECT_EQ(McapReader(file()).statistics().messages, 2U);
}

}  // namespace
}  // namespace cosegraph::recording
