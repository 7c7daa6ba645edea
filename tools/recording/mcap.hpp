// What an MCAP file holds, as plain values. https://mcap.dev/spec tells what they mean.
//
// Times are nanoseconds since 1970. Offsets are bytes from the start of the file; the length of a
// record includes its opcode and length field.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace cosegraph::recording {

using Bytes = std::vector<std::uint8_t>;
using Texts = std::map<std::string, std::string>;

// No record, and nothing that a chunk unpacks to, may be larger: what a file claims is believed up
// to here.
constexpr std::uint64_t kLargestRecord = 1ULL << 30U;

struct Schema {
  std::uint16_t id = 0;  // never 0
  std::string name;
  std::string encoding;
  std::string data;

  bool operator==(const Schema&) const = default;
};

struct Channel {
  std::uint16_t id = 0;
  std::uint16_t schema = 0;  // 0: none
  std::string topic;
  std::string encoding;  // of its messages
  Texts metadata;

  bool operator==(const Channel&) const = default;
};

struct Message {
  std::uint16_t channel = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time = 0;      // when it was recorded
  std::uint64_t publish_time = 0;  // the same if nobody knows
  std::span<const std::uint8_t> data;
};

struct Attachment {
  std::uint64_t log_time = 0;
  std::uint64_t create_time = 0;  // 0: nobody knows
  std::string name;
  std::string media_type;
  std::string data;
};

struct Metadata {
  std::string name;
  Texts values;
};

struct ChunkIndex {
  std::uint64_t start_time = 0;  // of its messages
  std::uint64_t end_time = 0;
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  std::map<std::uint16_t, std::uint64_t> message_indexes;  // channel: offset of its Message Index
  std::uint64_t message_index_length = 0;
  std::string compression;
  std::uint64_t compressed_size = 0;
  std::uint64_t uncompressed_size = 0;
};

struct AttachmentIndex {
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  std::uint64_t log_time = 0;
  std::uint64_t create_time = 0;
  std::uint64_t data_size = 0;
  std::string name;
  std::string media_type;
};

struct MetadataIndex {
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  std::string name;
};

struct Statistics {
  std::uint64_t messages = 0;
  std::uint16_t schemas = 0;
  std::uint32_t channels = 0;
  std::uint32_t attachments = 0;
  std::uint32_t metadata = 0;
  std::uint32_t chunks = 0;
  std::uint64_t start_time = 0;  // of the earliest message; 0 if there is none
  std::uint64_t end_time = 0;
  std::map<std::uint16_t, std::uint64_t> channel_messages;
};

}  // namespace cosegraph::recording
