// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// MCAP as rosbag2_storage_mcap writes it: profile ros2, schemas ros2msg, QoS in the channels'
// metadata. Every commit is a zstd chunk with its CRC and its message indexes behind it; the
// summary comes with the end.
#include "trigpoint/bus/message_definition.hpp"

#include "bag_output.hpp"
#include "mcap_chunk.hpp"
#include "mcap_format.hpp"
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

namespace trigpoint::recording {

namespace {

using mcap::Bytes;
using mcap::Op;

/// Of a chunk in the summary, and of a channel in it.
constexpr std::uint64_t kChunkIndex_bytes = 100;
constexpr std::uint64_t kChannelIndex_bytes = 10;

/// A type that is not in idl/ is recorded without its definition, as the specification allows.
mcap::Schema schema_of(std::uint16_t id, const std::string& type) {
  try {
    return {id, type, "ros2msg", bus::message_definition(type)};
  } catch (const std::runtime_error&) {
    return {id, type, "", ""};
  }
}

class McapOutput : public BagOutput {
 public:
  McapOutput(std::string name, std::uint64_t largest_bytes)
      : name_(std::move(name)),
        largest_bytes_(largest_bytes),
        file_(::open(name_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666)) {
    if (file_ < 0) {
      throw LogError(name_ + ": cannot be created: " + std::strerror(errno));
    }
    mcap::RecordWriter begin;
    begin.bytes(mcap::kMagic);
    begin.header({"ros2", "trigpoint"});
    append(begin.content());
  }

  ~McapOutput() override { close_file(); }

  McapOutput(const McapOutput&) = delete;
  McapOutput& operator=(const McapOutput&) = delete;

  std::int64_t add_topic(const Rosbag2Topic& topic) override {
    if (channels_.size() > std::numeric_limits<std::uint16_t>::max()) {
      throw LogError(name_ + ": MCAP has no room for another topic");
    }
    mcap::Channel channel;
    channel.id = static_cast<std::uint16_t>(channels_.size());
    channel.schema_id = schema_id(topic.type);
    channel.topic = topic.name;
    channel.message_encoding = "cdr";
    channel.metadata["offered_qos_profiles"] = topic.offered_qos_profiles;
    chunk_.channel(channel);
    channels_.push_back(std::move(channel));
    return channels_.back().id;
  }

  void add_message(std::int64_t topic,
                   Nanoseconds receive_ns,
                   std::span<const std::uint8_t> cdr) override {
    const auto channel_id = static_cast<std::uint16_t>(topic);
    if (index_.empty()) {
      head_.first_ns = head_.last_ns = receive_ns;
    }
    head_.first_ns = std::min(head_.first_ns, receive_ns);
    head_.last_ns = std::max(head_.last_ns, receive_ns);
    index_[channel_id].emplace_back(receive_ns, chunk_.content().size());
    chunk_.message({channel_id, sequences_[channel_id]++, receive_ns, receive_ns}, cdr);
  }

  bool commit() override {
    if (chunk_.content().empty()) {
      return true;
    }
    const auto stored = mcap::compressed(chunk_.content());
    head_.size = chunk_.content().size();
    head_.crc = mcap::crc32_of(chunk_.content());
    head_.compression = "zstd";
    mcap::RecordWriter records;
    records.chunk(head_, stored);
    mcap::ChunkIndex index{head_.first_ns,
                           head_.last_ns,
                           end_,
                           records.content().size(),
                           {},
                           0,
                           head_.compression,
                           stored.size(),
                           head_.size};
    for (const auto& [channel_id, entries] : index_) {
      index.message_index_begins[channel_id] = end_ + records.content().size();
      records.message_index(channel_id, entries);
    }
    index.message_index_length = records.content().size() - index.chunk_length;
    if (largest_bytes_ > 0 && end_ + records.content().size() + summary_bytes() > largest_bytes_) {
      errno = ENOSPC;
      fail();
    }
    append(records.content());
    chunks_.push_back(std::move(index));
    count_committed();
    return true;
  }

  std::uint64_t closing_bytes(std::uint64_t message_bytes) const override {
    return 2 * (kCommit_bytes + message_bytes) + summary_bytes();
  }

  void finish(const std::optional<std::string>& metadata) override {
    mcap::RecordWriter records;
    std::uint64_t metadata_length = 0;
    if (metadata) {
      records.metadata(kMetadataName, {{"serialized_metadata", *metadata}});
      metadata_length = records.content().size();
      statistics_.metadata = 1;
    }
    const std::uint64_t metadata_begin = end_;
    records.data_end(mcap::crc32_of(records.content(), crc_));
    add_summary(records, metadata_begin, metadata_length);
    append(records.content());
    close_file();
  }

 private:
  static constexpr char kMetadataName[] = "rosbag2";

  std::uint16_t schema_id(const std::string& type) {
    const auto known =
        std::find_if(schemas_.begin(), schemas_.end(), [&](const mcap::Schema& schema) {
          return schema.name == type;
        });
    if (known != schemas_.end()) {
      return known->id;
    }
    schemas_.push_back(schema_of(static_cast<std::uint16_t>(schemas_.size() + 1), type));
    chunk_.schema(schemas_.back());
    return schemas_.back().id;
  }

  void count_committed() {
    const bool first = statistics_.messages == 0;
    for (const auto& [channel_id, entries] : index_) {
      statistics_.channel_messages[channel_id] += entries.size();
      statistics_.messages += entries.size();
    }
    if (!index_.empty()) {
      statistics_.first_ns =
          first ? head_.first_ns : std::min(statistics_.first_ns, head_.first_ns);
      statistics_.last_ns = std::max(statistics_.last_ns, head_.last_ns);
    }
    statistics_.schemas = static_cast<std::uint16_t>(schemas_.size());
    statistics_.channels = static_cast<std::uint32_t>(channels_.size());
    ++statistics_.chunks;
    index_.clear();
    chunk_.clear();
    head_ = {};
  }

  std::uint64_t summary_bytes() const {
    std::uint64_t bytes = 4096;
    for (const mcap::Schema& schema : schemas_) {
      bytes += schema.data.size() + schema.name.size() + 32;
    }
    for (const mcap::Channel& channel : channels_) {
      bytes += channel.topic.size() + 1024;
    }
    return bytes +
           (chunks_.size() + 1) * (kChunkIndex_bytes + kChannelIndex_bytes * channels_.size());
  }

  /// Of what is committed: the channels of a chunk that found no room are not in the file.
  void add_summary(mcap::RecordWriter& records,
                   std::uint64_t metadata_begin,
                   std::uint64_t metadata_length) {
    const std::uint64_t begin = records.content().size();
    std::vector<std::pair<Op, std::pair<std::uint64_t, std::uint64_t>>> groups;
    const auto group = [&](Op op, const auto& write) {
      const std::uint64_t group_begin = records.content().size();
      write();
      if (records.content().size() > group_begin) {
        groups.push_back({op, {end_ + group_begin, records.content().size() - group_begin}});
      }
    };
    group(Op::kSchema, [&] {
      std::for_each_n(schemas_.begin(), statistics_.schemas, [&](const auto& schema) {
        records.schema(schema);
      });
    });
    group(Op::kChannel, [&] {
      std::for_each_n(channels_.begin(), statistics_.channels, [&](const auto& channel) {
        records.channel(channel);
      });
    });
    group(Op::kStatistics, [&] { records.statistics(statistics_); });
    group(Op::kChunkIndex, [&] {
      for (const mcap::ChunkIndex& index : chunks_) {
        records.chunk_index(index);
      }
    });
    group(Op::kMetadataIndex, [&] {
      if (metadata_length > 0) {
        records.metadata_index(metadata_begin, metadata_length, kMetadataName);
      }
    });
    const std::uint64_t offsets_begin = records.content().size();
    for (const auto& [op, place] : groups) {
      records.summary_offset(op, place.first, place.second);
    }
    add_footer(records, begin, offsets_begin);
  }

  /// The CRC is over the summary and the footer up to the CRC itself.
  void add_footer(mcap::RecordWriter& records,
                  std::uint64_t summary_begin,
                  std::uint64_t offsets_begin) {
    const std::uint32_t crc = mcap::crc32_of(Bytes(records.content()).subspan(summary_begin));
    mcap::Footer footer{end_ + summary_begin, end_ + offsets_begin, 0};
    mcap::RecordWriter fields;
    fields.footer(footer);
    footer.summary_crc =
        mcap::crc32_of(Bytes(fields.content()).first(fields.content().size() - 4), crc);
    records.footer(footer);
    records.bytes(mcap::kMagic);
  }

  /// All or nothing.
  void append(Bytes bytes) {
    Bytes rest = bytes;
    while (!rest.empty()) {
      const auto at = static_cast<off_t>(end_ + (bytes.size() - rest.size()));
      const ssize_t written = ::pwrite(file_, rest.data(), rest.size(), at);
      if (written < 0 && errno == EINTR) {
        continue;
      }
      if (written < 0) {
        fail();
      }
      rest = rest.subspan(static_cast<std::size_t>(written));
    }
    if (::fdatasync(file_) != 0) {
      fail();
    }
    end_ += bytes.size();
    crc_ = mcap::crc32_of(bytes, crc_);
  }

  [[noreturn]] void fail() {
    const std::string reason = std::strerror(errno);
    [[maybe_unused]] const int cut = ::ftruncate(file_, static_cast<off_t>(end_));
    throw LogError(name_ + ": cannot be written: " + reason);
  }

  void close_file() {
    if (file_ >= 0) {
      ::close(std::exchange(file_, -1));
    }
  }

  std::string name_;
  std::uint64_t largest_bytes_;
  int file_;
  std::uint64_t end_{0};  ///< of what is committed, byte
  std::uint32_t crc_{0};  ///< of that
  std::vector<mcap::Schema> schemas_;
  std::vector<mcap::Channel> channels_;
  std::map<std::uint16_t, std::uint32_t> sequences_;
  mcap::RecordWriter chunk_;  ///< what waits for the commit
  mcap::ChunkHead head_;
  std::map<std::uint16_t, std::vector<std::pair<Nanoseconds, std::uint64_t>>> index_;
  std::vector<mcap::ChunkIndex> chunks_;
  mcap::Statistics statistics_;
};

}  // namespace

std::unique_ptr<BagOutput> create_mcap(const std::filesystem::path& file,
                                       std::uint64_t largest_bytes) {
  return std::make_unique<McapOutput>(file.string(), largest_bytes);
}

}  // namespace trigpoint::recording
