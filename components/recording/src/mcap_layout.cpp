// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "mcap_layout.hpp"

#include "trigpoint/recording/log.hpp"

#include <algorithm>
#include <set>

namespace trigpoint::recording::mcap {

namespace {

/// Message records outside of chunks are read in stretches of this size.
constexpr std::uint64_t kStretch_bytes = 1U << 20U;
/// Beyond this a schema, a channel or a header is taken for damaged.
constexpr std::uint64_t kLongestText_bytes = 16U << 20U;
constexpr std::uint64_t kLargestSummary_bytes = 1U << 30U;
/// A chunk's fields before its bytes, with a long name of a compression.
constexpr std::size_t kChunkHead_bytes = 128;
constexpr std::uint64_t kDataEnd_bytes = kHeadBytes + 4;
constexpr std::uint64_t kTail_bytes = kHeadBytes + kFooterBytes + kMagic.size();

class Scanner {
 public:
  explicit Scanner(InputFile& file) : file_(file) {}

  Layout scan() {
    const std::uint64_t begin = read_header();
    read_footer();
    walk(begin);
    return std::move(layout_);
  }

 private:
  std::string at(std::uint64_t byte) const {
    return "byte " + std::to_string(byte) + " of " + std::to_string(file_.size());
  }

  std::uint64_t read_header() {
    const auto begin = file_.peek(0, kMagic.size());
    if (!std::equal(begin.begin(), begin.end(), kMagic.begin())) {
      const bool other_version = begin.size() == kMagic.size() &&
                                 std::equal(begin.begin(), begin.begin() + 5, kMagic.begin());
      throw LogError(file_.name() + (other_version
                                         ? ": is an MCAP file of another version than 0"
                                         : ": is no MCAP file (it does not begin like one)"));
    }
    const auto head = parse_head(file_.peek(kMagic.size(), kHeadBytes));
    const auto record =
        head && head->op == Op::kHeader ? record_at(kMagic.size(), *head) : std::nullopt;
    const auto header = record ? parse_header(*record) : std::nullopt;
    if (!header) {
      throw LogError(file_.name() + ": the MCAP file is cut off or damaged in its header, of " +
                     std::to_string(file_.size()) + " bytes none belongs to a message");
    }
    layout_.header = *header;
    return kMagic.size() + kHeadBytes + head->length;
  }

  /// nullopt when the file has not all of it, or it is too long for what it should be.
  std::optional<std::vector<std::uint8_t>> record_at(std::uint64_t begin, const RecordHead& head) {
    return head.length <= kLongestText_bytes ? file_.read(begin + kHeadBytes, head.length)
                                             : std::nullopt;
  }

  void read_footer() {
    if (file_.size() < kTail_bytes) {
      return;
    }
    const std::uint64_t begin = file_.size() - kTail_bytes;
    const auto tail = file_.peek(begin, kTail_bytes);
    const auto head = parse_head(tail);
    const bool whole = tail.size() == kTail_bytes && head->op == Op::kFooter &&
                       head->length == kFooterBytes &&
                       std::equal(kMagic.begin(), kMagic.end(), tail.end() - kMagic.size());
    if (!whole) {
      return;
    }
    footer_begin_ = begin;
    const auto footer = parse_footer(tail.subspan(kHeadBytes, kFooterBytes));
    data_section_end_ = begin;
    if (footer->summary_begin != 0) {
      read_summary(*footer);
    }
  }

  void read_summary(const Footer& footer) {
    const std::uint64_t begin = footer.summary_begin;
    const std::uint64_t end = *footer_begin_;
    const auto bytes = begin <= end && end - begin <= kLargestSummary_bytes
                           ? file_.read(begin, end - begin + kHeadBytes + kFooterBytes - 4)
                           : std::nullopt;
    std::string problem = bytes ? "" : "its end says that it begins there";
    if (bytes && footer.summary_crc != 0 && crc32_of(*bytes) != footer.summary_crc) {
      problem = "its CRC does not fit its bytes";
    } else if (bytes && !take_summary(Bytes(*bytes).first(end - begin))) {
      problem = "a record of it is damaged";
    }
    if (problem.empty()) {
      data_section_end_ = begin;
      return;
    }
    layout_.schemas.clear();
    layout_.channels.clear();
    layout_.statistics.reset();
    chunk_begins_.clear();
    data_section_end_.reset();
    layout_.faults.push_back(file_.name() + ": the summary at " + at(begin) + " is damaged (" +
                             problem + "); the file is read without it");
  }

  bool take_summary(Bytes rest) {
    while (!rest.empty()) {
      const auto record = take_record(rest);
      if (!record || !take_summary_record(record->first.op, record->second)) {
        return false;
      }
    }
    return true;
  }

  bool take_summary_record(Op op, Bytes record) {
    switch (op) {
      case Op::kStatistics:
        layout_.statistics = parse_statistics(record);
        return layout_.statistics.has_value();
      case Op::kChunkIndex: {
        const auto index = parse_chunk_index(record);
        chunk_begins_.insert(index ? index->chunk_begin : 0);
        return index.has_value();
      }
      default:
        return take_definition(op, record, layout_);
    }
  }

  void walk(std::uint64_t begin) {
    std::optional<std::uint64_t> next = begin;
    while (next && !ended_) {
      begin = *next;
      next = step(begin);
      if (!next && !ended_) {
        next = after_break(begin);
      }
    }
    if (!unknown_.empty()) {
      layout_.faults.push_back(file_.name() + ": " + std::to_string(unknown_count_) +
                               " records of a kind that is not known here are passed over; "
                               "the first is " +
                               unknown_);
    }
    if (data_end_seen_ && !footer_begin_) {
      layout_.faults.push_back(file_.name() +
                               ": does not end as it should, it may be cut off in its summary; its "
                               "messages are all there");
    }
  }

  /// Where the next record begins; nullopt at the end, or where there is none.
  std::optional<std::uint64_t> step(std::uint64_t begin) {
    if (begin == file_.size() || begin == footer_begin_) {
      return end_without_record(begin);
    }
    const auto head = parse_head(file_.peek(begin, kHeadBytes));
    if (!head || head->length > file_.size() - begin - kHeadBytes) {
      return std::nullopt;
    }
    const std::uint64_t end = begin + kHeadBytes + head->length;
    switch (head->op) {
      case Op::kMessage:
        return note_message(begin, end) ? std::optional(end) : std::nullopt;
      case Op::kChunk:
        note_chunk(begin, end);
        return end;
      case Op::kSchema:
      case Op::kChannel: {
        const auto record = record_at(begin, *head);
        return record && take_definition(head->op, *record, layout_) ? std::optional(end)
                                                                     : std::nullopt;
      }
      case Op::kMessageIndex:
      case Op::kAttachment:
      case Op::kMetadata:
        return end;
      case Op::kDataEnd:
        return take_data_end(begin, *head);
      default:
        return static_cast<std::uint8_t>(head->op) != 0 && pass_over(begin, *head)
                   ? std::optional(end)
                   : std::nullopt;
    }
  }

  bool pass_over(std::uint64_t begin, const RecordHead& head) {
    if (unknown_.empty()) {
      unknown_ = "of kind " + std::to_string(static_cast<unsigned>(head.op)) + " at " + at(begin);
    }
    ++unknown_count_;
    return true;
  }

  /// A writer that was killed between two records, or one that leaves the DataEnd record out.
  std::optional<std::uint64_t> end_without_record(std::uint64_t begin) {
    ended_ = true;
    layout_.data_end = begin;
    if (begin == file_.size()) {
      layout_.faults.push_back(file_.name() +
                               ": has no end: its recorder was killed or still writes; its last "
                               "second may be missing");
    }
    return std::nullopt;
  }

  std::optional<std::uint64_t> take_data_end(std::uint64_t begin, const RecordHead& head) {
    const std::uint64_t end = begin + kHeadBytes + head.length;
    if (head.length < kDataEnd_bytes - kHeadBytes ||
        (data_section_end_ && end != *data_section_end_)) {
      return std::nullopt;
    }
    Cursor cursor(file_.peek(begin + kHeadBytes, 4));
    layout_.data_crc = cursor.number<std::uint32_t>();
    layout_.data_end = begin;
    data_end_seen_ = ended_ = true;
    return std::nullopt;
  }

  bool note_message(std::uint64_t begin, std::uint64_t end) {
    const auto head = parse_message_head(file_.peek(begin + kHeadBytes, kMessageHeadBytes));
    if (!head || end - begin < kHeadBytes + kMessageHeadBytes) {
      return false;
    }
    const Nanoseconds time_ns = head->log_time_ns;
    const bool goes_on = !layout_.blocks.empty() && !layout_.blocks.back().chunk &&
                         layout_.blocks.back().begin + layout_.blocks.back().length == begin &&
                         end - layout_.blocks.back().begin <= kStretch_bytes;
    if (!goes_on) {
      layout_.blocks.push_back({begin, end - begin, false, time_ns, time_ns});
      return true;
    }
    Block& block = layout_.blocks.back();
    block.length = end - block.begin;
    block.first_ns = std::min(block.first_ns, time_ns);
    block.last_ns = std::max(block.last_ns, time_ns);
    return true;
  }

  /// A head that can't be read is told when the chunk is.
  void note_chunk(std::uint64_t begin, std::uint64_t end) {
    const std::uint64_t length = end - begin;
    const auto head = parse_chunk_head(file_.peek(
        begin + kHeadBytes, std::min<std::uint64_t>(kChunkHead_bytes, length - kHeadBytes)));
    Block block{begin, length, true, 0, 0};
    if (head) {
      std::tie(block.first_ns, block.last_ns) =
          std::minmax(head->first.first_ns, head->first.last_ns);
    }
    layout_.blocks.push_back(block);
  }

  /// The next chunk that the summary knows, after what can't be read.
  std::optional<std::uint64_t> after_break(std::uint64_t begin) {
    const auto found = chunk_begins_.upper_bound(begin);
    std::string damage = file_.name();
    if (found != chunk_begins_.end() && *found < file_.size()) {
      damage += ": is damaged at " + at(begin) + "; it is read again from byte " +
                std::to_string(*found) + " on";
    } else if (footer_begin_) {
      damage += ": is damaged at " + at(begin) + "; what comes after it is not read";
    } else {
      damage += ": the file breaks off at " + at(begin) +
                " (no end: its recorder was killed, or the file is cut off)";
    }
    layout_.damages.push_back(damage);
    return found != chunk_begins_.end() && *found < file_.size() ? std::optional(*found)
                                                                 : std::nullopt;
  }

  InputFile& file_;
  Layout layout_;
  std::optional<std::uint64_t> footer_begin_;
  std::optional<std::uint64_t> data_section_end_;  ///< where the summary or the footer begins
  std::set<std::uint64_t> chunk_begins_;           ///< as the summary has them
  bool ended_{false};
  bool data_end_seen_{false};
  std::string unknown_;
  std::uint64_t unknown_count_{0};
};

}  // namespace

bool take_definition(Op op, Bytes record, Layout& layout) {
  if (op == Op::kSchema) {
    auto schema = parse_schema(record);
    if (schema) {
      schema->data.clear();
      layout.schemas.emplace(schema->id, std::move(*schema));
    }
    return schema.has_value();
  }
  if (op == Op::kChannel) {
    auto channel = parse_channel(record);
    if (channel) {
      layout.channels.emplace(channel->id, std::move(*channel));
    }
    return channel.has_value();
  }
  return true;
}

Layout scan(InputFile& file) {
  return Scanner(file).scan();
}

}  // namespace trigpoint::recording::mcap
