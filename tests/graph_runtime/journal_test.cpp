#include "graph/journal.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>

#include "io/file.hpp"

namespace cosegraph::graph {
namespace {

TEST(Journal, KeepsTheNewestRecord) {
  const io::TemporaryFolder folder;
  {
    Journal journal(folder / "a");
    EXPECT_FALSE(journal.load());
    for (std::uint64_t i = 0; i < 5; ++i) journal.store({.working = true, .sequence = i});
  }
  const auto record = Journal(folder / "a").load();
  ASSERT_TRUE(record);
  EXPECT_EQ(record->sequence, 4U);
  EXPECT_TRUE(record->working);
}

// Every field of a record says the same number; a torn one would not.
JournalRecord uniform(std::uint64_t value) {
  JournalRecord record{.epoch = value, .sequence = value, .taken = value};
  record.account = {value, value, value, value, value};
  record.open.fill(value);
  return record;
}

TEST(Journal, OfAKilledProcessIsNeverTorn) {
  const io::TemporaryFolder folder;
  for (int round = 0; round < 40; ++round) {
    const pid_t child = ::fork();
    if (child == 0) {
      Journal journal(folder / "a");
      for (std::uint64_t i = 1;; ++i) journal.store(uniform(i));
    }
    ::usleep(static_cast<useconds_t>(1000 + 137 * round));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    const auto record = Journal(folder / "a").load();
    if (!record) continue;  // killed before its first record
    EXPECT_EQ(record->epoch, record->taken);
    EXPECT_EQ(record->account.admitted, record->epoch);
    EXPECT_EQ(record->account.dropped, record->epoch);
    for (const auto open : record->open) EXPECT_EQ(open, record->epoch);
  }
  EXPECT_TRUE(Journal(folder / "a").load());
}

TEST(Journal, ForeignContentIsNotTakenForARecord) {
  const io::TemporaryFolder folder;
  std::ofstream(folder / "a") << std::string(4096, 'x');
  EXPECT_FALSE(Journal(folder / "a").load());
}

TEST(Journal, FolderThatDoesNotExistIsNamed) {
  const io::TemporaryFolder folder;
  try {
    Journal journal(folder / "no/a");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("no/a: No such file"), std::string::npos);
  }
}

}  // namespace
}  // namespace cosegraph::graph
