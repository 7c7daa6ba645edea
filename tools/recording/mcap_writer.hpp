// Writes MCAP files: chunks, compressed with zstd or not, with checksums, indexes and a summary.
//
// What has been written is readable whatever happens to the writer afterwards: a file without its
// end holds everything up to its last whole chunk.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tools/recording/mcap.hpp"

namespace cosegraph::recording {

struct WriterOptions {
  std::size_t chunk_size = 1U << 20U;  // bytes before compression at which a chunk is ended
  bool compressed = true;
  int compression_level = -20;  // of zstd
};

// Every member throws InputError, naming the file, if the disk takes no more; from then on all but
// the destructor do. Memory: a chunk, its compressed form, and about 100 bytes per chunk written.
class McapWriter {
 public:
  // Throws InputError if the file exists: recordings are not overwritten.
  explicit McapWriter(std::filesystem::path file, const WriterOptions& options = {});
  // Leaves the file as it is; without close() it looks like one that was cut off.
  ~McapWriter();
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  std::uint16_t add_schema(std::string name, std::string encoding, std::string data);
  std::uint16_t add_channel(std::string topic, std::uint16_t schema, std::string encoding,
                            Texts metadata = {});

  // Throws Error for a channel that was not added, or a message that no chunk can hold.
  void write(const Message& message);
  // Ends the chunk, so that what was written survives a kill.
  void flush();
  void attach(const Attachment& attachment);
  void add(const Metadata& metadata);

  // Writes the summary and waits until all is on the disk.
  void close();

  // About how many bytes the file would have if it were closed now; at most a little more.
  std::uint64_t size() const { return offset_ + records_.size(); }
  const Statistics& statistics() const { return statistics_; }
  const std::filesystem::path& file() const { return file_; }

 private:
  struct Compressor;

  void put(std::span<const std::uint8_t> bytes);
  void write_summary();

  std::filesystem::path file_;
  WriterOptions options_;
  int descriptor_ = -1;
  bool broken_ = false;
  std::uint64_t offset_ = 0;
  std::uint32_t crc_ = 0;  // of all bytes so far
  std::unique_ptr<Compressor> compressor_;

  std::vector<Schema> schemas_;
  std::vector<Channel> channels_;
  std::vector<ChunkIndex> chunks_;
  std::vector<AttachmentIndex> attachments_;
  std::vector<MetadataIndex> metadata_;
  Statistics statistics_;

  // The chunk in the making.
  Bytes records_;
  std::uint64_t chunk_start_ = 0;
  std::uint64_t chunk_end_ = 0;
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> indexes_;
};

}  // namespace cosegraph::recording
