#include "tools/recording/mcap_records.hpp"

#include <libdeflate.h>
#include <zstd.h>

#include <algorithm>
#include <memory>

#include "core/error.hpp"

namespace cosegraph::recording {
namespace {

// Appends little-endian fields to a buffer.
class Encoder {
 public:
  explicit Encoder(Bytes& out) : out_(out) {}

  template <class Number>
  Encoder& number(Number value) {
    for (std::size_t i = 0; i < sizeof value; ++i)
      out_.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
    return *this;
  }
  Encoder& text(std::string_view text) {
    number(static_cast<std::uint32_t>(text.size()));
    out_.insert(out_.end(), text.begin(), text.end());
    return *this;
  }
  Encoder& raw(std::span<const std::uint8_t> bytes) {
    out_.insert(out_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  // What `fill` appends, behind its size as a `Size`.
  template <class Size, class Fill>
  Encoder& sized(Fill fill) {
    const std::size_t at = out_.size();
    number(Size{0});
    fill();
    const auto size = static_cast<Size>(out_.size() - at - sizeof(Size));
    for (std::size_t i = 0; i < sizeof size; ++i)
      out_[at + i] = static_cast<std::uint8_t>(size >> (8 * i));
    return *this;
  }
  Encoder& texts(const Texts& values) {
    return sized<std::uint32_t>([&] {
      for (const auto& [key, value] : values) text(key).text(value);
    });
  }
  Encoder& counts(const std::map<std::uint16_t, std::uint64_t>& values) {
    return sized<std::uint32_t>([&] {
      for (const auto& [key, value] : values) number(key).number(value);
    });
  }

 private:
  Bytes& out_;
};

template <class Fill>
void append_record(Bytes& out, Op op, Fill fill) {
  Encoder encoder(out);
  encoder.number(static_cast<std::uint8_t>(op)).sized<std::uint64_t>([&] { fill(encoder); });
}

// Takes little-endian fields off the front of a record's content.
class Decoder {
 public:
  explicit Decoder(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  template <class Number>
  Number number() {
    const auto bytes = raw(sizeof(Number));
    Number value = 0;
    for (std::size_t i = 0; i < sizeof value; ++i)
      value = static_cast<Number>(value | static_cast<Number>(bytes[i]) << (8 * i));
    return value;
  }
  template <class... Numbers>
  void numbers(Numbers&... values) {
    ((values = number<Numbers>()), ...);
  }
  std::span<const std::uint8_t> raw(std::uint64_t size) {
    if (size > rest_.size()) throw InputError("a record is shorter than what it claims to hold");
    const auto bytes = rest_.first(static_cast<std::size_t>(size));
    rest_ = rest_.subspan(bytes.size());
    return bytes;
  }
  std::string text() { return text_of(raw(number<std::uint32_t>())); }
  std::string long_text() { return text_of(raw(number<std::uint64_t>())); }
  Decoder part() { return Decoder(raw(number<std::uint32_t>())); }
  Texts texts() {
    Texts values;
    for (Decoder all = part(); !all.empty();) {
      std::string key = all.text();
      values[std::move(key)] = all.text();
    }
    return values;
  }
  std::map<std::uint16_t, std::uint64_t> counts() {
    std::map<std::uint16_t, std::uint64_t> values;
    for (Decoder all = part(); !all.empty();) {
      const auto key = all.number<std::uint16_t>();
      values[key] = all.number<std::uint64_t>();
    }
    return values;
  }
  bool empty() const { return rest_.empty(); }
  std::span<const std::uint8_t> rest() const { return rest_; }

 private:
  static std::string text_of(std::span<const std::uint8_t> bytes) {
    return {bytes.begin(), bytes.end()};
  }

  std::span<const std::uint8_t> rest_;
};

constexpr std::size_t kCrcSize = 4;

}  // namespace

std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t before) {
  return ::libdeflate_crc32(before, bytes.data(), bytes.size());
}

void append(Bytes& out, const Header& header) {
  append_record(out, Op::header, [&](Encoder& e) { e.text(header.profile).text(header.library); });
}

void append(Bytes& out, const Footer& footer) {
  append_record(out, Op::footer, [&](Encoder& e) {
    e.number(footer.summary_start).number(footer.summary_offset_start).number(footer.summary_crc);
  });
}

void append(Bytes& out, const Schema& schema) {
  append_record(out, Op::schema, [&](Encoder& e) {
    e.number(schema.id).text(schema.name).text(schema.encoding).text(schema.data);
  });
}

void append(Bytes& out, const Channel& channel) {
  append_record(out, Op::channel, [&](Encoder& e) {
    e.number(channel.id).number(channel.schema).text(channel.topic).text(channel.encoding);
    e.texts(channel.metadata);
  });
}

void append(Bytes& out, const Message& message) {
  append_record(out, Op::message, [&](Encoder& e) {
    e.number(message.channel).number(message.sequence);
    e.number(message.log_time).number(message.publish_time).raw(message.data);
  });
}

void append(Bytes& out, const MessageIndex& index) {
  append_record(out, Op::message_index, [&](Encoder& e) {
    e.number(index.channel).sized<std::uint32_t>([&] {
      for (const auto& [time, offset] : index.entries) e.number(time).number(offset);
    });
  });
}

void append(Bytes& out, const ChunkIndex& index) {
  append_record(out, Op::chunk_index, [&](Encoder& e) {
    e.number(index.start_time).number(index.end_time).number(index.offset).number(index.length);
    e.counts(index.message_indexes).number(index.message_index_length).text(index.compression);
    e.number(index.compressed_size).number(index.uncompressed_size);
  });
}

void append(Bytes& out, const Attachment& attachment) {
  append_record(out, Op::attachment, [&](Encoder& e) {
    const std::size_t start = out.size();
    e.number(attachment.log_time).number(attachment.create_time);
    e.text(attachment.name).text(attachment.media_type);
    e.number(static_cast<std::uint64_t>(attachment.data.size()));
    out.insert(out.end(), attachment.data.begin(), attachment.data.end());
    e.number(crc32(std::span(out).subspan(start)));
  });
}

void append(Bytes& out, const AttachmentIndex& index) {
  append_record(out, Op::attachment_index, [&](Encoder& e) {
    e.number(index.offset).number(index.length).number(index.log_time).number(index.create_time);
    e.number(index.data_size).text(index.name).text(index.media_type);
  });
}

void append(Bytes& out, const Statistics& statistics) {
  append_record(out, Op::statistics, [&](Encoder& e) {
    e.number(statistics.messages).number(statistics.schemas).number(statistics.channels);
    e.number(statistics.attachments).number(statistics.metadata).number(statistics.chunks);
    e.number(statistics.start_time).number(statistics.end_time);
    e.counts(statistics.channel_messages);
  });
}

void append(Bytes& out, const Metadata& metadata) {
  append_record(out, Op::metadata,
                [&](Encoder& e) { e.text(metadata.name).texts(metadata.values); });
}

void append(Bytes& out, const MetadataIndex& index) {
  append_record(out, Op::metadata_index,
                [&](Encoder& e) { e.number(index.offset).number(index.length).text(index.name); });
}

void append(Bytes& out, const SummaryOffset& offset) {
  append_record(out, Op::summary_offset, [&](Encoder& e) {
    e.number(static_cast<std::uint8_t>(offset.group)).number(offset.start).number(offset.length);
  });
}

void append_data_end(Bytes& out, std::uint32_t crc) {
  append_record(out, Op::data_end, [&](Encoder& e) { e.number(crc); });
}

void append(Bytes& out, const ChunkHead& head) {
  Bytes fields;
  Encoder(fields)
      .number(head.start_time)
      .number(head.end_time)
      .number(head.uncompressed_size)
      .number(head.uncompressed_crc)
      .text(head.compression)
      .number(head.compressed_size);
  Encoder(out)
      .number(static_cast<std::uint8_t>(Op::chunk))
      .number(static_cast<std::uint64_t>(fields.size() + head.compressed_size))
      .raw(fields);
}

template <>
Header parse(std::span<const std::uint8_t> content) {
  Decoder fields(content);
  std::string profile = fields.text();
  return {.profile = std::move(profile), .library = fields.text()};
}

template <>
Footer parse(std::span<const std::uint8_t> content) {
  Footer footer;
  Decoder(content).numbers(footer.summary_start, footer.summary_offset_start, footer.summary_crc);
  return footer;
}

template <>
Schema parse(std::span<const std::uint8_t> content) {
  Decoder fields(content);
  Schema schema;
  fields.numbers(schema.id);
  schema.name = fields.text();
  schema.encoding = fields.text();
  schema.data = fields.text();
  return schema;
}

template <>
Channel parse(std::span<const std::uint8_t> content) {
  Decoder fields(content);
  Channel channel;
  fields.numbers(channel.id, channel.schema);
  channel.topic = fields.text();
  channel.encoding = fields.text();
  channel.metadata = fields.texts();
  return channel;
}

template <>
Message parse(std::span<const std::uint8_t> content) {
  Decoder fields(content);
  Message message;
  fields.numbers(message.channel, message.sequence, message.log_time, message.publish_time);
  message.data = fields.rest();
  return message;
}

template <>
ChunkIndex parse(std::span<const std::uint8_t> content) {
  Decoder fields(content);
  ChunkIndex index;
  fields.numbers(index.start_time, index.end_time, index.offset, index.length);
  index.message_indexes = fields.counts();
  fields.numbers(index.message_index_length);
  index.compression = fields.text();
  fields.numbers(index.compressed_size, index.uncompressed_size);
  return index;
}

template <>
Attachment parse(std::span<const std::uint8_t> content) {
  Decoder fields(content);
  Attachment attachment;
  fields.numbers(attachment.log_time, attachment.create_time);
  attachment.name = fields.text();
  attachment.media_type = fields.text();
  attachment.data = fields.long_text();
  const std::size_t covered = content.size() - fields.rest().size();
  const auto crc = fields.number<std::uint32_t>();
  if (crc != 0 && crc != crc32(content.first(covered)))
    throw InputError("the checksum of attachment '" + attachment.name + "' does not fit");
  return attachment;
}

template <>
AttachmentIndex parse(std::span<const std::uint8_t> content) {
  Decoder fields(content);
  AttachmentIndex index;
  fields.numbers(index.offset, index.length, index.log_time, index.create_time, index.data_size);
  index.name = fields.text();
  index.media_type = fields.text();
  return index;
}

template <>
Statistics parse(std::span<const std::uint8_t> content) {
  Decoder fields(content);
  Statistics statistics;
  fields.numbers(statistics.messages, statistics.schemas, statistics.channels,
                 statistics.attachments, statistics.metadata, statistics.chunks,
                 statistics.start_time, statistics.end_time);
  statistics.channel_messages = fields.counts();
  return statistics;
}

template <>
Metadata parse(std::span<const std::uint8_t> content) {
  Decoder fields(content);
  std::string name = fields.text();
  return {.name = std::move(name), .values = fields.texts()};
}

template <>
MetadataIndex parse(std::span<const std::uint8_t> content) {
  Decoder fields(content);
  MetadataIndex index;
  fields.numbers(index.offset, index.length);
  index.name = fields.text();
  return index;
}

ChunkHead parse_chunk(std::span<const std::uint8_t> content,
                      std::span<const std::uint8_t>& records) {
  Decoder fields(content);
  ChunkHead head;
  fields.numbers(head.start_time, head.end_time, head.uncompressed_size, head.uncompressed_crc);
  head.compression = fields.text();
  fields.numbers(head.compressed_size);
  records = fields.raw(head.compressed_size);
  return head;
}

std::pair<Op, std::uint64_t> parse_record_head(std::span<const std::uint8_t> head) {
  Decoder fields(head);
  const auto op = static_cast<Op>(fields.number<std::uint8_t>());
  return {op, fields.number<std::uint64_t>()};
}

RawRecord take_record(std::span<const std::uint8_t>& bytes) {
  if (bytes.size() < kRecordHead) throw InputError("a record is cut off");
  const auto [op, length] = parse_record_head(bytes.first(kRecordHead));
  bytes = bytes.subspan(kRecordHead);
  if (length > bytes.size()) throw InputError("a record is cut off");
  const auto content = bytes.first(static_cast<std::size_t>(length));
  bytes = bytes.subspan(content.size());
  return {op, content};
}

Bytes decompress_zstd(std::span<const std::uint8_t> packed, std::uint64_t size) {
  const std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> context(ZSTD_createDCtx(),
                                                                     &ZSTD_freeDCtx);
  if (context == nullptr) throw Error("no memory for decompression");
  // One byte more than is expected tells what is too long from what fits.
  const auto most = static_cast<std::size_t>(size) + 1;
  Bytes out(std::min(most, 16 * packed.size() + 1024));
  ZSTD_inBuffer in{packed.data(), packed.size(), 0};
  ZSTD_outBuffer to{out.data(), out.size(), 0};
  for (;;) {
    const std::size_t left = ZSTD_decompressStream(context.get(), &to, &in);
    if (ZSTD_isError(left) != 0)
      throw InputError(std::string("compressed data is damaged: ") + ZSTD_getErrorName(left));
    if (left == 0 && in.pos == in.size) break;
    if (to.pos == most) break;
    if (to.pos == to.size) {
      out.resize(std::min(most, 2 * out.size()));
      to.dst = out.data();
      to.size = out.size();
    } else if (in.pos == in.size) {
      throw InputError("compressed data is cut off");
    }
  }
  if (to.pos != size) throw InputError("compressed data does not hold what it claims");
  out.resize(to.pos);
  return out;
}

}  // namespace cosegraph::recording
