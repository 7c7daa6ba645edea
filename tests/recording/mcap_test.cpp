// The writer and the reader against each other, and the reader against files that are cut off,
// damaged or made to hurt. That the files are MCAP files is for independent_reader_test to say.
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <zstd.h>

#include <csignal>
#include <fstream>
#include <iterator>
#include <random>

#include "core/error.hpp"
#include "io/file.hpp"
#include "tools/recording/mcap_reader.hpp"
#include "tools/recording/mcap_records.hpp"
#include "tools/recording/mcap_writer.hpp"

namespace cosegraph::recording {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

// A message with data of its own.
struct Kept {
  std::uint16_t channel = 0;
  std::uint32_t sequence = 0;
  std::uint64_t time = 0;
  Bytes data;

  bool operator==(const Kept&) const = default;
};

Message view_of(const Kept& message) {
  return {.channel = message.channel,
          .sequence = message.sequence,
          .log_time = message.time,
          .publish_time = message.time,
          .data = message.data};
}

std::vector<Kept> all_of(McapReader::Messages messages) {
  std::vector<Kept> result;
  while (const auto message = messages.next())
    result.push_back({message->channel, message->sequence, message->log_time,
                      Bytes(message->data.begin(), message->data.end())});
  return result;
}

void write_bytes(const std::filesystem::path& file, std::span<const std::uint8_t> bytes) {
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

Bytes read_bytes(const std::filesystem::path& file) {
  const std::string text = io::read_file(file);
  return {text.begin(), text.end()};
}

class Mcap : public testing::Test {
 protected:
  std::filesystem::path file() const { return folder_ / "test.mcap"; }

  // 6 messages in 3 chunks, an attachment in front and metadata at the end.
  std::vector<Kept> write_small_file() const {
    McapWriter writer(file());
    writer.attach({.log_time = 5, .name = "graph.yaml", .media_type = "text/yaml", .data = "g: 1"});
    const auto schema = writer.add_schema("T", "omgidl", "struct T {};");
    const auto a = writer.add_channel("a", schema, "cdr", {{"stage", "x"}});
    const auto b = writer.add_channel("b", 0, "json");
    std::vector<Kept> messages;
    for (std::uint32_t i = 0; i < 6; ++i) {
      messages.push_back(
          {i % 2 == 0 ? a : b, i, 100 + 10 * i, Bytes(i, static_cast<std::uint8_t>(i))});
      writer.write(view_of(messages.back()));
      if (i % 2 == 1) writer.flush();
    }
    writer.add({.name = "notes", .values = {{"k", "v"}, {"", "empty key"}}});
    writer.close();
    return messages;
  }

  std::string opening_error() const {
    try {
      const McapReader reader(file());
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  const io::TemporaryFolder folder_;
};

TEST_F(Mcap, WhatIsWrittenIsRead) {
  const std::vector<Kept> messages = write_small_file();
  const McapReader reader(file());
  EXPECT_EQ(reader.damage(), "");
  EXPECT_EQ(reader.library(), "cosegraph");
  ASSERT_THAT(reader.schemas(), SizeIs(1));
  EXPECT_EQ(reader.schemas().at(1), (Schema{1, "T", "omgidl", "struct T {};"}));
  ASSERT_THAT(reader.channels(), SizeIs(2));
  EXPECT_EQ(reader.channels().at(1), (Channel{1, 1, "a", "cdr", {{"stage", "x"}}}));
  EXPECT_EQ(reader.channels().at(2), (Channel{2, 0, "b", "json", {}}));
  EXPECT_EQ(all_of(reader.messages()), messages);
  EXPECT_EQ(reader.attachment("graph.yaml").value().data, "g: 1");
  EXPECT_FALSE(reader.attachment("other").has_value());
  EXPECT_EQ(reader.metadata("notes").value().values.at("k"), "v");
  const Statistics& statistics = reader.statistics();
  EXPECT_EQ(statistics.messages, 6U);
  EXPECT_EQ(statistics.chunks, 3U);
  EXPECT_EQ(statistics.start_time, 100U);
  EXPECT_EQ(statistics.end_time, 150U);
  EXPECT_EQ(statistics.channel_messages.at(2), 3U);
}

TEST_F(Mcap, FileWithoutMessagesIsWhole) {
  {
    McapWriter writer(file());
    writer.close();
  }
  const McapReader reader(file());
  EXPECT_EQ(reader.damage(), "");
  EXPECT_THAT(all_of(reader.messages()), testing::IsEmpty());
}

TEST_F(Mcap, NothingIsOverwritten) {
  write_small_file();
  const Bytes before = read_bytes(file());
  EXPECT_THROW(McapWriter{file()}, InputError);
  EXPECT_EQ(read_bytes(file()), before);
}

TEST_F(Mcap, SelectionByTimeIsFromInclusiveToExclusive) {
  const std::vector<Kept> messages = write_small_file();
  const McapReader reader(file());
  EXPECT_THAT(all_of(reader.messages({.from = 110, .to = 140})),
              ElementsAre(messages[1], messages[2], messages[3]));
  EXPECT_THAT(all_of(reader.messages({.from = 151})), SizeIs(0));
  EXPECT_THAT(all_of(reader.messages({.to = 100})), SizeIs(0));
  EXPECT_THAT(all_of(reader.messages({.from = 111, .channels = {{2}}})),
              ElementsAre(messages[3], messages[5]));
}

TEST_F(Mcap, LaterMessagesAreFoundWithoutTheEarlierChunks) {
  const std::vector<Kept> messages = write_small_file();
  Bytes bytes = read_bytes(file());
  const std::uint64_t first_chunk = McapReader(file()).chunks()[0].offset;
  bytes[first_chunk + 60] ^= 0xff;
  write_bytes(file(), bytes);
  const McapReader reader(file());
  EXPECT_THAT(all_of(reader.messages({.from = 120})), SizeIs(4));
}

TEST_F(Mcap, DamagedChunkIsToldWithItsPlaceAndPassedOver) {
  const std::vector<Kept> messages = write_small_file();
  Bytes bytes = read_bytes(file());
  const ChunkIndex chunk = McapReader(file()).chunks()[1];
  bytes[chunk.offset + chunk.length - 1] ^= 0xff;
  write_bytes(file(), bytes);
  const McapReader reader(file());
  auto stream = reader.messages();
  ASSERT_TRUE(stream.next().has_value());
  ASSERT_TRUE(stream.next().has_value());
  try {
    stream.next();
    FAIL() << "read";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr(file().string() + ": offset " + std::to_string(chunk.offset)));
  }
  EXPECT_THAT(all_of(std::move(stream)), ElementsAre(messages[4], messages[5]));
}

// Whether `part` is `all` with some left out.
bool is_subsequence(const std::vector<Kept>& part, const std::vector<Kept>& all) {
  auto at = all.begin();
  for (const auto& message : part) {
    at = std::find(at, all.end(), message);
    if (at == all.end()) return false;
    ++at;
  }
  return true;
}

TEST_F(Mcap, FileCutOffAnywhereHoldsItsWholeChunks) {
  const std::vector<Kept> messages = write_small_file();
  const Bytes bytes = read_bytes(file());
  std::vector<std::uint64_t> ends;
  const std::vector<ChunkIndex> chunks = McapReader(file()).chunks();
  for (const auto& chunk : chunks) ends.push_back(chunk.offset + chunk.length);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    write_bytes(file(), std::span(bytes).first(size));
    if (size < 8) {
      EXPECT_THAT(opening_error(), HasSubstr("test.mcap: is not an MCAP file"));
      continue;
    }
    const McapReader reader(file());
    EXPECT_NE(reader.damage(), "") << size;
    const auto whole = static_cast<std::size_t>(
        std::ranges::count_if(ends, [&](std::uint64_t end) { return end <= size; }));
    const std::vector<Kept> expected(messages.begin(),
                                     messages.begin() + 2 * static_cast<long>(whole));
    ASSERT_EQ(all_of(reader.messages()), expected) << size;
    EXPECT_EQ(reader.statistics().messages, expected.size());
  }
}

TEST_F(Mcap, NoDamagedByteMakesUpMessages) {
  const std::vector<Kept> messages = write_small_file();
  const Bytes bytes = read_bytes(file());
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (const int flip : {0x01, 0x80, 0xff}) {
      Bytes damaged = bytes;
      damaged[i] ^= static_cast<std::uint8_t>(flip);
      write_bytes(file(), damaged);
      try {
        const McapReader reader(file());
        reader.attachment("graph.yaml");
        reader.metadata("notes");
        ASSERT_TRUE(is_subsequence(all_of(reader.messages()), messages)) << i;
      } catch (const InputError& error) {
        ASSERT_THAT(error.what(), HasSubstr("test.mcap")) << i;
      }
    }
  }
}

TEST_F(Mcap, ZerosAfterTheDataAreNoRecords) {
  write_small_file();
  Bytes bytes = read_bytes(file());
  const ChunkIndex last = McapReader(file()).chunks()[2];
  bytes.resize(last.offset + last.length);
  bytes.resize(bytes.size() + 5000);
  write_bytes(file(), bytes);
  const McapReader reader(file());
  EXPECT_THAT(reader.damage(), HasSubstr("offset " + std::to_string(last.offset + last.length)));
  EXPECT_THAT(all_of(reader.messages()), SizeIs(6));
}

TEST_F(Mcap, WhatAWriterLeavesBehindWhenKilledIsReadable) {
  McapWriter writer(file());
  const auto channel = writer.add_channel("a", 0, "cdr");
  writer.write(view_of({channel, 1, 1, {1}}));
  writer.flush();
  writer.write(view_of({channel, 2, 2, {2}}));
  const McapReader reader(file());
  EXPECT_THAT(all_of(reader.messages()), SizeIs(1));
  EXPECT_THAT(reader.damage(), HasSubstr("cut off"));
}

// -- files made to hurt --------------------------------------------------------------------------

// A file with one chunk as given.
void write_hostile(const std::filesystem::path& file, const ChunkHead& head,
                   std::span<const std::uint8_t> packed) {
  Bytes bytes(std::begin(kMagic), std::end(kMagic));
  append(bytes, Header{});
  append(bytes, head);
  bytes.insert(bytes.end(), packed.begin(), packed.end());
  write_bytes(file, bytes);
}

Bytes zeros_packed(std::size_t count) {
  const Bytes zeros(count);
  Bytes packed(ZSTD_compressBound(count));
  packed.resize(ZSTD_compress(packed.data(), packed.size(), zeros.data(), zeros.size(), 3));
  return packed;
}

TEST_F(Mcap, RecordsLongerThanTheFileAreNotBelieved) {
  for (const std::uint64_t length :
       {std::uint64_t{1000}, std::uint64_t{1} << 40U, std::uint64_t{1} << 63U}) {
    write_hostile(file(), {.compressed_size = length}, {});
    EXPECT_THAT(McapReader(file()).damage(), HasSubstr("cut off"));
  }
  // The length of the record itself wraps around.
  write_hostile(file(), {.compressed_size = ~std::uint64_t{0}}, {});
  EXPECT_THAT(McapReader(file()).damage(), HasSubstr("shorter than what it claims"));
}

TEST_F(Mcap, HugeRecordsOfASparseFileAreNotBelieved) {
  write_hostile(file(), {.compressed_size = std::uint64_t{1} << 41U}, {});
  std::filesystem::resize_file(file(), std::uint64_t{1} << 42U);
  EXPECT_THAT(McapReader(file()).damage(), HasSubstr("a record claims"));
}

TEST_F(Mcap, ChunksThatUnpackToMoreThanTheyClaimAreRefused) {
  const Bytes packed = zeros_packed(200'000'000);
  write_hostile(file(),
                {.uncompressed_size = 100, .compression = "zstd", .compressed_size = packed.size()},
                packed);
  EXPECT_THAT(McapReader(file()).damage(), HasSubstr("does not hold what it claims"));
}

TEST_F(Mcap, ChunksThatClaimMoreThanTheyHoldAreRefused) {
  const Bytes packed = zeros_packed(1000);
  write_hostile(file(),
                {.uncompressed_size = kLargestRecord,
                 .compression = "zstd",
                 .compressed_size = packed.size()},
                packed);
  EXPECT_THAT(McapReader(file()).damage(), HasSubstr("does not hold what it claims"));
  write_hostile(file(),
                {.uncompressed_size = kLargestRecord + 1,
                 .compression = "zstd",
                 .compressed_size = packed.size()},
                packed);
  EXPECT_THAT(McapReader(file()).damage(), HasSubstr("claims to unpack to"));
}

TEST_F(Mcap, OtherCompressionsAreRefusedByName) {
  write_hostile(file(), {.compression = "lz4"}, {});
  EXPECT_THAT(McapReader(file()).damage(), HasSubstr("compression 'lz4' is not supported"));
}

TEST_F(Mcap, OtherFilesAreNoMcapFiles) {
  io::write_file(file(), "# some text that is long enough to be taken for a file of records\n");
  EXPECT_THAT(opening_error(), HasSubstr("is not an MCAP file"));
  std::filesystem::remove(file());
  EXPECT_THAT(opening_error(), HasSubstr("No such file"));
  std::filesystem::create_directory(file());
  EXPECT_THAT(opening_error(), HasSubstr("is not a plain file"));
}

// -- the writer ----------------------------------------------------------------------------------

// Files of this process cannot grow beyond a size while one lives.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t size) {
    std::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{size, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, SIG_DFL);
  }

 private:
  rlimit before_{};
};

TEST_F(Mcap, DiskThatTakesNoMoreIsToldByNameAndWhatIsThereIsReadable) {
  std::mt19937 random(1);
  McapWriter writer(file(), {.chunk_size = 5000});
  const auto channel = writer.add_channel("a", 0, "cdr");
  const auto write_one = [&](std::uint32_t i) {
    Bytes noise(1000);
    for (auto& byte : noise) byte = static_cast<std::uint8_t>(random());
    writer.write(view_of({channel, i, i, noise}));
  };
  std::uint32_t written = 0;
  {
    const FileSizeLimit limit(20'000);
    try {
      for (; written < 100; ++written) write_one(written);
      FAIL() << "everything fitted";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(file().string() + ": cannot write: File too large"));
    }
  }
  EXPECT_THROW(writer.close(), InputError) << "a file with a hole is not closed as a whole one";
  const McapReader reader(file());
  EXPECT_THAT(reader.damage(), HasSubstr("cut off"));
  EXPECT_THAT(all_of(reader.messages()), SizeIs(15));
}

TEST_F(Mcap, UnknownChannelsAreRefused) {
  McapWriter writer(file());
  EXPECT_THROW(writer.write({.channel = 1}), Error);
  EXPECT_THROW(writer.add_channel("a", 1, "cdr"), Error);
}

TEST_F(Mcap, LargeMessagesGetAChunkOfTheirOwnSize) {
  std::vector<Kept> messages;
  McapWriter writer(file(), {.chunk_size = 1000});
  const auto channel = writer.add_channel("a", 0, "cdr");
  for (std::uint32_t i = 0; i < 3; ++i) {
    messages.push_back({channel, i, i, Bytes(3'000'000, static_cast<std::uint8_t>(i))});
    writer.write(view_of(messages.back()));
  }
  writer.close();
  EXPECT_EQ(all_of(McapReader(file()).messages()), messages);
}

TEST_F(Mcap, ManyChannelsAndManyMessages) {
  constexpr std::uint32_t kChannels = 700;
  constexpr std::uint32_t kMessages = 200'000;
  McapWriter writer(file());
  for (std::uint32_t i = 0; i < kChannels; ++i)
    writer.add_channel("topic " + std::to_string(i), 0, "cdr");
  for (std::uint32_t i = 0; i < kMessages; ++i)
    writer.write(
        {.channel = static_cast<std::uint16_t>(1 + i % kChannels), .sequence = i, .log_time = i});
  writer.close();
  const McapReader reader(file());
  EXPECT_THAT(reader.channels(), SizeIs(kChannels));
  EXPECT_EQ(reader.statistics().messages, kMessages);
  std::uint32_t count = 0;
  for (auto stream = reader.messages(); const auto message = stream.next(); ++count)
    ASSERT_EQ(message->sequence, count);
  EXPECT_EQ(count, kMessages);
}

// Whatever is written, in whatever pieces, comes back by any selection, from a file that was closed
// as from one that was not.
TEST_F(Mcap, RandomFilesComeBackBySelections) {
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    std::mt19937 random(seed);
    const auto below = [&](std::uint64_t n) { return random() % n; };
    std::filesystem::remove(file());
    auto writer = std::make_unique<McapWriter>(
        file(), WriterOptions{.chunk_size = 1 + below(3000),
                              .compressed = below(2) == 0,
                              .compression_level = 1 + static_cast<int>(below(5))});
    std::vector<std::uint16_t> channels{writer->add_channel("0", 0, "cdr")};
    std::vector<Kept> messages;
    std::uint64_t time = 1'000;
    for (std::uint64_t i = below(200); i > 0; --i) {
      if (below(10) == 0)
        channels.push_back(writer->add_channel(std::to_string(channels.size()), 0, "cdr"));
      if (below(20) == 0) writer->flush();
      if (below(20) == 0) writer->add({.name = "m", .values = {{"i", std::to_string(i)}}});
      if (below(20) == 0) writer->attach({.name = "a", .data = std::string(below(500), 'x')});
      time += below(3);
      messages.push_back({channels[below(channels.size())], static_cast<std::uint32_t>(i), time,
                          Bytes(below(400), static_cast<std::uint8_t>(random()))});
      writer->write(view_of(messages.back()));
    }
    if (below(2) == 0)
      writer->close();
    else
      writer->flush();
    writer.reset();

    const McapReader reader(file());
    for (int k = 0; k < 10; ++k) {
      Selection wanted{.from = 995 + below(200), .to = 1000 + below(300)};
      if (below(2) == 0) wanted.channels = {channels[below(channels.size())]};
      std::vector<Kept> expected;
      for (const auto& message : messages)
        if (message.time >= wanted.from && message.time < wanted.to &&
            (!wanted.channels || wanted.channels->contains(message.channel)))
          expected.push_back(message);
      ASSERT_EQ(all_of(reader.messages(wanted)), expected) << "seed " << seed;
    }
  }
}

}  // namespace
}  // namespace cosegraph::recording
