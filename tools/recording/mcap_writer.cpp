#include "tools/recording/mcap_writer.hpp"

#include <fcntl.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>

#include "core/error.hpp"
#include "tools/recording/mcap_records.hpp"

namespace cosegraph::recording {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, int error) {
  throw InputError(file.string() + ": cannot write: " + std::strerror(error));
}

template <class Record>
Bytes bytes_of(const Record& record) {
  Bytes bytes;
  append(bytes, record);
  return bytes;
}

}  // namespace

struct McapWriter::Compressor {
  explicit Compressor(int level) : context(ZSTD_createCCtx()), level(level) {
    if (context == nullptr) throw Error("no memory for compression");
  }
  ~Compressor() { ZSTD_freeCCtx(context); }
  Compressor(const Compressor&) = delete;
  Compressor& operator=(const Compressor&) = delete;

  std::span<const std::uint8_t> compress(std::span<const std::uint8_t> bytes) {
    buffer.resize(ZSTD_compressBound(bytes.size()));
    const std::size_t size =
        ZSTD_compressCCtx(context, buffer.data(), buffer.size(), bytes.data(), bytes.size(), level);
    if (ZSTD_isError(size) != 0) throw Error(std::string("zstd: ") + ZSTD_getErrorName(size));
    return std::span(buffer).first(size);
  }

  ZSTD_CCtx* context;
  int level;
  Bytes buffer;
};

McapWriter::McapWriter(std::filesystem::path file, const WriterOptions& options)
    : file_(std::move(file)),
      options_(options),
      compressor_(std::make_unique<Compressor>(options.compression_level)) {
  descriptor_ = ::open(file_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor_ < 0) fail(file_, errno);
  Bytes start(std::begin(kMagic), std::end(kMagic));
  append(start, Header{.profile = "", .library = "cosegraph"});
  put(start);
}

McapWriter::~McapWriter() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::uint16_t McapWriter::add_schema(std::string name, std::string encoding, std::string data) {
  if (schemas_.size() == std::numeric_limits<std::uint16_t>::max())
    throw Error(file_.string() + ": too many schemas");
  const auto id = static_cast<std::uint16_t>(schemas_.size() + 1);
  schemas_.push_back({id, std::move(name), std::move(encoding), std::move(data)});
  append(records_, schemas_.back());
  ++statistics_.schemas;
  return id;
}

std::uint16_t McapWriter::add_channel(std::string topic, std::uint16_t schema, std::string encoding,
                                      Texts metadata) {
  if (channels_.size() == std::numeric_limits<std::uint16_t>::max())
    throw Error(file_.string() + ": too many channels");
  if (schema > schemas_.size())
    throw Error(file_.string() + ": channel " + topic + " has a schema that was not added");
  const auto id = static_cast<std::uint16_t>(channels_.size() + 1);
  channels_.push_back({id, schema, std::move(topic), std::move(encoding), std::move(metadata)});
  append(records_, channels_.back());
  ++statistics_.channels;
  return id;
}

void McapWriter::write(const Message& message) {
  if (message.channel == 0 || message.channel > channels_.size())
    throw Error(file_.string() + ": channel " + std::to_string(message.channel) + " was not added");
  constexpr std::uint64_t kRoomForHeads = 1U << 20U;
  if (message.data.size() > kLargestRecord - kRoomForHeads)
    throw Error(file_.string() + ": a message of " + std::to_string(message.data.size()) +
                " bytes on " + channels_[message.channel - 1].topic + " is too large");
  if (records_.size() + message.data.size() + kRoomForHeads > kLargestRecord) flush();

  const bool is_first = indexes_.empty();
  chunk_start_ = is_first ? message.log_time : std::min(chunk_start_, message.log_time);
  chunk_end_ = is_first ? message.log_time : std::max(chunk_end_, message.log_time);
  indexes_[message.channel].emplace_back(message.log_time, records_.size());
  append(records_, message);

  const bool is_first_of_all = statistics_.messages == 0;
  statistics_.start_time =
      is_first_of_all ? message.log_time : std::min(statistics_.start_time, message.log_time);
  statistics_.end_time = std::max(statistics_.end_time, message.log_time);
  ++statistics_.messages;
  ++statistics_.channel_messages[message.channel];
  if (records_.size() >= options_.chunk_size) flush();
}

void McapWriter::flush() {
  if (records_.empty()) return;
  const auto packed = options_.compressed ? compressor_->compress(records_)
                                          : std::span<const std::uint8_t>(records_);
  ChunkIndex index{.start_time = chunk_start_,
                   .end_time = chunk_end_,
                   .offset = offset_,
                   .compression = options_.compressed ? "zstd" : "",
                   .compressed_size = packed.size(),
                   .uncompressed_size = records_.size()};
  put(bytes_of(ChunkHead{.start_time = chunk_start_,
                         .end_time = chunk_end_,
                         .uncompressed_size = records_.size(),
                         .uncompressed_crc = crc32(records_),
                         .compression = index.compression,
                         .compressed_size = packed.size()}));
  put(packed);
  index.length = offset_ - index.offset;
  Bytes message_indexes;
  for (auto& [channel, entries] : indexes_) {
    std::ranges::sort(entries);
    index.message_indexes[channel] = offset_ + message_indexes.size();
    append(message_indexes, MessageIndex{channel, std::move(entries)});
  }
  index.message_index_length = message_indexes.size();
  put(message_indexes);
  chunks_.push_back(std::move(index));
  ++statistics_.chunks;
  records_.clear();
  indexes_.clear();
  chunk_start_ = chunk_end_ = 0;
}

void McapWriter::attach(const Attachment& attachment) {
  const std::uint64_t start = offset_;
  put(bytes_of(attachment));
  attachments_.push_back({.offset = start,
                          .length = offset_ - start,
                          .log_time = attachment.log_time,
                          .create_time = attachment.create_time,
                          .data_size = attachment.data.size(),
                          .name = attachment.name,
                          .media_type = attachment.media_type});
  ++statistics_.attachments;
}

void McapWriter::add(const Metadata& metadata) {
  const std::uint64_t start = offset_;
  put(bytes_of(metadata));
  metadata_.push_back({.offset = start, .length = offset_ - start, .name = metadata.name});
  ++statistics_.metadata;
}

void McapWriter::close() {
  flush();
  Bytes end;
  append_data_end(end, crc_);
  put(end);
  write_summary();
  broken_ = true;  // nothing may follow
  if (::fdatasync(descriptor_) != 0) fail(file_, errno);
  if (::close(std::exchange(descriptor_, -1)) != 0) fail(file_, errno);
}

void McapWriter::write_summary() {
  Footer footer{.summary_start = offset_};
  Bytes summary;
  std::vector<SummaryOffset> groups;
  const auto add_group = [&](Op op, const auto& records) {
    const std::size_t start = summary.size();
    for (const auto& record : records) append(summary, record);
    if (summary.size() > start)
      groups.push_back({op, footer.summary_start + start, summary.size() - start});
  };
  add_group(Op::schema, schemas_);
  add_group(Op::channel, channels_);
  add_group(Op::statistics, std::span(&statistics_, 1));
  add_group(Op::chunk_index, chunks_);
  add_group(Op::attachment_index, attachments_);
  add_group(Op::metadata_index, metadata_);
  footer.summary_offset_start = footer.summary_start + summary.size();
  for (const auto& group : groups) append(summary, group);
  const std::size_t footer_at = summary.size();
  append(summary, footer);
  // The checksum covers the footer too, up to the checksum itself.
  footer.summary_crc = crc32(std::span(summary).first(summary.size() - sizeof footer.summary_crc));
  summary.resize(footer_at);
  append(summary, footer);
  summary.insert(summary.end(), std::begin(kMagic), std::end(kMagic));
  put(summary);
}

void McapWriter::put(std::span<const std::uint8_t> bytes) {
  if (broken_) throw InputError(file_.string() + ": nothing can be written any more");
  crc_ = crc32(bytes, crc_);
  offset_ += bytes.size();
  while (!bytes.empty()) {
    const ::ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      broken_ = true;
      fail(file_, errno);
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

}  // namespace cosegraph::recording
