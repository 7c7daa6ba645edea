#include "tools/recording/mcap_reader.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "core/error.hpp"
#include "tools/recording/mcap_records.hpp"

namespace cosegraph::recording {
namespace {

std::string at(std::uint64_t offset, const std::string& what) {
  return "offset " + std::to_string(offset) + ": " + what;
}

// The records of a chunk, unpacked and checked.
Bytes unpack(std::span<const std::uint8_t> content) {
  std::span<const std::uint8_t> packed;
  const ChunkHead head = parse_chunk(content, packed);
  if (head.uncompressed_size > kLargestRecord)
    throw InputError("a chunk claims to unpack to " + std::to_string(head.uncompressed_size) +
                     " bytes");
  Bytes records;
  if (head.compression == "zstd")
    records = decompress_zstd(packed, head.uncompressed_size);
  else if (head.compression.empty() && packed.size() == head.uncompressed_size)
    records.assign(packed.begin(), packed.end());
  else if (head.compression.empty())
    throw InputError("a chunk does not have the size it claims");
  else
    throw InputError("compression '" + head.compression + "' is not supported");
  if (head.uncompressed_crc != 0 && crc32(records) != head.uncompressed_crc)
    throw InputError("the checksum of a chunk does not fit");
  return records;
}

}  // namespace

class McapReader::File {
 public:
  explicit File(const std::filesystem::path& path) {
    // O_NONBLOCK: opening a pipe that nobody writes to must not hang before it is refused.
    descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    struct stat status {};
    if (descriptor_ < 0 || ::fstat(descriptor_, &status) != 0) {
      const int error = errno;
      if (descriptor_ >= 0) ::close(descriptor_);
      throw InputError(path.string() + ": cannot read: " + std::strerror(error));
    }
    if (!S_ISREG(status.st_mode)) {
      ::close(descriptor_);
      throw InputError(path.string() + ": is not a plain file");
    }
    size_ = static_cast<std::uint64_t>(status.st_size);
  }
  ~File() { ::close(descriptor_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  std::uint64_t size() const { return size_; }

  Bytes read(std::uint64_t offset, std::uint64_t length) const {
    if (offset > size_ || length > size_ - offset) throw InputError("the file is cut off");
    if (length > kLargestRecord)
      throw InputError("a record claims " + std::to_string(length) + " bytes");
    Bytes bytes(static_cast<std::size_t>(length));
    std::size_t got = 0;
    while (got < bytes.size()) {
      const ::ssize_t count = ::pread(descriptor_, bytes.data() + got, bytes.size() - got,
                                      static_cast<::off_t>(offset + got));
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) throw InputError(std::string("cannot read: ") + std::strerror(errno));
      if (count == 0) throw InputError("the file is cut off");
      got += static_cast<std::size_t>(count);
    }
    return bytes;
  }

  struct Head {
    Op op;
    std::uint64_t length;  // of the content
  };
  Head head(std::uint64_t offset) const {
    const auto [op, length] = parse_record_head(read(offset, kRecordHead));
    return {op, length};
  }
  // The content of the record at `offset`, which must be an `op`.
  Bytes record(std::uint64_t offset, Op op) const {
    const Head found = head(offset);
    if (found.op != op) throw InputError("there is not the record that an index promises");
    return read(offset + kRecordHead, found.length);
  }

 private:
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
};

McapReader::McapReader(std::filesystem::path file)
    : file_(std::move(file)), bytes_(std::make_unique<File>(file_)) {
  Bytes magic;
  try {
    magic = bytes_->read(0, std::min<std::uint64_t>(bytes_->size(), sizeof kMagic));
  } catch (const InputError& error) {
    throw InputError(file_.string() + ": " + error.what());
  }
  if (!std::ranges::equal(magic, kMagic))
    throw InputError(file_.string() + ": is not an MCAP file");
  if (!read_summary()) scan();
  std::ranges::stable_sort(chunks_, {}, [](const ChunkIndex& chunk) {
    return std::pair(chunk.start_time, chunk.offset);
  });
}

McapReader::~McapReader() = default;

std::uint64_t McapReader::size() const {
  return bytes_->size();
}

// False, with nothing kept, if the file has no summary that can be relied on.
bool McapReader::read_summary() {
  constexpr std::uint64_t kEnd = kFooterSize + sizeof kMagic;
  std::uint64_t offset = bytes_->size();
  try {
    if (offset < sizeof kMagic + kEnd) throw InputError("the file is cut off");
    const std::uint64_t footer_at = offset - kEnd;
    if (!std::ranges::equal(bytes_->read(footer_at + kFooterSize, sizeof kMagic), kMagic))
      throw InputError("the file is cut off");
    offset = footer_at;
    const auto footer = parse<Footer>(bytes_->record(footer_at, Op::footer));
    if (footer.summary_start == 0) return false;
    offset = footer.summary_start;
    if (offset > footer_at) throw InputError("the footer points behind the end");
    const Bytes summary = bytes_->read(offset, bytes_->size() - sizeof kMagic - offset);
    const auto covered = std::span(summary).first(summary.size() - sizeof footer.summary_crc);
    if (footer.summary_crc != 0 && footer.summary_crc != crc32(covered))
      throw InputError("the checksum of the summary does not fit");
    const auto header = parse<Header>(bytes_->record(sizeof kMagic, Op::header));
    library_ = header.library;
    for (auto rest = std::span(summary).first(summary.size() - kFooterSize); !rest.empty();) {
      const RawRecord record = take_record(rest);
      add_from_summary(static_cast<std::uint8_t>(record.op), record.content);
    }
    for (const auto& [id, channel] : channels_)
      if (channel.schema != 0 && !schemas_.contains(channel.schema))
        throw InputError("channel " + std::to_string(id) + " has a schema that is not there");
    // A summary may leave out indexes, or statistics, or both.
    if (statistics_.messages > 0 && statistics_.chunks == chunks_.size()) return true;
  } catch (const InputError& error) {
    damage_ = at(offset, error.what());
  }
  schemas_.clear();
  channels_.clear();
  chunks_.clear();
  attachments_.clear();
  metadata_.clear();
  statistics_ = {};
  return false;
}

void McapReader::add_from_summary(std::uint8_t op, std::span<const std::uint8_t> content) {
  switch (static_cast<Op>(op)) {
    case Op::schema:
      add_schema(parse<Schema>(content));
      break;
    case Op::channel:
      add_channel(parse<Channel>(content));
      break;
    case Op::chunk_index:
      chunks_.push_back(parse<ChunkIndex>(content));
      break;
    case Op::attachment_index:
      attachments_.push_back(parse<AttachmentIndex>(content));
      break;
    case Op::metadata_index:
      metadata_.push_back(parse<MetadataIndex>(content));
      break;
    case Op::statistics:
      statistics_ = parse<Statistics>(content);
      break;
    default:
      break;  // offsets, and what later versions of the format may add
  }
}

void McapReader::add_schema(Schema schema) {
  if (schema.id == 0) return;  // to be ignored, says the format
  const auto known = schemas_.try_emplace(schema.id, schema).first;
  if (known->second != schema)
    throw InputError("schema " + std::to_string(schema.id) + " is defined twice");
}

void McapReader::add_channel(Channel channel) {
  const auto known = channels_.try_emplace(channel.id, channel).first;
  if (known->second != channel)
    throw InputError("channel " + std::to_string(channel.id) + " is defined twice");
}

void McapReader::scan() {
  std::uint64_t offset = sizeof kMagic;
  try {
    for (bool more = true; more;) {
      const File::Head head = bytes_->head(offset);
      const Bytes content = bytes_->read(offset + kRecordHead, head.length);
      more = scan_record(offset, static_cast<std::uint8_t>(head.op), content);
      offset += kRecordHead + head.length;
    }
  } catch (const InputError& error) {
    damage_ = at(offset, error.what());  // comes before what is wrong with the summary
  }
  statistics_.schemas = static_cast<std::uint16_t>(schemas_.size());
  statistics_.channels = static_cast<std::uint32_t>(channels_.size());
  statistics_.attachments = static_cast<std::uint32_t>(attachments_.size());
  statistics_.metadata = static_cast<std::uint32_t>(metadata_.size());
  statistics_.chunks = static_cast<std::uint32_t>(chunks_.size());
}

// False at the end of the data.
bool McapReader::scan_record(std::uint64_t offset, std::uint8_t op,
                             std::span<const std::uint8_t> content) {
  switch (static_cast<Op>(op)) {
    case Op::header:
      library_ = parse<Header>(content).library;
      break;
    case Op::schema:
      add_schema(parse<Schema>(content));
      break;
    case Op::channel:
      add_channel(parse<Channel>(content));
      break;
    case Op::chunk:
      scan_chunk(offset, content);
      break;
    case Op::attachment: {
      const auto attachment = parse<Attachment>(content);
      attachments_.push_back({.offset = offset,
                              .length = kRecordHead + content.size(),
                              .log_time = attachment.log_time,
                              .create_time = attachment.create_time,
                              .data_size = attachment.data.size(),
                              .name = attachment.name,
                              .media_type = attachment.media_type});
      break;
    }
    case Op::metadata:
      metadata_.push_back({.offset = offset,
                           .length = kRecordHead + content.size(),
                           .name = parse<Metadata>(content).name});
      break;
    case Op::message:
      throw InputError("messages outside of chunks are not supported");
    case Op::data_end:
    case Op::footer:
      return false;
    default:
      // Application records (128 and up) and later versions of the format are passed over; a
      // stretch of zeros is what a power failure leaves.
      if (op == 0) throw InputError("there is no record");
      break;
  }
  return true;
}

void McapReader::scan_chunk(std::uint64_t offset, std::span<const std::uint8_t> content) {
  const Bytes records = unpack(content);
  std::span<const std::uint8_t> packed;
  const ChunkHead head = parse_chunk(content, packed);
  ChunkIndex index{.offset = offset,
                   .length = kRecordHead + content.size(),
                   .compression = head.compression,
                   .compressed_size = head.compressed_size,
                   .uncompressed_size = head.uncompressed_size};
  Statistics statistics = statistics_;  // kept only if the whole chunk is sound
  bool is_first = true;
  for (std::span<const std::uint8_t> rest(records); !rest.empty();) {
    const RawRecord record = take_record(rest);
    if (record.op == Op::schema) add_schema(parse<Schema>(record.content));
    if (record.op == Op::channel) add_channel(parse<Channel>(record.content));
    if (record.op != Op::message) continue;
    const auto message = parse<Message>(record.content);
    if (!channels_.contains(message.channel))
      throw InputError("a message is on channel " + std::to_string(message.channel) +
                       ", which is not there");
    const std::uint64_t time = message.log_time;
    index.start_time = is_first ? time : std::min(index.start_time, time);
    index.end_time = is_first ? time : std::max(index.end_time, time);
    index.message_indexes.try_emplace(message.channel, 0);
    is_first = false;
    statistics.start_time = statistics.messages == 0 ? time : std::min(statistics.start_time, time);
    statistics.end_time = std::max(statistics.end_time, time);
    ++statistics.messages;
    ++statistics.channel_messages[message.channel];
  }
  statistics_ = std::move(statistics);
  chunks_.push_back(std::move(index));
}

namespace {

// The newest entry of a name, or null.
template <class Index>
const Index* find_newest(const std::vector<Index>& all, std::string_view name) {
  const auto found =
      std::find_if(all.rbegin(), all.rend(), [&](const Index& one) { return one.name == name; });
  return found == all.rend() ? nullptr : &*found;
}

}  // namespace

std::optional<Attachment> McapReader::attachment(std::string_view name) const {
  const AttachmentIndex* index = find_newest(attachments_, name);
  if (index == nullptr) return std::nullopt;
  try {
    return parse<Attachment>(bytes_->record(index->offset, Op::attachment));
  } catch (const InputError& error) {
    throw InputError(file_.string() + ": " + at(index->offset, error.what()));
  }
}

std::optional<Metadata> McapReader::metadata(std::string_view name) const {
  const MetadataIndex* index = find_newest(metadata_, name);
  if (index == nullptr) return std::nullopt;
  try {
    return parse<Metadata>(bytes_->record(index->offset, Op::metadata));
  } catch (const InputError& error) {
    throw InputError(file_.string() + ": " + at(index->offset, error.what()));
  }
}

McapReader::Messages::Messages(const McapReader& reader, Selection selection)
    : reader_(&reader), selection_(std::move(selection)) {
  const auto has_wanted_channel = [&](const ChunkIndex& chunk) {
    // Without message indexes anything may be in the chunk.
    if (!selection_.channels || chunk.message_indexes.empty()) return true;
    return std::ranges::any_of(chunk.message_indexes, [&](const auto& entry) {
      return selection_.channels->contains(entry.first);
    });
  };
  for (const auto& chunk : reader.chunks_)
    if (chunk.start_time < selection_.to && chunk.end_time >= selection_.from &&
        has_wanted_channel(chunk))
      chunks_.push_back(&chunk);
}

bool McapReader::Messages::open_chunk() {
  if (next_chunk_ == chunks_.size()) return false;
  const ChunkIndex& chunk = *chunks_[next_chunk_++];
  offset_ = chunk.offset;
  records_ = unpack(reader_->bytes_->record(chunk.offset, Op::chunk));
  rest_ = records_;
  return true;
}

std::optional<Message> McapReader::Messages::next() {
  try {
    for (;;) {
      while (rest_.empty())
        if (!open_chunk()) return std::nullopt;
      const RawRecord record = take_record(rest_);
      if (record.op != Op::message) continue;
      const auto message = parse<Message>(record.content);
      if (!reader_->channels_.contains(message.channel))
        throw InputError("a message is on channel " + std::to_string(message.channel) +
                         ", which is not there");
      if (message.log_time < selection_.from || message.log_time >= selection_.to) continue;
      if (selection_.channels && !selection_.channels->contains(message.channel)) continue;
      return message;
    }
  } catch (const InputError& error) {
    rest_ = {};
    throw InputError(reader_->file_.string() + ": " + at(offset_, error.what()));
  }
}

}  // namespace cosegraph::recording
