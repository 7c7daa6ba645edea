// The monitor as the makers of its protocol and as people see it: a running graph looked at with
// their client, and with a browser. Installs packages from the registry where there is npm; what is
// not there is skipped, with the reason.
#include <gmock/gmock.h>
#include <signal.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "end_to_end/world.hpp"
#include "support/program.hpp"

namespace cosegraph::monitor {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;
using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::Ge;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Key;
using testing::SizeIs;
using testing::StartsWith;
using testing::UnorderedElementsAre;

fs::path program(const std::string& name) {
  std::istringstream folders(std::getenv("PATH") == nullptr ? "" : std::getenv("PATH"));
  for (std::string folder; std::getline(folders, folder, ':');)
    if (fs::exists(fs::path(folder) / name)) return fs::path(folder) / name;
  return {};
}

constexpr const char* kNoBrowser =
    "Chromium is not installed (tools/setup installs it), or the page was not built";

// A browser; empty: none is installed.
fs::path browser() {
  const fs::path small = program("chromium-headless-shell");
  return small.empty() ? program("chromium") : small;
}

class Clients : public testing::Test {
 protected:
  // Installs the clients, once per build folder.
  void SetUp() override {
    if (program("node").empty() || program("npm").empty())
      GTEST_SKIP() << "node and npm are not installed (tools/setup installs them)";
    fs::create_directories(clients_);
    for (const auto name : {"package.json", "package-lock.json", "protocol.mjs", "browser.mjs",
                            "page.mjs", "recording.mjs", "swap.mjs"})
      fs::copy_file(fs::path(COSEGRAPH_SOURCE_DIR) / "tests/monitor/npm" / name, clients_ / name,
                    fs::copy_options::overwrite_existing);
    const std::string lock = test::slurp(clients_ / "package-lock.json");
    if (fs::exists(clients_ / "installed") && test::slurp(clients_ / "installed") == lock) return;
    const test::Outcome outcome =
        test::run({program("npm").string(), "ci", "--prefix", clients_.string(), "--ignore-scripts",
                   "--no-audit", "--no-fund", "--fetch-retries=1", "--fetch-timeout=20000"});
    if (outcome.status != 0) GTEST_SKIP() << "npm cannot install: " << outcome.errors;
    io::write_file(clients_ / "installed", lock);
  }

  void TearDown() override {
    for (auto* process : {&monitor_, &run_}) {
      if (*process == nullptr) continue;
      ::kill((*process)->pid(), SIGTERM);
      (*process)->wait();
    }
  }

  // A graph that labels frames, by default for longer than any test looks at it.
  void start_graph(int frames = 2000, const std::string& rate = "1") {
    ::setenv("COSEGRAPH_RUNTIME_DIR", world_.path("runs").c_str(), 1);
    fs::create_directories(world_.path("stream"));
    for (int i = 0; i < frames; ++i)
      fs::create_hard_link(world_.path("queries/query-view" + std::to_string(i % 2) + ".ply"),
                           world_.path("stream/frame" + std::to_string(i) + ".ply"));
    run_ = std::make_unique<test::Program>(std::vector<std::string>{
        "cosegraph", "up", std::string(COSEGRAPH_SOURCE_DIR) + "/config/graphs/segment.yaml",
        "--param", "model.file=" + world_.path("model.coseg"), "--param",
        "source.path=" + world_.path("stream"), "--param", "source.rate=" + rate, "--param",
        "sink.folder=" + world_.path("out")});
  }

  // Its address, as "127.0.0.1:PORT".
  std::string start_monitor(std::vector<std::string> what) {
    what.insert(what.begin(), {"cosegraph", "monitor"});
    what.insert(what.end(), {"--port", "0"});
    for (int attempt = 0; attempt < 100; ++attempt) {
      monitor_ = std::make_unique<test::Program>(what);
      for (int i = 0; i < 500; ++i, std::this_thread::sleep_for(20ms)) {
        const std::string output = monitor_->output_so_far();
        const std::size_t at = output.find("ws://");
        if (at != std::string::npos && output.find("Foxglove", at) != std::string::npos)
          return output.substr(at + 5, output.find(' ', at) - at - 5);
        if (has_ended()) break;  // the run was not known yet
      }
      ::kill(monitor_->pid(), SIGKILL);
      monitor_->wait();
    }
    ADD_FAILURE() << "the monitor does not start";
    return "";
  }

  bool has_ended() const {
    siginfo_t info{};
    return ::waitid(P_PID, static_cast<id_t>(monitor_->pid()), &info,
                    WEXITED | WNOHANG | WNOWAIT) == 0 &&
           info.si_pid != 0;
  }

  json node(std::vector<std::string> words) const {
    words[0] = (clients_ / words[0]).string();
    words.insert(words.begin(), program("node").string());
    const test::Outcome outcome = test::run(words);
    EXPECT_EQ(outcome.status, 0) << outcome.errors << outcome.output;
    return json::parse(outcome.output, nullptr, false);
  }

  json look_at_page(const std::string& address, const std::string& theme,
                    std::vector<std::string> topics) const {
    topics.insert(topics.begin(),
                  {"page.mjs", browser().string(), "http://" + address, pictures(), theme});
    return node(topics);
  }

  static std::string pictures() {
    const fs::path folder = fs::path(COSEGRAPH_BINARY_DIR) / "tests/monitor_pictures";
    fs::create_directories(folder);
    return folder.string();
  }

  static bool can_browse() {
    return !browser().empty() &&
           fs::exists(fs::path(COSEGRAPH_BINARY_DIR) / "share/cosegraph/web/index.html");
  }

  const fs::path clients_ = fs::path(COSEGRAPH_BINARY_DIR) / "tests/monitor_clients";
  const test::World world_;
  std::unique_ptr<test::Program> run_;
  std::unique_ptr<test::Program> monitor_;
};

std::set<std::string> fields_of(const json& cloud) {
  std::set<std::string> names;
  for (const auto& field : cloud["fields"]) names.insert(field["name"]);
  return names;
}

TEST_F(Clients, TheProtocolsOwnClientReadsARunningGraph) {
  start_graph();
  const std::string address = start_monitor({"segment"});
  const json seen =
      node({"protocol.mjs", "ws://" + address, "foxglove.sdk.v1", "segment/astar/labelling",
            "segment/source/dense", "segment/source/dense/points", "segment/cpc/segments/points",
            "segment/astar/labelling/points", "segment/monitor"});
  ASSERT_TRUE(seen.is_object());
  EXPECT_EQ(seen["protocol"], "foxglove.sdk.v1");
  EXPECT_EQ(seen["info"]["name"], "cosegraph monitor: segment");
  EXPECT_THAT(seen["statuses"], IsEmpty());
  const json& dense = seen["channels"]["segment/source/dense"];
  EXPECT_EQ(dense["encoding"], "cdr");
  EXPECT_EQ(dense["schemaEncoding"], "omgidl");
  EXPECT_EQ(dense["schemaName"], "cosegraph::msg::Cloud");
  EXPECT_THAT(seen["graph"]["publishedTopics"],
              Contains(json{{"name", "segment/astar/labelling"}, {"publisherIds", {"astar"}}}));
  EXPECT_THAT(seen["graph"]["subscribedTopics"],
              Contains(json{{"name", "segment/astar/labelling"}, {"subscriberIds", {"sink"}}}));

  EXPECT_EQ(seen["service"]["name"], "segment/swap");
  EXPECT_TRUE(json::accept(seen["service"]["request"]["schema"].get<std::string>()));
  EXPECT_EQ(seen["refusal"]["callId"], 7);
  EXPECT_EQ(seen["refusal"]["message"], "there is no stage 'nobody'");

  const json& cloud = seen["values"]["segment/source/dense"]["value"];
  EXPECT_EQ(cloud["header"]["graph"], "segment");
  EXPECT_THAT(cloud["header"]["name"].get<std::string>(), HasSubstr("frame"));
  const int points = cloud["width"];
  EXPECT_EQ(cloud["xyz"]["length"], 3 * points);
  const json& labelling = seen["values"]["segment/astar/labelling"]["value"];
  EXPECT_THAT(labelling["label_names"], Contains("handle"));
  EXPECT_GT(labelling["point_label"]["length"], 100);

  for (const std::string topic : {"segment/source/dense/points", "segment/cpc/segments/points",
                                  "segment/astar/labelling/points"}) {
    EXPECT_EQ(seen["channels"][topic]["schemaName"], "foxglove::PointCloud") << topic;
    const json& drawn = seen["values"][topic]["value"];
    const std::set<std::string> fields = fields_of(drawn);
    for (const auto name : {"x", "y", "z", "red", "green", "blue", "alpha"})
      EXPECT_TRUE(fields.contains(name)) << topic << " " << name;
    EXPECT_EQ(drawn["pose"]["orientation"]["w"], 1);
    EXPECT_EQ(drawn["data"]["length"].get<int>() % drawn["point_stride"].get<int>(), 0);
    EXPECT_GT(drawn["data"]["length"].get<int>() / drawn["point_stride"].get<int>(), 100);
  }
  EXPECT_TRUE(
      fields_of(seen["values"]["segment/astar/labelling/points"]["value"]).contains("label"));

  const json& state = seen["values"]["segment/monitor"]["value"];
  EXPECT_EQ(state["state"], "running");
  EXPECT_THAT(state["stages"], SizeIs(10));
}

TEST_F(Clients, APersonSeesARunningGraph) {
  if (!can_browse()) GTEST_SKIP() << kNoBrowser;
  start_graph();
  const std::string address = start_monitor({"segment"});
  const std::vector<std::string> topics = {
      "segment/source/dense",   "segment/supervoxels/supervoxels",
      "segment/cpc/segments",   "segment/descriptors/descriptors",
      "segment/svm/scores",     "segment/spectra/spectrum",
      "segment/astar/labelling"};
  const json seen = look_at_page(address, "light", topics);
  ASSERT_TRUE(seen.is_object());
  EXPECT_THAT(seen["errors"], IsEmpty());
  for (const auto& topic : topics) {
    const json& pane = seen["topics"][topic];
    EXPECT_GT(pane["points"], 100) << topic;
    EXPECT_GT(pane["drawn"], 0.03) << topic;
    EXPECT_THAT(pane["facts"], Contains(HasSubstr(" points"))) << topic;
  }
  EXPECT_THAT(seen["topics"]["segment/astar/labelling"]["legend"].get<std::string>(),
              AllOf(HasSubstr("handle"), HasSubstr("%")));
  EXPECT_THAT(seen["topics"]["segment/astar/labelling"]["facts"], Contains(HasSubstr("accuracy")));
  EXPECT_THAT(seen["topics"]["segment/cpc/segments"]["legend"].get<std::string>(),
              HasSubstr("concave"));
  EXPECT_THAT(seen["topics"]["segment/svm/scores"]["rows"], Ge(2));
  // Pairs of two parts: the distances in the frame and the model's mixtures.
  EXPECT_EQ(seen["topics"]["segment/spectra/spectrum"]["charts"], 3);
  EXPECT_EQ(seen["stages"], 10);
  EXPECT_EQ(seen["wires"], 18);
  EXPECT_THAT(seen["rate"], Contains(HasSubstr("/s")));
  EXPECT_EQ(seen["pill"], "running");
  EXPECT_THAT(seen["account"].get<std::string>(), HasSubstr("admitted"));
  EXPECT_THAT(seen["held"], SizeIs(3));
  EXPECT_THAT(seen["help"].get<std::string>(), HasSubstr("previous, next frame"));
  EXPECT_EQ(seen["theme"], "light");
  EXPECT_EQ(seen["otherTheme"], "dark");
}

TEST_F(Clients, APersonSwapsAStage) {
  if (!can_browse()) GTEST_SKIP() << kNoBrowser;
  start_graph();
  const std::string address = start_monitor({"segment"});
  const json seen = node({"swap.mjs", browser().string(), "http://" + address, pictures(), "light",
                          "cpc", "min_segment", "5", "-1"});
  ASSERT_TRUE(seen.is_object());
  EXPECT_THAT(seen["errors"], IsEmpty());
  EXPECT_THAT(seen["processes"], SizeIs(1));
  EXPECT_EQ(seen["bad"]["kind"], "bad");
  EXPECT_THAT(seen["bad"]["text"].get<std::string>(), HasSubstr("min_segment"));
  EXPECT_EQ(seen["trial"]["kind"], "good");
  EXPECT_THAT(seen["trial"]["text"].get<std::string>(), HasSubstr("Nothing was changed"));
  EXPECT_EQ(seen["swap"]["kind"], "good");
  EXPECT_THAT(seen["swap"]["text"].get<std::string>(), HasSubstr("longest pause"));
}

TEST_F(Clients, APersonSeesARecording) {
  if (!can_browse()) GTEST_SKIP() << kNoBrowser;
  ::setenv("COSEGRAPH_RUNTIME_DIR", world_.path("runs").c_str(), 1);
  test::Program recorder(
      {"cosegraph", "record", "segment", "-o", world_.path("run.mcap"), "--wait"});
  constexpr int kFrames = 100;  // of which the page has not even half at a time
  start_graph(kFrames, "10");   // at which the recorder has a second to come before one is gone
  const test::Outcome recorded = recorder.wait();
  ASSERT_EQ(recorded.status, 0) << recorded.errors;
  const std::string address = start_monitor({world_.path("run.mcap")});
  const json seen =
      look_at_page(address, "dark", {"segment/spectra/spectrum", "segment/astar/labelling"});
  ASSERT_TRUE(seen.is_object());
  EXPECT_THAT(seen["errors"], IsEmpty());
  EXPECT_EQ(seen["pill"], "file");
  EXPECT_EQ(seen["stages"], 10);
  EXPECT_EQ(seen["topics"]["segment/spectra/spectrum"]["charts"], 3);
  EXPECT_GT(seen["topics"]["segment/astar/labelling"]["drawn"], 0.03);

  const json gone = node({"recording.mjs", browser().string(), "http://" + address, pictures(),
                          "light", "segment/astar/labelling"});
  ASSERT_TRUE(gone.is_object());
  EXPECT_THAT(gone["errors"], IsEmpty());
  const json& places = gone["places"];
  EXPECT_EQ(places["first"]["name"], "frame0 · 1 of 100, 0.0 s");
  EXPECT_EQ(places["last"]["number"], kFrames - 1);
  EXPECT_THAT(places["last"]["name"].get<std::string>(), StartsWith("frame99 · 100 of 100, "));
  EXPECT_EQ(places["before"]["number"], kFrames - 2);
  EXPECT_EQ(places["middle"]["number"], 49);
  EXPECT_THAT(places["middle"]["name"].get<std::string>(), HasSubstr("50 of 100, "));
  EXPECT_EQ(places["again"], places["first"]);
  EXPECT_GE(places["played"]["number"], 3);
}

TEST_F(Clients, APersonSeesFilesWithoutAGraph) {
  if (!can_browse()) GTEST_SKIP() << kNoBrowser;
  test::World::expect_fine({"cosegraph", "segment", "--model", world_.path("model.coseg"),
                            world_.path("queries"), "-o", world_.path("out")});
  const std::string address =
      start_monitor({world_.path("out"), world_.path("model.coseg"), "--spectrum"});
  const json seen =
      look_at_page(address, "dark", {"file/cloud", "file/labelling", "file/spectrum"});
  ASSERT_TRUE(seen.is_object());
  EXPECT_THAT(seen["errors"], IsEmpty());
  EXPECT_EQ(seen["pill"], "file");
  EXPECT_EQ(seen["theme"], "dark");
  EXPECT_GT(seen["topics"]["file/labelling"]["drawn"], 0.03);
  EXPECT_THAT(seen["topics"]["file/labelling"]["legend"].get<std::string>(), HasSubstr("handle"));
  EXPECT_EQ(seen["topics"]["file/spectrum"]["charts"], 3);
  ASSERT_THAT(seen["held"], SizeIs(3));
  EXPECT_NE(seen["held"][0], seen["held"][1]);
  EXPECT_EQ(seen["held"][0], seen["held"][2]);
  EXPECT_EQ(seen["stages"], 0);
}

}  // namespace
}  // namespace cosegraph::monitor
