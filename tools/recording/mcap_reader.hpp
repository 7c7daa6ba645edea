// Reads MCAP files, whole or cut off.
//
// A file with a sound summary is opened by it alone. One without (its writer was killed, its disk
// was full) is walked through from the start, and holds what comes before the first damage: every
// whole chunk. Nothing that a file claims is believed before it was held against the file's size,
// and no record is larger than kLargestRecord.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tools/recording/mcap.hpp"

namespace cosegraph::recording {

struct Selection {
  std::uint64_t from = 0;                                        // log time, inclusive
  std::uint64_t to = std::numeric_limits<std::uint64_t>::max();  // exclusive
  std::optional<std::set<std::uint16_t>> channels;               // none: all
};

class McapReader {
 public:
  // Throws InputError naming the file if it cannot be read or is no MCAP file.
  explicit McapReader(std::filesystem::path file);
  ~McapReader();
  McapReader(const McapReader&) = delete;
  McapReader& operator=(const McapReader&) = delete;

  const std::filesystem::path& file() const { return file_; }
  std::uint64_t size() const;
  // What is wrong with the file as a whole, as "offset N: ..."; empty if it is as it was closed.
  const std::string& damage() const { return damage_; }

  const std::string& library() const { return library_; }  // that wrote the file
  const std::map<std::uint16_t, Schema>& schemas() const { return schemas_; }
  const std::map<std::uint16_t, Channel>& channels() const { return channels_; }
  const std::vector<ChunkIndex>& chunks() const { return chunks_; }  // by time
  const std::vector<AttachmentIndex>& attachments() const { return attachments_; }
  const std::vector<MetadataIndex>& metadata() const { return metadata_; }
  const Statistics& statistics() const { return statistics_; }

  // The newest of this name. Throw InputError with the offset if it is damaged.
  std::optional<Attachment> attachment(std::string_view name) const;
  std::optional<Metadata> metadata(std::string_view name) const;

  // Hands out the messages of a selection one by one: chunks by their start, within a chunk in the
  // order of the file. In files of McapWriter that is the order in which they were written.
  class Messages {
   public:
    Messages(Messages&&) = default;

    // The next one, or none at the end; its data is good until the next call. Throws InputError
    // with the offset of the chunk if it is damaged; the call after that goes on behind it.
    std::optional<Message> next();

   private:
    friend class McapReader;
    Messages(const McapReader& reader, Selection selection);
    bool open_chunk();

    const McapReader* reader_;
    Selection selection_;
    std::vector<const ChunkIndex*> chunks_;
    std::size_t next_chunk_ = 0;
    Bytes records_;
    std::span<const std::uint8_t> rest_;
    std::uint64_t offset_ = 0;  // of the chunk at work
  };
  // The reader must outlive it.
  Messages messages(Selection selection = {}) const { return {*this, std::move(selection)}; }

 private:
  class File;

  bool read_summary();
  void add_from_summary(std::uint8_t op, std::span<const std::uint8_t> content);
  void scan();
  bool scan_record(std::uint64_t offset, std::uint8_t op, std::span<const std::uint8_t> content);
  void scan_chunk(std::uint64_t offset, std::span<const std::uint8_t> content);
  void add_schema(Schema schema);
  void add_channel(Channel channel);

  std::filesystem::path file_;
  std::unique_ptr<const File> bytes_;
  std::string damage_;
  std::string library_;
  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, Channel> channels_;
  std::vector<ChunkIndex> chunks_;
  std::vector<AttachmentIndex> attachments_;
  std::vector<MetadataIndex> metadata_;
  Statistics statistics_;
};

}  // namespace cosegraph::recording
