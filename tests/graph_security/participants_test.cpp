// Who meets whom. What must not happen is waited for by something that is sure to happen later.
#include <gmock/gmock.h>

#include <atomic>

#include "graph/dds.hpp"
#include "graph_security/raw.hpp"
#include "graph_security/world.hpp"
#include "tools/keys/authority.hpp"

namespace cosegraph::graph::test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr const char* kClouds = "g/camera/dense";
constexpr const char* kStatus = "g/stage_status";
const Identity kCamera = Identity::of_stage("camera");
const Identity kGrow = Identity::of_stage("grow");

// A participant with a reader that counts what it gets.
struct Listener {
  Listener(const GraphDescription& graph, const Identity& identity, const char* topic = kClouds,
           const char* type = "Cloud")
      : participant(graph, "listener", identity),
        reader(participant.reader(topic, type, {}, [this](const Sample&) { ++samples; })) {}

  std::atomic<int> samples = 0;
  Participant participant;
  std::unique_ptr<Reader> reader;
};

struct Speaker {
  explicit Speaker(const GraphDescription& graph, const char* topic = kClouds,
                   const char* type = "Cloud", const Identity& identity = kCamera)
      : participant(graph, "speaker", identity), writer(participant.writer(topic, type, {})) {}

  void say() const {
    writer->write(idl::encode({.graph = "g"}, Cloud{.xyz = {1, 2, 3}, .width = 1}));
  }

  Participant participant;
  std::unique_ptr<Writer> writer;
};

TEST(SecureParticipants, MeetWithTheirKeys) {
  KeyWorld world;
  Listener early(world.graph(), kGrow);
  const Speaker speaker(world.graph());
  speaker.say();
  EXPECT_TRUE(comes_true([&] { return early.samples == 1; }));
  Listener late(world.graph(), Identity::observer());
  EXPECT_TRUE(comes_true([&] { return late.samples == 1; })) << "what was sent before it came";
}

TEST(SecureParticipants, ThatStartTogetherAllMeet) {
  KeyWorld world;
  std::vector<std::unique_ptr<Listener>> listeners;
  std::vector<std::unique_ptr<Speaker>> speakers;
  for (int i = 0; i < 5; ++i) {
    listeners.push_back(
        std::make_unique<Listener>(world.graph(), i % 2 ? kGrow : kCamera, kStatus, "StageStatus"));
    speakers.push_back(
        std::make_unique<Speaker>(world.graph(), kStatus, "StageStatus", i % 2 ? kGrow : kCamera));
  }
  EXPECT_TRUE(comes_true([&] {
    return std::ranges::all_of(listeners, [](const auto& l) { return l->reader->matched() == 5; });
  }));
}

TEST(SecureParticipants, DoNotMeetOneWithoutCertificate) {
  KeyWorld world;
  Listener outsider(world.without_keys(), kGrow);
  const Speaker strange(world.without_keys());  // they would meet: of this the next line assures
  ASSERT_TRUE(comes_true([&] { return outsider.reader->matched() == 1; }));
  const Speaker speaker(world.graph());
  Listener insider(world.graph(), kGrow);
  speaker.say();
  ASSERT_TRUE(comes_true([&] { return insider.samples == 1; }));
  EXPECT_EQ(outsider.reader->matched(), 1);
  EXPECT_EQ(outsider.samples, 0);
  EXPECT_EQ(insider.reader->matched(), 1);
  EXPECT_EQ(speaker.writer->matched(), 1);
}

TEST(SecureParticipants, DoNotMeetThoseOfAnotherAuthority) {
  KeyWorld world;
  world.issue_into("other", keys::from_now(1));
  Listener outsider(world.with_keys_in("other"), kGrow);
  const Speaker speaker(world.graph());
  speaker.say();
  Listener insider(world.graph(), kGrow);
  ASSERT_TRUE(comes_true([&] { return insider.samples == 1; }));
  const Speaker strange(world.with_keys_in("other"));
  ASSERT_TRUE(comes_true([&] { return outsider.reader->matched() == 1; }));
  EXPECT_EQ(outsider.samples, 0);
  EXPECT_EQ(speaker.writer->matched(), 1);
}

TEST(SecureParticipants, WithWrongKeysAreNotLetIn) {
  KeyWorld world;
  const std::time_t now = std::time(nullptr);
  world.issue_into("old", {now - 1000, now - 1});
  EXPECT_THROW(Participant(world.with_keys_in("old"), "x", kGrow), GraphError);
  EXPECT_FALSE(RawParticipant(world.graph(), key_files(world.with_keys_in("old"), kGrow)).joined());

  KeyFiles mixed = key_files(world.graph(), kGrow);
  mixed.permissions = key_files(world.graph(), kCamera).permissions;
  EXPECT_FALSE(RawParticipant(world.graph(), mixed).joined()) << "another stage's permissions";

  EXPECT_TRUE(RawParticipant(world.graph(), key_files(world.graph(), kGrow)).joined());
}

// The certificate is good when the participant starts, and no longer when it meets the others.
TEST(SecureParticipants, DoNotMeetOneWhoseCertificateHasExpired) {
  KeyWorld world;
  const auto move_keys = [&](const Validity& validity) {
    keys::issue(world.graph(), fake_catalog(), world.path("keys"), {"grow"}, validity);
  };
  const std::time_t end = std::time(nullptr) + 10;
  move_keys({end - 1000, end});
  Listener expiring(world.graph(), kGrow);
  ASSERT_TRUE(comes_true([&] { return std::time(nullptr) > end; }));
  move_keys(keys::from_now(1));
  const Speaker speaker(world.graph());
  speaker.say();
  Listener insider(world.graph(), kGrow);
  ASSERT_TRUE(comes_true([&] { return insider.samples == 1; }));
  EXPECT_EQ(expiring.reader->matched(), 0);
  EXPECT_EQ(expiring.samples, 0);
}

TEST(Permissions, AreKeptByTheParticipantItself) {
  KeyWorld world;
  Participant grow(world.graph(), "grow", kGrow);
  EXPECT_THROW(grow.writer(kClouds, "Cloud", {}), Error);
  EXPECT_THROW(grow.reader("g/camera/cloud", "Cloud", {}, [](const Sample&) {}), Error);
  EXPECT_NO_THROW(grow.writer("g/grow/supervoxels", "Supervoxels", {}));
  Participant observer(world.graph(), "observer");
  EXPECT_NO_THROW(observer.reader(kClouds, "Cloud", {}, [](const Sample&) {}));
  EXPECT_THROW(observer.writer(kClouds, "Cloud", {}), Error);
}

TEST(Permissions, AreForThePartitionsOfTheGraph) {
  KeyWorld world;
  GraphDescription run = world.graph();
  run.instance = "0123456789abcdef";
  EXPECT_NO_THROW(Listener(run, kGrow));
  run.graph = "other";
  run.instance.clear();
  Participant elsewhere(world.with_keys_in("keys"), "x", kGrow);
  EXPECT_THROW(Participant(run, "x", kGrow), GraphError) << "keys of another graph";
}

// A stage that goes wrong: with its own certificate and permissions, but a governance that lets it
// write anything, as if it had been built without the checks. The others have theirs.
TEST(Permissions, AreKeptByTheOthers) {
  KeyWorld world;
  std::string governance = governance_text(world.graph());
  const std::string rule = "<enable_write_access_control>true";
  ASSERT_NE(governance.find(rule), std::string::npos);
  governance.replace(governance.find(rule), rule.size(), "<enable_write_access_control>false");
  const keys::Credential authority{io::read_file(world.path("keys/permissions_ca.pem")),
                                   io::read_file(world.path("keys/ca/permissions_key.pem"))};
  io::write_file(world.path("governance.p7s"), keys::sign(authority, governance));
  KeyFiles files = key_files(world.graph(), kGrow);
  files.governance = world.path("governance.p7s");
  RawParticipant wrong(world.graph(), files);
  ASSERT_TRUE(wrong.joined());
  ASSERT_TRUE(wrong.open_writer(kClouds, "Cloud"));

  Listener insider(world.graph(), Identity::observer());
  const Speaker speaker(world.graph());
  speaker.say();
  ASSERT_TRUE(comes_true([&] { return insider.samples == 1; }));
  Listener later(world.graph(), kGrow);
  ASSERT_TRUE(comes_true([&] { return later.samples == 1; }));
  EXPECT_EQ(insider.reader->matched(), 1);
  EXPECT_EQ(later.reader->matched(), 1);
  EXPECT_EQ(wrong.readers(kClouds), 0);
}

}  // namespace
}  // namespace cosegraph::graph::test
