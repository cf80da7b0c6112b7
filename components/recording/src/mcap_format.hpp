// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The records of an MCAP file, version 0, as bytes: https://mcap.dev/spec. What they are used for
// is told by mcap_layout.hpp (reading) and mcap_output.hpp (writing).
#pragma once

#include "trigpoint/base/time.hpp"

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace trigpoint::recording::mcap {

using Bytes = std::span<const std::uint8_t>;

/// At the beginning and at the end of a file; the sixth byte is the version.
inline constexpr std::array<std::uint8_t, 8> kMagic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

enum class Op : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0A,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

/// Opcode and length, in front of every record.
inline constexpr std::uint64_t kHeadBytes = 9;
inline constexpr std::uint64_t kMessageHeadBytes = 22;  ///< of a Message, before its data
inline constexpr std::uint64_t kFooterBytes = 20;

struct RecordHead {
  Op op{};
  std::uint64_t length{0};  ///< of what follows
};

struct Header {
  std::string profile;
  std::string library;
};

struct Schema {
  std::uint16_t id{0};
  std::string name;
  std::string encoding;
  std::string data;
};

struct Channel {
  std::uint16_t id{0};
  std::uint16_t schema_id{0};
  std::string topic;
  std::string message_encoding;
  std::map<std::string, std::string> metadata;
};

struct MessageHead {
  std::uint16_t channel_id{0};
  std::uint32_t sequence{0};
  Nanoseconds log_time_ns{0};
  Nanoseconds publish_time_ns{0};
};

/// A Chunk up to its bytes.
struct ChunkHead {
  Nanoseconds first_ns{0};
  Nanoseconds last_ns{0};
  std::uint64_t size{0};    ///< uncompressed
  std::uint32_t crc{0};     ///< of the uncompressed bytes; 0: none
  std::string compression;  ///< "", "lz4", "zstd"
  std::uint64_t stored{0};  ///< as it lies in the file
};

struct ChunkIndex {
  Nanoseconds first_ns{0};
  Nanoseconds last_ns{0};
  std::uint64_t chunk_begin{0};   ///< byte of the file
  std::uint64_t chunk_length{0};  ///< with the record's head
  std::map<std::uint16_t, std::uint64_t> message_index_begins;
  std::uint64_t message_index_length{0};
  std::string compression;
  std::uint64_t stored{0};
  std::uint64_t size{0};
};

struct Statistics {
  std::uint64_t messages{0};
  std::uint16_t schemas{0};
  std::uint32_t channels{0};
  std::uint32_t attachments{0};
  std::uint32_t metadata{0};
  std::uint32_t chunks{0};
  Nanoseconds first_ns{0};
  Nanoseconds last_ns{0};
  std::map<std::uint16_t, std::uint64_t> channel_messages;
};

struct Footer {
  std::uint64_t summary_begin{0};
  std::uint64_t summary_offset_begin{0};
  std::uint32_t summary_crc{0};  ///< 0: none
};

/// CRC-32 as in zlib; goes on from `before`.
std::uint32_t crc32_of(Bytes bytes, std::uint32_t before = 0);

/// Fields one after another. Beyond the end everything is zero and empty, and good() is false.
class Cursor {
 public:
  explicit Cursor(Bytes bytes) : rest_(bytes) {}

  bool good() const { return good_; }

  Bytes rest() const { return rest_; }

  template <class Number>
  Number number() {
    Number value{0};
    const Bytes bytes = take(sizeof(Number));
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      value = static_cast<Number>(value | static_cast<Number>(std::uint64_t{bytes[i]} << (8 * i)));
    }
    return value;
  }

  /// Times are unsigned in the file; what is beyond int64 (the year 2262) is held there.
  Nanoseconds time();
  std::string text();

  /// With a 32-bit length in front.
  Bytes block() { return take(number<std::uint32_t>()); }

  Bytes take(std::uint64_t size);

 private:
  Bytes rest_;
  bool good_{true};
};

/// nullopt where a record is shorter than its fields; fields after those that are known are passed
/// over, as the specification asks.
std::optional<RecordHead> parse_head(Bytes bytes);
std::optional<Header> parse_header(Bytes record);
std::optional<Schema> parse_schema(Bytes record);
std::optional<Channel> parse_channel(Bytes record);
std::optional<MessageHead> parse_message_head(Bytes record);
std::optional<ChunkIndex> parse_chunk_index(Bytes record);
std::optional<Statistics> parse_statistics(Bytes record);
std::optional<Footer> parse_footer(Bytes record);
/// And how many bytes of the record it takes.
std::optional<std::pair<ChunkHead, std::uint64_t>> parse_chunk_head(Bytes record);

/// Takes one whole record off the front; nullopt when the bytes hold none.
std::optional<std::pair<RecordHead, Bytes>> take_record(Bytes& rest);

/// Builds records one after another.
class RecordWriter {
 public:
  void header(const Header& header);
  void footer(const Footer& footer);
  void schema(const Schema& schema);
  void channel(const Channel& channel);
  void message(const MessageHead& head, Bytes data);
  void chunk(const ChunkHead& head, Bytes stored);
  /// `entries` are times and offsets in the uncompressed chunk.
  void message_index(std::uint16_t channel_id,
                     const std::vector<std::pair<Nanoseconds, std::uint64_t>>& entries);
  void chunk_index(const ChunkIndex& index);
  void statistics(const Statistics& statistics);
  void metadata(const std::string& name, const std::map<std::string, std::string>& values);
  void metadata_index(std::uint64_t begin, std::uint64_t length, const std::string& name);
  void summary_offset(Op group, std::uint64_t begin, std::uint64_t length);
  void data_end(std::uint32_t data_crc);
  void bytes(Bytes bytes);

  const std::vector<std::uint8_t>& content() const { return content_; }

  void clear() { content_.clear(); }

 private:
  template <class Fields>
  void record(Op op, Fields&& fields);
  void number(std::uint64_t value, std::size_t bytes);
  void text(const std::string& text);
  void texts(const std::map<std::string, std::string>& values);
  void numbers(const std::map<std::uint16_t, std::uint64_t>& values);

  std::vector<std::uint8_t> content_;
};

}  // namespace trigpoint::recording::mcap
