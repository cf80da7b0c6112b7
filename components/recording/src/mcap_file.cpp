// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "mcap_file.hpp"

#include "input_file.hpp"
#include "mcap_chunk.hpp"
#include "mcap_layout.hpp"
#include <zlib.h>

#include <algorithm>
#include <fstream>
#include <numeric>
#include <utility>

namespace trigpoint::recording {

namespace fs = std::filesystem;

namespace {

using mcap::Block;
using mcap::Bytes;
using mcap::Op;

/// So many damages are told one by one.
constexpr std::size_t kToldDamages = 5;

/// How a channel's messages are read.
enum class Encoding { kCdr, kRos1, kOther };

Encoding encoding_of(const mcap::Channel& channel, const mcap::Schema& schema) {
  if (channel.message_encoding == "cdr" &&
      (schema.encoding == "ros2msg" || schema.encoding == "ros2idl" || schema.encoding.empty())) {
    return Encoding::kCdr;
  }
  return channel.message_encoding == "ros1" && schema.encoding == "ros1msg" ? Encoding::kRos1
                                                                            : Encoding::kOther;
}

/// A type whose messages can't be read has its encoding in its name, so that it is told when it is
/// asked for.
std::string type_of(const mcap::Channel& channel, const mcap::Schema& schema) {
  if (encoding_of(channel, schema) != Encoding::kOther) {
    return ros2_type_name(schema.name);
  }
  const std::string in = schema.encoding.empty() || schema.encoding == channel.message_encoding
                             ? channel.message_encoding
                             : channel.message_encoding + ", " + schema.encoding;
  return (schema.name.empty() ? "?" : schema.name) + " encoded as '" + in + "'";
}

std::string seconds(Nanoseconds time_ns) {
  return std::to_string(to_seconds(time_ns)) + " s";
}

/// A message in the records of its block.
struct PlaceInFile {
  Nanoseconds time_ns{0};
  std::uint64_t offset{0};  ///< of its data
  std::uint64_t size{0};
  std::uint16_t channel_id{0};
};

/// A block whose messages are not all delivered.
struct Open {
  std::vector<std::uint8_t> records;  ///< empty: to be read again
  std::vector<PlaceInFile> places;    ///< in order of time
  std::size_t at{0};
};

class McapFile : public BagFile {
 public:
  McapFile(const std::string& name, std::uint64_t held_bytes)
      : held_limit_(held_bytes), file_(name) {
    layout_ = mcap::scan(file_);
    damages_ = layout_.damages;
    if (summary_tells_all()) {
      take_summary(*layout_.statistics);
    } else {
      look_through();
    }
    faults_ = damages_;
    faults_.insert(faults_.end(), layout_.faults.begin(), layout_.faults.end());
  }

  std::vector<TopicSummary> topics() const override {
    std::map<std::string, TopicSummary> topics;
    for (const auto& [id, channel] : layout_.channels) {
      auto& topic = topics[channel.topic];
      topic.topic = channel.topic;
      topic.type = topic.type.empty() ? type_of(channel, schema_of(channel)) : topic.type;
      const auto count = counts_.find(id);
      topic.messages += count == counts_.end() ? 0 : count->second;
    }
    std::vector<TopicSummary> list;
    for (auto& [name, topic] : topics) {
      list.push_back(std::move(topic));
    }
    return list;
  }

  std::optional<Nanoseconds> first_ns() const override { return first_ns_; }

  Nanoseconds last_ns() const override { return last_ns_; }

  std::vector<std::string> faults() const override { return faults_; }

  std::set<std::string> ros1_topics() const override {
    std::set<std::string> topics;
    for (const auto& [id, channel] : layout_.channels) {
      if (encoding_of(channel, schema_of(channel)) == Encoding::kRos1) {
        topics.insert(channel.topic);
      }
    }
    return topics;
  }

  void select(const std::set<std::string>& topics) override {
    for (const auto& [id, channel] : layout_.channels) {
      if (topics.count(channel.topic) > 0) {
        selected_.insert(id);
      }
    }
    order_.resize(layout_.blocks.size());
    std::iota(order_.begin(), order_.end(), std::size_t{0});
    std::stable_sort(order_.begin(), order_.end(), [this](std::size_t a, std::size_t b) {
      return layout_.blocks[a].first_ns < layout_.blocks[b].first_ns;
    });
  }

  std::optional<RawMessage> next() override {
    while (next_block_ < order_.size() &&
           (open_.empty() ||
            layout_.blocks[order_[next_block_]].first_ns <= open_.begin()->first.first)) {
      open_block(order_[next_block_++]);
    }
    if (open_.empty()) {
      finish();
      return std::nullopt;
    }
    auto node = open_.extract(open_.begin());
    const std::size_t block = node.key().second;
    std::optional<RawMessage> raw = message_of(block, node.mapped());
    if (++node.mapped().at < node.mapped().places.size()) {
      node.key() = {node.mapped().places[node.mapped().at].time_ns, block};
      open_.insert(std::move(node));
      let_go();
    } else {
      held_bytes_ -= node.mapped().records.size();
    }
    return raw ? std::move(raw) : next();
  }

 private:
  /// Channels and how many messages each has, without looking into the chunks.
  bool summary_tells_all() const {
    const auto& statistics = layout_.statistics;
    if (!statistics || !damages_.empty() || layout_.channels.size() != statistics->channels) {
      return false;
    }
    const auto has_schema = [this](const auto& channel) {
      return channel.second.schema_id == 0 || layout_.schemas.count(channel.second.schema_id) > 0;
    };
    std::uint64_t sum = 0;
    for (const auto& [id, count] : statistics->channel_messages) {
      sum += layout_.channels.count(id) > 0 ? count : 0;
    }
    return sum == statistics->messages &&
           std::all_of(layout_.channels.begin(), layout_.channels.end(), has_schema);
  }

  /// The blocks may widen the span of time, so that statistics that lie hide no message.
  void take_summary(const mcap::Statistics& statistics) {
    counts_ = statistics.channel_messages;
    if (statistics.messages == 0) {
      return;
    }
    first_ns_ = statistics.first_ns;
    last_ns_ = statistics.last_ns;
    for (const Block& block : layout_.blocks) {
      const bool empty = block.first_ns == 0 && block.last_ns == 0;
      first_ns_ = empty ? *first_ns_ : std::min(*first_ns_, block.first_ns);
      last_ns_ = std::max(last_ns_, block.last_ns);
    }
  }

  const mcap::Schema& schema_of(const mcap::Channel& channel) const {
    static const mcap::Schema none;
    const auto found = layout_.schemas.find(channel.schema_id);
    return found == layout_.schemas.end() ? none : found->second;
  }

  /// Every block once, for what a summary would have told.
  void look_through() {
    std::vector<Block> readable;
    for (Block block : layout_.blocks) {
      const auto records = records_of(block, nullptr);
      if (!records) {
        continue;
      }
      bool any = false;
      const auto places = places_in(*records, block);
      for (const PlaceInFile& place : places) {
        ++counts_[place.channel_id];
        block.first_ns = any ? std::min(block.first_ns, place.time_ns) : place.time_ns;
        block.last_ns = any ? std::max(block.last_ns, place.time_ns) : place.time_ns;
        any = true;
      }
      if (any) {
        first_ns_ = std::min(first_ns_.value_or(block.first_ns), block.first_ns);
        last_ns_ = std::max(last_ns_, block.last_ns);
        readable.push_back(block);
      }
    }
    layout_.blocks = std::move(readable);
    layout_.statistics.reset();
    tell_strangers();
  }

  /// Messages that no Channel record describes.
  void tell_strangers() {
    std::uint64_t strangers = 0;
    for (const auto& [id, count] : counts_) {
      strangers += layout_.channels.count(id) > 0 ? 0 : count;
    }
    if (strangers > 0) {
      damages_.push_back(file_.name() + ": " + std::to_string(strangers) +
                         " messages are of channels that the file does not describe");
    }
  }

  std::string name_of(const Block& block) const {
    return file_.name() + ": the " + (block.chunk ? "chunk" : "messages") + " at byte " +
           std::to_string(block.begin) + " (" + seconds(block.first_ns) + " to " +
           seconds(block.last_ns) + ")";
  }

  /// nullopt, and a damage, when they can't be had. `crc`: of the bytes in the file.
  std::optional<std::vector<std::uint8_t>> records_of(const Block& block, std::uint32_t* crc) {
    std::string problem = "larger than 1 GiB";
    if (block.length <= mcap::kLargestChunk_bytes) {
      auto bytes = file_.read(block.begin, block.length);
      if (bytes && crc != nullptr) {
        *crc = mcap::crc32_of(*bytes);
      }
      if (bytes && !block.chunk) {
        return bytes;
      }
      auto unpacked = bytes ? mcap::unpack_chunk(Bytes(*bytes).subspan(mcap::kHeadBytes))
                            : mcap::Unpacked{{}, "the disk does not give it"};
      if (unpacked.problem.empty()) {
        return std::move(unpacked.records);
      }
      problem = unpacked.problem;
    }
    damages_.push_back(name_of(block) + " can't be read and is left out: " + problem);
    return std::nullopt;
  }

  /// All messages in the records, in their order there; notes channels and schemas on the way.
  std::vector<PlaceInFile> places_in(const std::vector<std::uint8_t>& records, const Block& block) {
    std::vector<PlaceInFile> places;
    Bytes rest(records);
    while (!rest.empty()) {
      const auto record = mcap::take_record(rest);
      if (!record || !take(record->first.op, record->second, records, places)) {
        damages_.push_back(name_of(block) + " is damaged inside, at byte " +
                           std::to_string(records.size() - rest.size()) +
                           " of its records; what follows there is left out");
        break;
      }
    }
    return places;
  }

  bool take(Op op,
            Bytes record,
            const std::vector<std::uint8_t>& records,
            std::vector<PlaceInFile>& places) {
    if (op == Op::kMessage) {
      const auto head = mcap::parse_message_head(record);
      if (head) {
        const Bytes data = record.subspan(mcap::kMessageHeadBytes);
        const auto offset = static_cast<std::uint64_t>(data.data() - records.data());
        places.push_back({head->log_time_ns, offset, data.size(), head->channel_id});
      }
      return head.has_value();
    }
    return static_cast<std::uint8_t>(op) != 0 && mcap::take_definition(op, record, layout_);
  }

  void open_block(std::size_t number) {
    const Block& block = layout_.blocks[number];
    std::uint32_t crc = 0;
    auto records = records_of(block, layout_.data_crc == 0 ? nullptr : &crc);
    if (!records) {
      return;
    }
    block_crcs_[number] = crc;
    Open open{std::move(*records), {}, 0};
    open.places = places_in(open.records, block);
    seen_messages_ += open.places.size();
    std::erase_if(open.places, [this](const PlaceInFile& place) {
      return selected_.count(place.channel_id) == 0;
    });
    std::stable_sort(
        open.places.begin(), open.places.end(), [](const PlaceInFile& a, const PlaceInFile& b) {
          return a.time_ns < b.time_ns;
        });
    if (open.places.empty()) {
      return;
    }
    held_bytes_ += open.records.size();
    open_.emplace(std::pair(open.places.front().time_ns, number), std::move(open));
    let_go();
  }

  /// Where blocks overlap so much that memory would end, those whose messages come last are read
  /// once more later.
  void let_go() {
    for (auto last = open_.rbegin(); held_bytes_ > held_limit_ && last != open_.rend(); ++last) {
      if (std::next(last) == open_.rend()) {
        return;
      }
      held_bytes_ -= last->second.records.size();
      last->second.records = {};
    }
  }

  /// A chunk that lies about its beginning comes too late; its messages are not lost for that, but
  /// their arrival is no earlier than what was delivered before. nullopt when the disk has lost it.
  std::optional<RawMessage> message_of(std::size_t block, Open& open) {
    const PlaceInFile& place = open.places[open.at];
    if (open.records.empty()) {
      auto records = records_of(layout_.blocks[block], nullptr);
      if (!records) {
        open.places.resize(open.at + 1);
        return std::nullopt;
      }
      open.records = std::move(*records);
      held_bytes_ += open.records.size();
    }
    if (place.time_ns < now_ns_ && late_++ == 0) {
      damages_.push_back(name_of(layout_.blocks[block]) + " begins before it says so, at " +
                         seconds(place.time_ns) + "; its messages come too late");
    }
    now_ns_ = std::max(now_ns_, place.time_ns);
    RawMessage raw{now_ns_, layout_.channels.at(place.channel_id).topic, {}};
    const auto begin = open.records.begin() + static_cast<std::ptrdiff_t>(place.offset);
    raw.bytes.assign(begin, begin + static_cast<std::ptrdiff_t>(place.size));
    return raw;
  }

  /// Throws LogError when messages were out of reach, or are not what was written.
  void finish() {
    if (layout_.statistics && seen_messages_ != layout_.statistics->messages) {
      damages_.push_back(file_.name() + ": has " + std::to_string(seen_messages_) + " of the " +
                         std::to_string(layout_.statistics->messages) +
                         " messages that its summary counts");
    }
    check_data_crc();
    if (damages_.empty()) {
      return;
    }
    std::string text;
    for (std::size_t i = 0; i < std::min(damages_.size(), kToldDamages); ++i) {
      text += (i == 0 ? "" : "\n") + damages_[i];
    }
    if (damages_.size() > kToldDamages) {
      text += "\nand " + std::to_string(damages_.size() - kToldDamages) + " more like these";
    }
    throw LogError(text + "; the other messages in it were read");
  }

  /// Over the whole file up to the DataEnd record, put together of the blocks that were read and
  /// what lies between them.
  void check_data_crc() {
    if (layout_.data_crc == 0 || !damages_.empty()) {
      return;
    }
    std::uint32_t crc = 0;
    std::uint64_t at = 0;
    const auto go_on_to = [&](std::uint64_t end) {
      constexpr std::uint64_t kStep_bytes = 1U << 20U;
      while (at < end) {
        const auto bytes = file_.read(at, std::min(end - at, kStep_bytes));
        crc = bytes ? mcap::crc32_of(*bytes, crc) : ~crc;
        at += std::min(end - at, kStep_bytes);
      }
    };
    for (const auto& [number, block_crc] : block_crcs_) {
      const Block& block = layout_.blocks[number];
      go_on_to(block.begin);
      crc = static_cast<std::uint32_t>(
          crc32_combine(crc, block_crc, static_cast<z_off_t>(block.length)));
      at += block.length;
    }
    go_on_to(layout_.data_end);
    if (crc != layout_.data_crc) {
      damages_.push_back(file_.name() + ": the CRC at byte " + std::to_string(layout_.data_end) +
                         " does not fit the bytes before it: at least one has changed since it was "
                         "written, in a message or beside them");
    }
  }

  std::uint64_t held_limit_;
  InputFile file_;
  mcap::Layout layout_;
  std::vector<std::string> damages_;
  std::vector<std::string> faults_;
  std::map<std::uint16_t, std::uint64_t> counts_;  ///< messages by channel
  std::optional<Nanoseconds> first_ns_;
  Nanoseconds last_ns_{0};
  std::set<std::uint16_t> selected_;
  std::vector<std::size_t> order_;  ///< blocks by their first message
  std::size_t next_block_{0};
  std::map<std::pair<Nanoseconds, std::size_t>, Open> open_;  ///< by next message and block
  std::uint64_t held_bytes_{0};
  std::uint64_t seen_messages_{0};
  std::uint64_t late_{0};
  Nanoseconds now_ns_{0};
  std::map<std::size_t, std::uint32_t> block_crcs_;
};

}  // namespace

bool is_mcap(const fs::path& file) {
  constexpr std::string_view kBegin = "\x89MCAP";
  std::string begin(kBegin.size(), ' ');
  std::ifstream(file, std::ios::binary)
      .read(begin.data(), static_cast<std::streamsize>(begin.size()));
  return begin == kBegin || file.extension() == ".mcap";
}

std::unique_ptr<BagFile> open_mcap_file(const fs::path& file, std::uint64_t held_bytes) {
  if (fs::file_size(file) == 0) {
    throw LogError(file.string() + ": the file is empty");
  }
  return std::make_unique<McapFile>(file.string(), held_bytes);
}

}  // namespace trigpoint::recording
