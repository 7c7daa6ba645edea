// record, info, compare and replay as a user runs them, on a graph that labels mugs.
#include <gmock/gmock.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "end_to_end/world.hpp"

namespace cosegraph::test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;
using testing::HasSubstr;
using testing::SizeIs;

class RecordingCommands : public testing::Test {
 protected:
  RecordingCommands() {
    // Runs of other tests, and their registry, are left alone.
    ::setenv("COSEGRAPH_RUNTIME_DIR", path("runtime").c_str(), 1);
    fs::create_directories(path("stream"));
    for (int i = 0; i < 30; ++i)
      fs::copy_file(path("queries/query-view" + std::to_string(i % 2) + ".ply"),
                    path("stream/q" + std::to_string(i) + ".ply"));
  }

  std::string path(const std::string& name) const { return world_.path(name); }

  std::vector<std::string> graph(const std::string& command, const std::string& rate) const {
    return {"cosegraph",
            command,
            std::string(COSEGRAPH_SOURCE_DIR) + "/config/graphs/segment.yaml",
            "--param",
            "model.file=" + path("model.coseg"),
            "--param",
            "source.path=" + path("stream"),
            "--param",
            "source.rate=" + rate,
            "--param",
            "sink.folder=" + path("out")};
  }

  // A recording of a whole run, by either way of running a graph.
  json record(const std::string& command) const {
    Program recorder({"cosegraph", "record", "segment", "-o", path("run.mcap"), "--wait"});
    const Outcome ran = run(graph(command, "20"));
    EXPECT_EQ(ran.status, 0) << ran.errors;
    const Outcome outcome = recorder.wait();
    EXPECT_EQ(outcome.status, 0) << outcome.errors << outcome.output;
    return info();
  }

  json info() const {
    const Outcome outcome = run({"cosegraph", "info", path("run.mcap"), "--json"});
    EXPECT_EQ(outcome.status, 0) << outcome.errors;
    return json::parse(outcome.output, nullptr, false);
  }

  const World world_;
};

TEST_F(RecordingCommands, RunIsRecordedComparedAndReplayed) {
  const json found = record("run");
  EXPECT_EQ(found["complete"], true);
  EXPECT_EQ(found["recovered"], false);
  EXPECT_EQ(found["ended"], "the stream is over");
  ASSERT_THAT(found["epochs"], SizeIs(1));
  EXPECT_EQ(found["epochs"][0]["first"], 0);
  EXPECT_EQ(found["epochs"][0]["last"], 29);
  for (const auto& topic : found["topics"]) {
    if (topic["type"] == "Labelling") {
      EXPECT_EQ(topic["messages"], 30);
    }
  }

  for (const std::string stage : {"cpc", "fisher", "svm", "astar"}) {
    const Outcome same = run({"cosegraph", "compare", path("run.mcap"), stage});
    EXPECT_EQ(same.status, 0) << same.output << same.errors;
    EXPECT_THAT(same.output, HasSubstr("30 frames identical, 0 differ, 0 not comparable"));
  }
  const Outcome changed = run(
      {"cosegraph", "compare", path("run.mcap"), "spectra", "--param", "eigenpairs=20", "--json"});
  EXPECT_EQ(changed.status, 1);
  const json report = json::parse(changed.output);
  EXPECT_EQ(report["differ"], 30);
  EXPECT_EQ(report["fine"], false);
  EXPECT_EQ(report["members"]["spectrum.eigenvalue"]["resized"], 30);
  EXPECT_EQ(run({"cosegraph", "compare", path("run.mcap"), "spectra", "--param", "x=1"}).status, 2);
  const Outcome unknown = run({"cosegraph", "compare", path("run.mcap"), "spectre"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.errors, HasSubstr("did you mean 'spectra'"));

  // The sink of the recording, fed again, writes the same files.
  const Outcome into = run({"cosegraph", "replay", path("run.mcap"), "--into", "sink", "--param",
                            "folder=" + path("again"), "--json"});
  EXPECT_EQ(into.status, 0) << into.errors;
  EXPECT_EQ(json::parse(into.output)["frames"], 30);
  for (const auto& entry : fs::directory_iterator(path("out")))
    EXPECT_EQ(slurp(entry.path()), slurp(fs::path(path("again")) / entry.path().filename()))
        << entry.path();

  const Outcome refused = run({"cosegraph", "record", "segment", "-o", path("run.mcap")});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.errors, HasSubstr("no run of 'segment'"));
}

TEST_F(RecordingCommands, RunOfManyProcessesIsRecorded) {
  const json found = record("up");
  EXPECT_EQ(found["complete"], true) << found.dump(2);
  ASSERT_THAT(found["epochs"], SizeIs(1));
  EXPECT_EQ(found["epochs"][0]["last"], 29);
}

TEST_F(RecordingCommands, KilledRecorderLeavesAReadableFileAndHoldsNobodyUp) {
  Program recorder({"cosegraph", "record", "segment", "-o", path("run.mcap"), "--wait"});
  Program running(graph("run", "8"));
  const auto has_messages = [&] {
    return fs::exists(path("run.mcap")) && fs::file_size(path("run.mcap")) > 2'000'000;
  };
  for (int i = 0; i < 600 && !has_messages(); ++i) std::this_thread::sleep_for(50ms);
  ::kill(recorder.pid(), SIGKILL);
  EXPECT_EQ(recorder.wait().status, 128 + SIGKILL);
  const Outcome ran = running.wait();
  EXPECT_EQ(ran.status, 0) << ran.errors;
  EXPECT_THAT(ran.output, HasSubstr("labelled 30"));
  const json found = info();
  EXPECT_EQ(found["recovered"], true);
  EXPECT_EQ(found["ended"], "");
  EXPECT_GT(found["messages"], 20);
  const Outcome same = run({"cosegraph", "compare", path("run.mcap"), "cpc"});
  EXPECT_EQ(same.status, 0) << same.output << same.errors;
  EXPECT_THAT(same.errors, HasSubstr("read up to offset"));
}

TEST_F(RecordingCommands, InterruptEndsARecordingInOrder) {
  Program running(graph("run", "8"));
  Program recorder(
      {"cosegraph", "record", "segment", "-o", path("run.mcap"), "--wait", "--uncompressed"});
  const auto has_messages = [&] {
    return fs::exists(path("run.mcap")) && fs::file_size(path("run.mcap")) > 500'000;
  };
  for (int i = 0; i < 600 && !has_messages(); ++i) std::this_thread::sleep_for(50ms);
  ::kill(recorder.pid(), SIGINT);
  const Outcome outcome = recorder.wait();
  EXPECT_EQ(outcome.status, 0) << outcome.errors;
  EXPECT_THAT(outcome.errors, HasSubstr("stopped"));
  EXPECT_EQ(running.wait().status, 0);
  const json found = info();
  EXPECT_EQ(found["recovered"], false);
  std::uint64_t bytes = 0;
  for (const auto& topic : found["topics"]) bytes += topic["bytes"].get<std::uint64_t>();
  EXPECT_GT(fs::file_size(path("run.mcap")), bytes) << "it was to be uncompressed";
}

TEST_F(RecordingCommands, TheLastOfARunIsKept) {
  Program recorder(
      {"cosegraph", "record", "segment", "-o", path("run.mcap"), "--wait", "--last", "1500ms"});
  EXPECT_EQ(run(graph("run", "8")).status, 0);  // 30 frames, nearly 4 s
  EXPECT_EQ(recorder.wait().status, 0);
  const json found = info();
  ASSERT_THAT(found["epochs"], SizeIs(1)) << found.dump(2);
  EXPECT_EQ(found["epochs"][0]["last"], 29);
  EXPECT_GT(found["epochs"][0]["first"], 5);
}

TEST_F(RecordingCommands, WhatIsNoRecordingIsRefused) {
  const Outcome outcome = run({"cosegraph", "info", path("model.coseg")});
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.errors, HasSubstr("model.coseg: is not an MCAP file"));
  EXPECT_EQ(run({"cosegraph", "record", "segment", "-o", "x.mcap", "--split"}).status, 2);
  EXPECT_EQ(run({"cosegraph", "record", "segment", "-o", "x.mcap", "--last", "3x"}).status, 2);
  EXPECT_EQ(run({"cosegraph", "replay", "x.mcap", "--loop", "--into", "cpc"}).status, 2);
}

}  // namespace
}  // namespace cosegraph::test
