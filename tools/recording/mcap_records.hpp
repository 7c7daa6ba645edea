// The bytes of MCAP records; shared by the writer and the reader, and by nobody else.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "tools/recording/mcap.hpp"

namespace cosegraph::recording {

constexpr std::uint8_t kMagic[] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
constexpr std::size_t kRecordHead = 9;  // opcode and length

enum class Op : std::uint8_t {
  header = 1,
  footer,
  schema,
  channel,
  message,
  chunk,
  message_index,
  chunk_index,
  attachment,
  attachment_index,
  statistics,
  metadata,
  metadata_index,
  summary_offset,
  data_end,
};

struct Header {
  std::string profile;
  std::string library;
};

struct Footer {
  std::uint64_t summary_start = 0;         // 0: there is no summary
  std::uint64_t summary_offset_start = 0;  // 0: there are no offsets
  std::uint32_t summary_crc = 0;           // 0: not known
};
constexpr std::size_t kFooterSize = kRecordHead + 20;

// A chunk without its records.
struct ChunkHead {
  std::uint64_t start_time = 0;
  std::uint64_t end_time = 0;
  std::uint64_t uncompressed_size = 0;
  std::uint32_t uncompressed_crc = 0;  // 0: not known
  std::string compression;
  std::uint64_t compressed_size = 0;
};

struct MessageIndex {
  std::uint16_t channel = 0;
  std::vector<std::pair<std::uint64_t, std::uint64_t>> entries;  // log time, offset in the chunk
};

struct SummaryOffset {
  Op group = Op::schema;
  std::uint64_t start = 0;
  std::uint64_t length = 0;
};

std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t before = 0);

// Appends a whole record to `out`.
void append(Bytes& out, const Header& header);
void append(Bytes& out, const Footer& footer);
void append(Bytes& out, const Schema& schema);
void append(Bytes& out, const Channel& channel);
void append(Bytes& out, const Message& message);
void append(Bytes& out, const MessageIndex& index);
void append(Bytes& out, const ChunkIndex& index);
void append(Bytes& out, const Attachment& attachment);
void append(Bytes& out, const AttachmentIndex& index);
void append(Bytes& out, const Statistics& statistics);
void append(Bytes& out, const Metadata& metadata);
void append(Bytes& out, const MetadataIndex& index);
void append(Bytes& out, const SummaryOffset& offset);
void append_data_end(Bytes& out, std::uint32_t crc);
// Everything of a Chunk record before its records, which must follow.
void append(Bytes& out, const ChunkHead& head);

// Parse the content of a record, without opcode and length; what follows the known fields is
// ignored, as the format may grow. Throw InputError if the content is too short for what it claims,
// or if a checksum in it does not fit.
template <class Record>
Record parse(std::span<const std::uint8_t> content);

// `records` is set to the part of `content` that holds the chunk's records.
ChunkHead parse_chunk(std::span<const std::uint8_t> content,
                      std::span<const std::uint8_t>& records);

struct RawRecord {
  Op op{};
  std::span<const std::uint8_t> content;
};

// Takes the next record off the front of `bytes`. Throws InputError if it is cut off.
RawRecord take_record(std::span<const std::uint8_t>& bytes);

// Opcode and length of the record that begins with these kRecordHead bytes.
std::pair<Op, std::uint64_t> parse_record_head(std::span<const std::uint8_t> head);

// Throws InputError if `packed` is damaged or does not hold exactly `size` bytes. Takes no more
// memory than what is really there needs.
Bytes decompress_zstd(std::span<const std::uint8_t> packed, std::uint64_t size);

}  // namespace cosegraph::recording
