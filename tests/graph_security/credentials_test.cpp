#include "graph/credentials.hpp"

#include <gmock/gmock.h>

#include "graph_security/world.hpp"
#include "tools/keys/authority.hpp"

namespace cosegraph::graph::test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr std::time_t kDay = 24 * 3600;
const Identity kGrow = Identity::of_stage("grow");

// What is said about the keys of `grow`.
std::string complaint(const GraphDescription& graph) {
  try {
    require_keys(graph, kGrow);
    return "";
  } catch (const GraphError& error) {
    EXPECT_THAT(error.what(), HasSubstr(graph.file + ":3:"));
    return error.what();
  }
}

void copy_over(const fs::path& from, const fs::path& to) {
  fs::copy_file(from, to, fs::copy_options::overwrite_existing);
}

TEST(Credentials, OfEveryIdentityAreFine) {
  KeyWorld world;
  for (const auto& identity : identities_of(world.graph()))
    EXPECT_NO_THROW(require_keys(world.graph(), identity)) << to_text(identity);
  EXPECT_NO_THROW(require_keys(world.without_keys(), kGrow));
}

TEST(Credentials, ThatHaveExpiredAreRefused) {
  KeyWorld world;
  const std::time_t now = std::time(nullptr);
  world.issue_into("old", {now - 10 * kDay, now - 1});
  EXPECT_THAT(complaint(world.with_keys_in("old")), HasSubstr("cert.pem has expired on "));
  world.issue_into("early", {now + kDay, now + 2 * kDay});
  EXPECT_THAT(complaint(world.with_keys_in("early")), HasSubstr("cert.pem"));
}

TEST(Credentials, OfAnotherAuthorityAreRefused) {
  KeyWorld world;
  world.issue_into("other", keys::from_now(1));
  copy_over(world.path("other/identity_ca.pem"), world.path("keys/identity_ca.pem"));
  EXPECT_THAT(complaint(world.graph()), HasSubstr("was not issued by the authority of"));
}

TEST(Credentials, OfAnotherStageAreRefused) {
  KeyWorld world;
  for (const char* file : {"cert.pem", "key.pem"})
    copy_over(world.path("keys/stages/camera") / file, world.path("keys/stages/grow") / file);
  EXPECT_THAT(complaint(world.graph()),
              HasSubstr("is the certificate of CN=stage.camera,O=g, not of CN=stage.grow,O=g"));
}

TEST(Credentials, WithAnotherKeyAreRefused) {
  KeyWorld world;
  copy_over(world.path("keys/observer/key.pem"), world.path("keys/stages/grow/key.pem"));
  EXPECT_THAT(complaint(world.graph()), HasSubstr("does not belong to"));
}

TEST(Permissions, OfAnotherStageAreRefused) {
  KeyWorld world;
  copy_over(world.path("keys/stages/camera/permissions.p7s"),
            world.path("keys/stages/grow/permissions.p7s"));
  EXPECT_THAT(complaint(world.graph()), HasSubstr("holds no permissions of CN=stage.grow,O=g"));
}

TEST(Permissions, ThatWereChangedAreRefused) {
  KeyWorld world;
  const fs::path file = world.path("keys/stages/grow/permissions.p7s");
  std::string text = io::read_file(file);
  text.replace(text.find("g/grow/supervoxels"), 18, "g/camera/dense____");
  io::write_file(file, text);
  EXPECT_THAT(complaint(world.graph()), HasSubstr("is not signed by the authority of"));
}

// Why there are two authorities: every stage has a certificate by that for identities.
TEST(Permissions, ThatAStageSignsForItselfAreRefused) {
  KeyWorld world;
  const fs::path own = world.path("keys/stages/grow");
  const keys::Credential stage{io::read_file(own / "cert.pem"), io::read_file(own / "key.pem")};
  io::write_file(
      own / "permissions.p7s",
      keys::sign(stage, permissions_text(world.graph(), fake_catalog(), kGrow, keys::from_now(1))));
  EXPECT_THAT(complaint(world.graph()), HasSubstr("is not signed by the authority of"));
}

TEST(Credentials, ThatAreGarbageAreRefused) {
  for (const char* file :
       {"identity_ca.pem", "permissions_ca.pem", "governance.p7s", "stages/grow/cert.pem",
        "stages/grow/key.pem", "stages/grow/permissions.p7s"}) {
    KeyWorld world;
    for (const std::string text : {"", "-----BEGIN CERTIFICATE-----\nAAAA\n"}) {
      io::write_file(world.path("keys") / file, text, 0600);
      EXPECT_THAT(complaint(world.graph()), HasSubstr(file)) << file;
    }
  }
}

}  // namespace
}  // namespace cosegraph::graph::test
