#include "tools/monitor/access.hpp"

#include <gmock/gmock.h>

#include "io/file.hpp"

namespace cosegraph::monitor {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

TEST(Loopback, Names) {
  for (const auto name : {"localhost", "LocalHost:80", "127.0.0.1", "127.0.0.1:8765", "127.1.2.3:1",
                          "[::1]", "[::1]:8765", "::1"})
    EXPECT_TRUE(is_loopback(name)) << name;
  for (const auto name :
       {"", "0.0.0.0", "10.0.0.1", "localhost.evil.example", "127.0.0.1.evil.example",
        "127.evil.a.b", "evil.example:8765", "[::2]", "[::1", "user@localhost"})
    EXPECT_FALSE(is_loopback(name)) << name;
}

TEST(Query, Values) {
  EXPECT_EQ(query_value("/?token=abc", "token"), "abc");
  EXPECT_EQ(query_value("/x?a=1&token=a%20%2f%zz&b", "token"), "a /%zz");
  EXPECT_EQ(query_value("/?mytoken=abc", "token"), "");
  EXPECT_EQ(query_value("/token=abc", "token"), "");
  EXPECT_EQ(query_value("/?token", "token"), "");
  EXPECT_EQ(query_value("/?&&=&token=%", "token"), "%");
}

TEST(Secrets, AreEqualOrNot) {
  EXPECT_TRUE(equal_secrets("word", "word"));
  EXPECT_FALSE(equal_secrets("word", "wore"));
  EXPECT_FALSE(equal_secrets("word", "wor"));
  EXPECT_FALSE(equal_secrets("word", "wordword"));
  EXPECT_FALSE(equal_secrets("word", ""));
}

TEST(Refusal, WithoutTokenOnlyThisMachineAndOurOwnPage) {
  const Access access;
  EXPECT_THAT(refusal(access, "localhost:8765", "", ""), IsEmpty());
  EXPECT_THAT(refusal(access, "localhost:8765", "http://localhost:8765", ""), IsEmpty());
  EXPECT_THAT(refusal(access, "evil.example:8765", "", ""), HasSubstr("localhost only"));
  EXPECT_THAT(refusal(access, "localhost:8765", "http://evil.example", ""), HasSubstr("--origin"));
  EXPECT_THAT(refusal(access, "localhost:8765", "http://localhost:80", ""), Not(IsEmpty()));
  EXPECT_THAT(refusal(access, "localhost:8765", "null", ""), Not(IsEmpty()));
  EXPECT_THAT(refusal(access, "", "", ""), Not(IsEmpty()));
}

TEST(Refusal, OriginsThatWereNamedMayConnect) {
  const Access access{.origins = {"https://app.example"}};
  EXPECT_THAT(refusal(access, "localhost:1", "https://app.example", ""), IsEmpty());
  EXPECT_THAT(refusal(access, "localhost:1", "https://app.example.evil", ""), Not(IsEmpty()));
}

TEST(Refusal, ATokenIsEnoughAndNeeded) {
  const Access access{.token = "word"};
  EXPECT_THAT(refusal(access, "robot:8765", "https://app.example", "word"), IsEmpty());
  EXPECT_THAT(refusal(access, "localhost:8765", "http://localhost:8765", ""), HasSubstr("token"));
  EXPECT_THAT(refusal(access, "localhost:8765", "", "Word"), HasSubstr("token"));
}

TEST(Page, FilesOfAPageOnly) {
  const io::TemporaryFolder folder;
  io::write_file(folder / "index.html", "<p>");
  io::write_file(folder / "app.js", "1");
  io::write_file(folder / "secret.key", "2");
  const auto page = load_page(folder.path());
  ASSERT_EQ(page.size(), 3U);
  EXPECT_EQ(page.at("/").bytes, "<p>");
  EXPECT_EQ(page.at("/index.html").type, "text/html; charset=utf-8");
  EXPECT_EQ(page.at("/app.js").type, "text/javascript; charset=utf-8");
}

TEST(Page, NoFolderNoFiles) {
  EXPECT_THAT(load_page("/nowhere/at/all"), IsEmpty());
}

}  // namespace
}  // namespace cosegraph::monitor
