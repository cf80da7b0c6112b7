// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "mcap_format.hpp"

#include <zlib.h>

#include <algorithm>
#include <limits>

namespace trigpoint::recording::mcap {

namespace {

template <class Record>
std::optional<Record> when_good(const Cursor& cursor, Record&& record) {
  return cursor.good() ? std::optional(std::forward<Record>(record)) : std::nullopt;
}

std::map<std::uint16_t, std::uint64_t> numbers(Cursor& cursor) {
  std::map<std::uint16_t, std::uint64_t> values;
  for (Cursor entries(cursor.block()); !entries.rest().empty() && entries.good();) {
    const auto key = entries.number<std::uint16_t>();
    values[key] = entries.number<std::uint64_t>();
  }
  return values;
}

std::uint64_t bytes_of(Nanoseconds time_ns) {
  return static_cast<std::uint64_t>(std::max<Nanoseconds>(time_ns, 0));
}

}  // namespace

std::uint32_t crc32_of(Bytes bytes, std::uint32_t before) {
  return static_cast<std::uint32_t>(crc32_z(before, bytes.data(), bytes.size()));
}

Nanoseconds Cursor::time() {
  constexpr auto kLatest = static_cast<std::uint64_t>(std::numeric_limits<Nanoseconds>::max());
  return static_cast<Nanoseconds>(std::min(number<std::uint64_t>(), kLatest));
}

std::string Cursor::text() {
  const Bytes bytes = block();
  return {bytes.begin(), bytes.end()};
}

Bytes Cursor::take(std::uint64_t size) {
  if (size > rest_.size()) {
    good_ = false;
    rest_ = {};
    return {};
  }
  const Bytes taken = rest_.first(size);
  rest_ = rest_.subspan(size);
  return taken;
}

std::optional<RecordHead> parse_head(Bytes bytes) {
  Cursor cursor(bytes);
  RecordHead head;
  head.op = static_cast<Op>(cursor.number<std::uint8_t>());
  head.length = cursor.number<std::uint64_t>();
  return when_good(cursor, std::move(head));
}

std::optional<Header> parse_header(Bytes record) {
  Cursor cursor(record);
  Header header;
  header.profile = cursor.text();
  header.library = cursor.text();
  return when_good(cursor, std::move(header));
}

std::optional<Schema> parse_schema(Bytes record) {
  Cursor cursor(record);
  Schema schema;
  schema.id = cursor.number<std::uint16_t>();
  schema.name = cursor.text();
  schema.encoding = cursor.text();
  schema.data = cursor.text();
  return when_good(cursor, std::move(schema));
}

std::optional<Channel> parse_channel(Bytes record) {
  Cursor cursor(record);
  Channel channel;
  channel.id = cursor.number<std::uint16_t>();
  channel.schema_id = cursor.number<std::uint16_t>();
  channel.topic = cursor.text();
  channel.message_encoding = cursor.text();
  for (Cursor entries(cursor.block()); !entries.rest().empty() && entries.good();) {
    const std::string key = entries.text();
    channel.metadata[key] = entries.text();
  }
  return when_good(cursor, std::move(channel));
}

std::optional<MessageHead> parse_message_head(Bytes record) {
  Cursor cursor(record);
  MessageHead head;
  head.channel_id = cursor.number<std::uint16_t>();
  head.sequence = cursor.number<std::uint32_t>();
  head.log_time_ns = cursor.time();
  head.publish_time_ns = cursor.time();
  return when_good(cursor, std::move(head));
}

std::optional<std::pair<ChunkHead, std::uint64_t>> parse_chunk_head(Bytes record) {
  Cursor cursor(record);
  ChunkHead head;
  head.first_ns = cursor.time();
  head.last_ns = cursor.time();
  head.size = cursor.number<std::uint64_t>();
  head.crc = cursor.number<std::uint32_t>();
  head.compression = cursor.text();
  head.stored = cursor.number<std::uint64_t>();
  const std::uint64_t taken = record.size() - cursor.rest().size();
  return when_good(cursor, std::pair(std::move(head), taken));
}

std::optional<ChunkIndex> parse_chunk_index(Bytes record) {
  Cursor cursor(record);
  ChunkIndex index;
  index.first_ns = cursor.time();
  index.last_ns = cursor.time();
  index.chunk_begin = cursor.number<std::uint64_t>();
  index.chunk_length = cursor.number<std::uint64_t>();
  index.message_index_begins = numbers(cursor);
  index.message_index_length = cursor.number<std::uint64_t>();
  index.compression = cursor.text();
  index.stored = cursor.number<std::uint64_t>();
  index.size = cursor.number<std::uint64_t>();
  return when_good(cursor, std::move(index));
}

std::optional<Statistics> parse_statistics(Bytes record) {
  Cursor cursor(record);
  Statistics statistics;
  statistics.messages = cursor.number<std::uint64_t>();
  statistics.schemas = cursor.number<std::uint16_t>();
  statistics.channels = cursor.number<std::uint32_t>();
  statistics.attachments = cursor.number<std::uint32_t>();
  statistics.metadata = cursor.number<std::uint32_t>();
  statistics.chunks = cursor.number<std::uint32_t>();
  statistics.first_ns = cursor.time();
  statistics.last_ns = cursor.time();
  statistics.channel_messages = numbers(cursor);
  return when_good(cursor, std::move(statistics));
}

std::optional<Footer> parse_footer(Bytes record) {
  Cursor cursor(record);
  Footer footer;
  footer.summary_begin = cursor.number<std::uint64_t>();
  footer.summary_offset_begin = cursor.number<std::uint64_t>();
  footer.summary_crc = cursor.number<std::uint32_t>();
  return when_good(cursor, std::move(footer));
}

std::optional<std::pair<RecordHead, Bytes>> take_record(Bytes& rest) {
  const auto head = parse_head(rest);
  if (!head || head->length > rest.size() - kHeadBytes) {
    return std::nullopt;
  }
  const Bytes record = rest.subspan(kHeadBytes, head->length);
  rest = rest.subspan(kHeadBytes + head->length);
  return std::pair(*head, record);
}

template <class Fields>
void RecordWriter::record(Op op, Fields&& fields) {
  number(static_cast<std::uint64_t>(op), 1);
  const std::size_t at = content_.size();
  number(0, 8);
  fields();
  std::uint64_t length = content_.size() - at - 8;
  for (std::size_t i = at; i < at + 8; ++i, length >>= 8U) {
    content_[i] = static_cast<std::uint8_t>(length & 0xFFU);
  }
}

void RecordWriter::number(std::uint64_t value, std::size_t bytes) {
  for (; bytes > 0; --bytes, value >>= 8U) {
    content_.push_back(static_cast<std::uint8_t>(value & 0xFFU));
  }
}

void RecordWriter::text(const std::string& text) {
  number(text.size(), 4);
  content_.insert(content_.end(), text.begin(), text.end());
}

void RecordWriter::texts(const std::map<std::string, std::string>& values) {
  std::uint64_t length = 0;
  for (const auto& [key, value] : values) {
    length += 8 + key.size() + value.size();
  }
  number(length, 4);
  for (const auto& [key, value] : values) {
    text(key);
    text(value);
  }
}

void RecordWriter::numbers(const std::map<std::uint16_t, std::uint64_t>& values) {
  number(values.size() * 10, 4);
  for (const auto& [key, value] : values) {
    number(key, 2);
    number(value, 8);
  }
}

void RecordWriter::bytes(Bytes bytes) {
  content_.insert(content_.end(), bytes.begin(), bytes.end());
}

void RecordWriter::header(const Header& header) {
  record(Op::kHeader, [&] {
    text(header.profile);
    text(header.library);
  });
}

void RecordWriter::footer(const Footer& footer) {
  record(Op::kFooter, [&] {
    number(footer.summary_begin, 8);
    number(footer.summary_offset_begin, 8);
    number(footer.summary_crc, 4);
  });
}

void RecordWriter::schema(const Schema& schema) {
  record(Op::kSchema, [&] {
    number(schema.id, 2);
    text(schema.name);
    text(schema.encoding);
    text(schema.data);
  });
}

void RecordWriter::channel(const Channel& channel) {
  record(Op::kChannel, [&] {
    number(channel.id, 2);
    number(channel.schema_id, 2);
    text(channel.topic);
    text(channel.message_encoding);
    texts(channel.metadata);
  });
}

void RecordWriter::message(const MessageHead& head, Bytes data) {
  record(Op::kMessage, [&] {
    number(head.channel_id, 2);
    number(head.sequence, 4);
    number(bytes_of(head.log_time_ns), 8);
    number(bytes_of(head.publish_time_ns), 8);
    bytes(data);
  });
}

void RecordWriter::chunk(const ChunkHead& head, Bytes stored) {
  record(Op::kChunk, [&] {
    number(bytes_of(head.first_ns), 8);
    number(bytes_of(head.last_ns), 8);
    number(head.size, 8);
    number(head.crc, 4);
    text(head.compression);
    number(stored.size(), 8);
    bytes(stored);
  });
}

void RecordWriter::message_index(
    std::uint16_t channel_id,
    const std::vector<std::pair<Nanoseconds, std::uint64_t>>& entries) {
  record(Op::kMessageIndex, [&] {
    number(channel_id, 2);
    number(entries.size() * 16, 4);
    for (const auto& [time_ns, offset] : entries) {
      number(bytes_of(time_ns), 8);
      number(offset, 8);
    }
  });
}

void RecordWriter::chunk_index(const ChunkIndex& index) {
  record(Op::kChunkIndex, [&] {
    number(bytes_of(index.first_ns), 8);
    number(bytes_of(index.last_ns), 8);
    number(index.chunk_begin, 8);
    number(index.chunk_length, 8);
    numbers(index.message_index_begins);
    number(index.message_index_length, 8);
    text(index.compression);
    number(index.stored, 8);
    number(index.size, 8);
  });
}

void RecordWriter::statistics(const Statistics& statistics) {
  record(Op::kStatistics, [&] {
    number(statistics.messages, 8);
    number(statistics.schemas, 2);
    number(statistics.channels, 4);
    number(statistics.attachments, 4);
    number(statistics.metadata, 4);
    number(statistics.chunks, 4);
    number(bytes_of(statistics.first_ns), 8);
    number(bytes_of(statistics.last_ns), 8);
    numbers(statistics.channel_messages);
  });
}

void RecordWriter::metadata(const std::string& name,
                            const std::map<std::string, std::string>& values) {
  record(Op::kMetadata, [&] {
    text(name);
    texts(values);
  });
}

void RecordWriter::metadata_index(std::uint64_t begin,
                                  std::uint64_t length,
                                  const std::string& name) {
  record(Op::kMetadataIndex, [&] {
    number(begin, 8);
    number(length, 8);
    text(name);
  });
}

void RecordWriter::summary_offset(Op group, std::uint64_t begin, std::uint64_t length) {
  record(Op::kSummaryOffset, [&] {
    number(static_cast<std::uint64_t>(group), 1);
    number(begin, 8);
    number(length, 8);
  });
}

void RecordWriter::data_end(std::uint32_t data_crc) {
  record(Op::kDataEnd, [&] { number(data_crc, 4); });
}

}  // namespace trigpoint::recording::mcap
