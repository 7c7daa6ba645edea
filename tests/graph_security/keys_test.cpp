// What `cosegraph keys` makes, and what the check of a graph says about it.
#include <gmock/gmock.h>
#include <sys/stat.h>

#include "graph_security/world.hpp"

namespace cosegraph::graph::test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

unsigned mode_of(const fs::path& path) {
  struct stat status {};
  EXPECT_EQ(::stat(path.c_str(), &status), 0) << path;
  return status.st_mode & 0777U;
}

// The faults of the keys, without the path of their folder.
std::vector<std::string> faults(KeyWorld& world) {
  std::vector<std::string> result;
  const std::string folder = world.path("keys").string();
  for (const auto& fault : check_keys(world.graph(), fake_catalog())) {
    EXPECT_EQ(fault.file, world.graph().file);
    EXPECT_EQ(fault.mark.line, 3);
    std::string text = fault.message;
    for (auto at = text.find(folder); at != std::string::npos; at = text.find(folder))
      text.replace(at, folder.size(), "KEYS");
    result.push_back(text);
  }
  return result;
}

std::vector<std::string> files_in(const fs::path& folder) {
  std::vector<std::string> result;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) result.push_back(entry.path().lexically_relative(folder).string());
  std::ranges::sort(result);
  return result;
}

TEST(Keys, HaveTheirLayout) {
  KeyWorld world;
  EXPECT_THAT(
      files_in(world.path("keys")),
      ElementsAre("agent/cert.pem", "agent/key.pem", "agent/permissions.p7s", "ca/identity_key.pem",
                  "ca/permissions_key.pem", "governance.p7s", "identity_ca.pem",
                  "observer/cert.pem", "observer/key.pem", "observer/permissions.p7s",
                  "permissions_ca.pem", "stages/camera/cert.pem", "stages/camera/key.pem",
                  "stages/camera/permissions.p7s", "stages/grow/cert.pem", "stages/grow/key.pem",
                  "stages/grow/permissions.p7s"));
}

TEST(Keys, AreForTheirOwnerOnly) {
  const mode_t before = ::umask(0);
  KeyWorld world;
  keys::issue(world.graph(), fake_catalog(), world.path("keys"), {"grow"}, keys::from_now(1));
  ::umask(before);
  for (const auto& file : files_in(world.path("keys"))) {
    const bool secret = file.ends_with("key.pem");
    EXPECT_EQ(mode_of(world.path("keys") / file), secret ? 0600U : 0666U) << file;
    EXPECT_EQ(io::read_file(world.path("keys") / file).find("PRIVATE KEY") != std::string::npos,
              secret)
        << file;
  }
  for (const char* folder : {"keys", "keys/ca", "keys/stages", "keys/stages/grow"})
    EXPECT_EQ(mode_of(world.path(folder)), 0700U) << folder;
}

TEST(Keys, SatisfyTheCheck) {
  KeyWorld world;
  EXPECT_THAT(faults(world), IsEmpty());
  EXPECT_NO_THROW(load(world.path("graph.yaml"), fake_catalog()));
}

TEST(Keys, AreNeverOverwrittenByInit) {
  KeyWorld world;
  const std::string before = io::read_file(world.path("keys/ca/identity_key.pem"));
  EXPECT_THROW(world.issue_into("keys", keys::from_now(1)), InputError);
  EXPECT_EQ(io::read_file(world.path("keys/ca/identity_key.pem")), before);
  fs::create_directory(world.path("other"));
  io::write_file(world.path("other/thing"), "mine");
  EXPECT_THROW(world.issue_into("other", keys::from_now(1)), InputError);
  EXPECT_THAT(files_in(world.path("other")), ElementsAre("thing"));
}

TEST(Keys, ThatCannotBeMadeLeaveNothingBehind) {
  KeyWorld world;
  world.graph().stages[1].name = std::string(70, 'w');
  EXPECT_THROW(world.issue_into("new", keys::from_now(1)), InputError);
  for (const auto& entry : fs::directory_iterator(world.path("")))
    EXPECT_THAT(entry.path().filename().string(), testing::AnyOf("graph.yaml", "keys"));
}

TEST(Keys, AreIssuedAnewForOneStage) {
  KeyWorld world;
  std::map<std::string, std::string> before;
  for (const auto& file : files_in(world.path("keys")))
    before[file] = io::read_file(world.path("keys") / file);
  EXPECT_THAT(
      keys::issue(world.graph(), fake_catalog(), world.path("keys"), {"grow"}, keys::from_now(1)),
      ElementsAre("stage 'grow'"));
  EXPECT_EQ(files_in(world.path("keys")).size(), before.size());
  for (const auto& [file, bytes] : before) {
    const bool renewed = file.starts_with("stages/grow/") || file == "governance.p7s";
    EXPECT_EQ(io::read_file(world.path("keys") / file) != bytes, renewed) << file;
  }
  EXPECT_THAT(faults(world), IsEmpty());
}

TEST(Keys, AreIssuedForKnownNamesWhereTheAuthoritiesAre) {
  KeyWorld world;
  const auto issue = [&](const char* name) {
    keys::issue(world.graph(), fake_catalog(), world.path("keys"), {name}, keys::from_now(1));
  };
  EXPECT_THROW(
      try { issue("gorw"); } catch (const ParameterError& error) {
        EXPECT_THAT(error.what(), HasSubstr("did you mean 'grow'?"));
        throw;
      },
      ParameterError);
  EXPECT_NO_THROW(issue("observer"));
  fs::remove_all(world.path("keys/ca"));
  EXPECT_THROW(issue("grow"), InputError);
  EXPECT_THAT(faults(world), IsEmpty()) << "the authorities' keys are not needed to run";
}

TEST(Keys, HaveATerm) {
  EXPECT_EQ(keys::from_now(30).until - keys::from_now(10).until, 20 * 24 * 3600);
  EXPECT_THROW(keys::from_now(0), ParameterError);
  EXPECT_THROW(keys::from_now(3651), ParameterError);
}

TEST(KeyCheck, NamesTheFolderThatIsNotThere) {
  KeyWorld world;
  fs::remove_all(world.path("keys"));
  EXPECT_THAT(faults(world), ElementsAre("security: there is no folder KEYS; 'cosegraph keys init'"
                                         " makes it"));
}

TEST(KeyCheck, RefusesADiscoveryServer) {
  KeyWorld world;
  world.graph().dds.discovery = Discovery::server;
  world.graph().dds.server = "10.0.0.1:11811";
  EXPECT_THAT(faults(world),
              ElementsAre("security: a discovery server has no keys, so nobody would "
                          "be found; use multicast or peers"));
}

TEST(KeyCheck, NamesEveryFault) {
  KeyWorld world;
  fs::remove(world.path("keys/identity_ca.pem"));
  fs::remove_all(world.path("keys/observer"));
  fs::remove(world.path("keys/stages/camera/key.pem"));
  ::chmod(world.path("keys/stages/grow/key.pem").c_str(), 0640);
  EXPECT_THAT(faults(world),
              ElementsAre("security: there is no KEYS/identity_ca.pem",
                          "security: there is no KEYS/stages/camera/key.pem",
                          "security: KEYS/stages/grow/key.pem may be read by others; chmod 600 it",
                          "security: observer has no keys in KEYS; 'cosegraph keys issue' makes"
                          " them"));
}

TEST(KeyCheck, SeesThatTheGraphHasChanged) {
  KeyWorld world;
  world.write_graph("{cloud: camera/cloud}");
  EXPECT_THAT(faults(world), ElementsAre("security: KEYS/stages/grow/permissions.p7s is not for "
                                         "this graph as it is now; issue it again with 'cosegraph "
                                         "keys issue'"));
  keys::issue(world.graph(), fake_catalog(), world.path("keys"), {}, keys::from_now(1));
  EXPECT_THAT(faults(world), IsEmpty());
  world.graph().dds.domain = (world.graph().dds.domain + 1) % 230;
  EXPECT_EQ(faults(world).size(), 5U) << "governance, two stages, observer, agent";
}

TEST(KeyCheck, RefusesPermissionsThatOtherHostsWouldNotGet) {
  KeyWorld world;
  world.graph().hosts = {{.name = "here", .address = "127.0.0.1"},
                         {.name = "there", .address = "10.0.0.2"}};
  for (auto& stage : world.graph().stages) stage.host = "here";
  std::string permissions = io::read_file(world.path("keys/stages/grow/permissions.p7s"));
  EXPECT_THAT(faults(world), IsEmpty());
  io::write_file(world.path("keys/stages/grow/permissions.p7s"),
                 permissions + std::string(4000, '\n'));
  EXPECT_THAT(faults(world), ElementsAre(testing::HasSubstr("by which it can prove itself")));
  world.graph().hosts.clear();
  EXPECT_THAT(faults(world), IsEmpty());
}

TEST(KeyCheck, AsksOnlyForWhatRunsHere) {
  KeyWorld world;
  world.graph().hosts = {{.name = "here", .address = "127.0.0.1"},
                         {.name = "there", .address = "10.0.0.2"}};
  world.graph().stages[0].host = "there";
  world.graph().stages[1].host = "here";
  fs::remove_all(world.path("keys/stages/camera"));
  EXPECT_THAT(faults(world), IsEmpty());
  world.graph().stages[0].host = "here";
  EXPECT_EQ(faults(world).size(), 1U);
}

TEST(KeyCheck, IsPartOfTheCheckOfAGraph) {
  KeyWorld world;
  fs::remove(world.path("keys/stages/grow/cert.pem"));
  try {
    load(world.path("graph.yaml"), fake_catalog());
    FAIL();
  } catch (const GraphError& error) {
    EXPECT_THAT(error.what(), HasSubstr("graph.yaml:3:"));
    EXPECT_THAT(error.what(), HasSubstr("stages/grow/cert.pem"));
  }
}

TEST(KeyFolder, IsRelativeToTheGraphFile) {
  KeyWorld world;
  world.graph().dds.security = "keys";
  EXPECT_EQ(key_files(world.graph(), Identity::observer()).key,
            world.path("keys/observer/key.pem"));
  const GraphDescription loaded = load(world.path("graph.yaml"), fake_catalog());
  EXPECT_EQ(loaded.dds.security, world.path("keys").string());
  std::vector<Fault> faults;
  EXPECT_EQ(parse(to_yaml(loaded), "elsewhere/graph.yaml", faults).dds.security,
            loaded.dds.security);
}

}  // namespace
}  // namespace cosegraph::graph::test
