// The commands that look into a running graph, on one that runs beside the test.
#include <gmock/gmock.h>

#include <cmath>
#include <csignal>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <thread>

#include "graph/dds.hpp"
#include "graph/runs.hpp"
#include "support/program.hpp"

namespace cosegraph::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Json = nlohmann::json;
using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr double kRate = 2.0;  // Hz, at which the source admits frames

// A sphere for a long stream.
void write_sphere(const fs::path& file) {
  std::ofstream stream(file);
  constexpr int kPoints = 3000;
  stream << "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH "
         << kPoints << "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " << kPoints
         << "\nDATA ascii\n";
  for (int i = 0; i < kPoints; ++i) {
    const double z = 2.0 * (i + 0.5) / kPoints - 1.0;
    const double angle = 2.4 * i;
    const double r = std::sqrt(1.0 - z * z);
    stream << r * std::cos(angle) << ' ' << r * std::sin(angle) << ' ' << z + 3.0 << '\n';
  }
}

// Source, supervoxels, cpc: a run that lasts until the test is over.
class RunningGraph {
 public:
  explicit RunningGraph(const std::string& how) {
    ::setenv("COSEGRAPH_RUNTIME_DIR", (folder_ / "runs").c_str(), 1);
    fs::create_directories(folder_ / "stream");
    write_sphere(folder_ / "sphere.pcd");
    for (int i = 0; i < 2000; ++i)
      fs::create_hard_link(folder_ / "sphere.pcd",
                           folder_ / ("stream/s" + std::to_string(i) + ".pcd"));
    std::ofstream(file()) << "version: 1\ngraph: " << name() << "\nstages:\n"
                          << "  source: {use: source, params: {path: ["
                          << (folder_ / "stream").string() << "], rate: " << kRate << "}}\n"
                          << "  supervoxels: {use: supervoxels, inputs: {cloud: source/dense}}\n"
                          << "  cpc: {use: cpc, inputs: {supervoxels: supervoxels/supervoxels}}\n";
    program_ = std::make_unique<Program>(std::vector<std::string>{"cosegraph", how, file()});
    wait_for_frames();
  }
  ~RunningGraph() {
    ::kill(program_->pid(), SIGINT);
    program_->wait();
  }

  std::string file() const { return (folder_ / "graph.yaml").string(); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  static std::string name() { return "topics" + std::to_string(::getpid()); }
  static std::string topic(const std::string& port) { return name() + "/" + port; }

  // The output of a command that must succeed.
  static std::string output_of(std::vector<std::string> words) {
    words.insert(words.begin(), "cosegraph");
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.status, 0) << outcome.errors << outcome.output;
    return outcome.output;
  }
  static Json json_of(std::vector<std::string> words) {
    words.emplace_back("--json");
    return Json::parse(output_of(words));
  }

 private:
  // Until the last stage has done a frame.
  void wait_for_frames() const {
    for (int i = 0; i < 60; ++i) {
      const Outcome outcome = run({"cosegraph", "top", name(), "--once", "--json"});
      const Json stages = outcome.status == 0 ? Json::parse(outcome.output)["stages"] : Json();
      for (const auto& stage : stages)
        if (stage["stage"] == "cpc" && stage["frames"] > 0) return;
      std::this_thread::sleep_for(200ms);
    }
    ADD_FAILURE() << "the graph did not start";
  }

  TemporaryFolder folder_;
  std::unique_ptr<Program> program_;
};

const Json& entry(const Json& list, const std::string& key, const std::string& value) {
  static const Json none;
  for (const auto& one : list)
    if (one[key] == value) return one;
  ADD_FAILURE() << "no " << value << " in " << list.dump();
  return none;
}

TEST(Topics, OfARunningGraph) {
  const RunningGraph graph("run");

  // Every edge is listed, the graph being known by its name, its file, or as the only one.
  for (const auto& words : {std::vector<std::string>{"topic", "list"},
                            {"topic", "list", graph.name()},
                            {"topic", "list", "-g", graph.name()},
                            {"topic", "list", graph.file()}}) {
    const Json list = graph.json_of(words);
    for (const std::string edge : {"source/dense", "supervoxels/supervoxels"}) {
      const Json& topic = entry(list, "topic", graph.topic(edge));
      EXPECT_EQ(topic["writers"], 1) << edge;
      EXPECT_EQ(topic["readers"], 1) << edge;
      EXPECT_GT(topic["messages"], 0) << edge;
    }
    EXPECT_EQ(entry(list, "topic", graph.topic("cpc/segments"))["readers"], 0);
    EXPECT_EQ(entry(list, "topic", graph.topic("source/dense"))["type"], "Cloud");
  }
  EXPECT_THAT(graph.output_of({"topic", "list", "--control"}), HasSubstr("/stage_status"));
  EXPECT_THAT(graph.output_of({"topic", "list"}), Not(HasSubstr("/stage_status")));

  // Messages of frames, of the runtime, whole and in part.
  EXPECT_THAT(graph.output_of({"topic", "echo", "source/dense", "--once"}),
              AllOf(HasSubstr("  stage: source\n"), HasSubstr("  name: s"), HasSubstr("xyz: "),
                    HasSubstr(" x 3 floats, ["), HasSubstr("label: []\n")));
  EXPECT_EQ(graph.json_of({"topic", "echo", graph.name(), graph.topic("cpc/segments"), "--once",
                           "--field", "header.stage"}),
            "cpc");
  const Json whole = graph.json_of({"topic", "echo", "cpc/segments", "--once", "--full"});
  EXPECT_TRUE(whole["of_point"].is_array());
  EXPECT_GT(whole["of_point"].size(), 100U);
  EXPECT_THAT(graph.output_of({"topic", "echo", "stage_status", "--once", "--field", "kind"}),
              AnyOf("source\n", "supervoxels\n", "cpc\n"));

  // Rates, from the stages' own counters.
  const Json hz = graph.json_of({"topic", "hz", "source/dense", "--once"});
  EXPECT_GT(hz["hz"], 0.2 * kRate);
  EXPECT_LT(hz["hz"], 2.0 * kRate);
  const Json bw = graph.json_of({"topic", "bw", "source/dense", "--once", "--window", "3"});
  EXPECT_NEAR(bw["bytes_per_second"].get<double>() / bw["hz"].get<double>(),
              bw["bytes"].get<double>() / bw["messages"].get<double>(),
              0.05 * bw["bytes"].get<double>() / bw["messages"].get<double>());
  const Json delay = graph.json_of({"topic", "delay", "cpc/segments", "--once"});
  EXPECT_EQ(delay["clock_offset_ms"], 0.0) << "one machine";
  EXPECT_GT(delay["ms_min"], 0.0);
  EXPECT_LE(delay["ms_min"], delay["ms_max"]);
}

TEST(Topics, WhatIsMisspeltIsAnsweredWithWhatIsMeant) {
  const RunningGraph graph("run");
  const auto complaint = [](std::vector<std::string> words) {
    words.insert(words.begin(), "cosegraph");
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.status, 2) << outcome.output;
    return outcome.errors;
  };
  EXPECT_THAT(complaint({"topic", "info", "source/dens"}),
              HasSubstr("did you mean 'source/dense'"));
  EXPECT_THAT(complaint({"topic", "hz", "cpc/segment"}), HasSubstr("did you mean 'cpc/segments'"));
  EXPECT_THAT(complaint({"topic", "hz", "stage_status"}), HasSubstr("topic list"));
  EXPECT_THAT(complaint({"topic", "delay", "stage_status"}), HasSubstr("carries no frames"));
  EXPECT_THAT(complaint({"topic", "echo", "source/dense", "--once", "--field", "xzy"}),
              HasSubstr("did you mean 'xyz'"));
  EXPECT_THAT(complaint({"why", "cpx/supervoxels"}), HasSubstr("did you mean 'cpc'"));
  EXPECT_THAT(complaint({"why", "cpc/supervoxel"}), HasSubstr("did you mean 'supervoxels'"));
  EXPECT_THAT(complaint({"why", "cpc"}), HasSubstr("STAGE/INPUT"));
  const Outcome other = run({"cosegraph", "topic", "list", "nobody"});
  EXPECT_EQ(other.status, 1);
  EXPECT_THAT(other.errors, HasSubstr(graph.name()));
}

TEST(Topics, StrangersAndTheirMismatchesAreTold) {
  const RunningGraph graph("run");
  const graph::GraphDescription description = graph::find_run({graph.name(), ""});
  graph::Participant stranger(description, "stranger");
  const auto reader = stranger.reader(graph.topic("source/dense"), "Segments", {},
                                      [](const graph::Sample&) { FAIL() << "does not match"; });
  const auto writer = stranger.writer(graph.topic("source/odd"), "odd::Type", {});

  const Json info = graph.json_of({"topic", "info", "source/dense"});
  ASSERT_EQ(info["mismatches"].size(), 1U) << info.dump(2);
  EXPECT_EQ(info["mismatches"][0]["reader"], "stranger");
  EXPECT_EQ(info["mismatches"][0]["writer"], "source");
  EXPECT_THAT(info["mismatches"][0]["reasons"].dump(), HasSubstr("cosegraph::msg::Segments"));
  EXPECT_EQ(info["readers"].size(), 2U);
  EXPECT_EQ(info["writers"][0]["qos"]["durability"], "transient_local");
  EXPECT_THAT(graph.output_of({"topic", "info", "source/dense"}),
              AllOf(HasSubstr("no match: source -> stranger"), HasSubstr("on this machine")));
  EXPECT_THAT(graph.output_of({"topic", "list"}), HasSubstr("source/odd"));

  // What is not of a known type is shown as it is.
  std::atomic<bool> stop = false;
  std::jthread writing([&] {
    while (!stop) {
      writer->write({0, 1, 0, 0, 0xca, 0xfe, 0xba, 0xbe});  // DDS pads to multiples of 4
      std::this_thread::sleep_for(100ms);
    }
  });
  EXPECT_THAT(graph.output_of({"topic", "echo", graph.topic("source/odd"), "--once"}),
              AllOf(HasSubstr("odd::Type, 8 bytes"), HasSubstr("00 01 00 00 ca fe ba be")));
  stop = true;
}

TEST(Topics, TopDrawingAndWhy) {
  const RunningGraph graph("up");
  const Json top = graph.json_of({"top", "--once"});
  ASSERT_EQ(top["stages"].size(), 3U);
  EXPECT_EQ(top["stages"][0]["stage"], "source") << "in the file's order";
  EXPECT_GT(top["stages"][2]["frames"], 0);
  EXPECT_GT(top["stages"][2]["memory"], 1 << 20);
  EXPECT_GT(top["account"]["admitted"], 0);
  EXPECT_THAT(graph.output_of({"top", "--once"}), AllOf(HasSubstr("in flight"), HasSubstr("cpc")));

  graph.output_of({"draw", graph.name(), "--live", "-o", graph.path("live.dot")});
  EXPECT_THAT(slurp(graph.path("live.dot")),
              AllOf(HasSubstr(" frames, "), HasSubstr(" Hz"), HasSubstr(" admitted, "),
                    Not(HasSubstr("not heard"))));

  EXPECT_THAT(graph.output_of({"why", graph.name(), "cpc/supervoxels"}),
              HasSubstr("nothing is broken"));
  graph.output_of({"stop", "supervoxels", "--graph", graph.name()});
  const Outcome stopped = run({"cosegraph", "why", "cpc/supervoxels", "--json"});
  EXPECT_EQ(stopped.status, 1);
  EXPECT_EQ(Json::parse(stopped.output)["broken"], "process");
  EXPECT_THAT(stopped.output, HasSubstr("cosegraph start supervoxels"));
}

TEST(Doctor, ExaminesTheMachineAndTheGraph) {
  const RunningGraph graph("up");
  const Outcome outcome = run({"cosegraph", "doctor", graph.name(), "--json"});
  const Json findings = Json::parse(outcome.output);
  bool any_wrong = false;
  for (const auto& finding : findings) {
    any_wrong = any_wrong || finding["health"] == "wrong";
    EXPECT_FALSE(finding["text"].get<std::string>().empty());
    if (finding["health"] == "wrong") {
      EXPECT_NE(finding["remedy"], "") << finding.dump();
    }
  }
  EXPECT_EQ(outcome.status, any_wrong ? 1 : 0);
  EXPECT_THAT(entry(findings, "area", "run")["text"].get<std::string>(),
              HasSubstr("all 3 stages are heard"));
  EXPECT_THAT(entry(findings, "area", "agents")["text"].get<std::string>(), HasSubstr("answers"));
  EXPECT_EQ(entry(findings, "area", "programs")["health"], "ok");
}

TEST(Doctor, NamesAFolderThatCannotBeUsedAndAFaultyGraph) {
  const TemporaryFolder folder;
  std::ofstream(folder / "graph.yaml") << "version: 1\ngraph: g\nstages: {a: {use: sorce}}\n";
  std::ofstream(folder / "file") << "";
  ::setenv("COSEGRAPH_RUNTIME_DIR", (folder / "file").c_str(), 1);
  const Outcome blocked = run({"cosegraph", "doctor"});
  EXPECT_EQ(blocked.status, 1);
  EXPECT_THAT(blocked.output, HasSubstr("wrong  runtime folder"));
  ::setenv("COSEGRAPH_RUNTIME_DIR", (folder / "runs").c_str(), 1);
  const Outcome faulty = run({"cosegraph", "doctor", (folder / "graph.yaml").string()});
  EXPECT_EQ(faulty.status, 1);
  EXPECT_THAT(faulty.output, HasSubstr("graph.yaml:3:"));
  EXPECT_THAT(faulty.output, HasSubstr("did you mean 'source'"));
}

TEST(Doctor, TellsWhatLostPacketsLeaveBehindWhereHostsHaveKeys) {
  const TemporaryFolder folder;
  ::setenv("COSEGRAPH_RUNTIME_DIR", (folder / "runs").c_str(), 1);
  const auto looks_at_it = [&](const std::string& dds) {
    std::ofstream(folder / "graph.yaml")
        << "version: 1\ngraph: g\n"
        << dds
        << "hosts: {one: {address: 127.0.0.1}, two: {address: 10.9.8.7}}\n"
           "stages:\n  source: {use: source, host: one, params: {path: x}}\n"
           "  supervoxels: {use: supervoxels, host: two, inputs: {cloud: source/dense}}\n";
    const Outcome outcome =
        run({"cosegraph", "doctor", (folder / "graph.yaml").string(), "--timeout", "1s"});
    return outcome.output.find("net.ipv4.ipfrag_time") != std::string::npos;
  };
  EXPECT_TRUE(looks_at_it("dds: {security: keys}\n"));
  EXPECT_FALSE(looks_at_it(""));
}

}  // namespace
}  // namespace cosegraph::test
