// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// ROS bag format 2.0 [1] read record by record, for bags that rosbag_storage refuses because their
// index, which is at the end of the file, is missing.
//
// [1] http://wiki.ros.org/Bags/Format/2.0
#include "ros1_source.hpp"
#include "rosbag1_source.hpp"
#include <bzlib.h>
#include <roslz4/lz4s.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <map>
#include <set>
#include <span>

namespace trigpoint::recording {

namespace fs = std::filesystem;

namespace {

constexpr char kVersionLine[] = "#ROSBAG V2.0\n";
constexpr std::uint32_t kLongestHeader = 1U << 20U;
constexpr std::uint32_t kLargestData = 1U << 30U;

enum class BagOp : std::uint8_t { kMessage = 2, kChunk = 5, kConnection = 7 };

using View = std::span<const std::uint8_t>;

/// A number at the front of `bytes`; nullopt when they are too few.
template <class Number>
std::optional<Number> number_at(View bytes) {
  if (bytes.size() < sizeof(Number)) {
    return std::nullopt;
  }
  Number value;
  std::memcpy(&value, bytes.data(), sizeof(Number));
  return value;
}

/// Splits off a block with a uint32 length in front.
std::optional<View> take_block(View& rest) {
  const auto length = number_at<std::uint32_t>(rest);
  if (!length || *length > rest.size() - sizeof(std::uint32_t)) {
    return std::nullopt;
  }
  const View block = rest.subspan(sizeof(std::uint32_t), *length);
  rest = rest.subspan(sizeof(std::uint32_t) + *length);
  return block;
}

using Fields = std::map<std::string, View>;

Fields parse_fields(View header) {
  Fields fields;
  while (const auto field = take_block(header)) {
    const auto equals = std::find(field->begin(), field->end(), std::uint8_t{'='});
    if (equals != field->end()) {
      const auto name_length = static_cast<std::size_t>(equals - field->begin());
      fields[std::string(field->begin(), equals)] = field->subspan(name_length + 1);
    }
  }
  return fields;
}

template <class Number>
std::optional<Number> number_in(const Fields& fields, const std::string& name) {
  const auto found = fields.find(name);
  return found == fields.end() ? std::nullopt : number_at<Number>(found->second);
}

std::string text_in(const Fields& fields, const std::string& name) {
  const auto found = fields.find(name);
  return found == fields.end() ? "" : std::string(found->second.begin(), found->second.end());
}

/// The content of a chunk; nullopt when it does not decompress.
std::optional<std::vector<std::uint8_t>> unpacked(const Fields& fields, View data) {
  const auto compression = text_in(fields, "compression");
  if (compression == "none") {
    return std::vector<std::uint8_t>(data.begin(), data.end());
  }
  std::uint32_t size = std::min(number_in<std::uint32_t>(fields, "size").value_or(0), kLargestData);
  std::vector<std::uint8_t> content(size);
  auto* const in = const_cast<char*>(reinterpret_cast<const char*>(data.data()));
  auto* const out = reinterpret_cast<char*>(content.data());
  const auto in_size = static_cast<unsigned int>(data.size());
  bool good = false;
  if (compression == "bz2") {
    good = BZ2_bzBuffToBuffDecompress(out, &size, in, in_size, 0, 0) == BZ_OK;
  } else if (compression == "lz4") {
    good = roslz4_buffToBuffDecompress(in, in_size, out, &size) == ROSLZ4_OK;
  }
  return good ? std::optional(std::move(content)) : std::nullopt;
}

/// One record of the file or of a chunk.
struct Record {
  Fields fields;
  View data;
  BagOp op;
};

std::optional<Record> take_record(View& rest) {
  const auto header = take_block(rest);
  const auto data = header ? take_block(rest) : std::nullopt;
  if (!data) {
    return std::nullopt;
  }
  Record record{parse_fields(*header), *data, BagOp::kMessage};
  record.op = static_cast<BagOp>(number_in<std::uint8_t>(record.fields, "op").value_or(0));
  return record;
}

/// Where a chunk's bytes are in the file; re-read when its messages are wanted.
struct Chunk {
  std::uint64_t begin;
  std::uint64_t size;
};

struct Place {
  Nanoseconds receive_ns;
  std::string topic;
  std::size_t chunk;
  std::size_t offset;
  std::size_t size;
};

class SalvagedBag : public Ros1Source {
 public:
  explicit SalvagedBag(const fs::path& file) : stream_(file, std::ios::binary) {
    summary_.path = file.string();
    summary_.format = "rosbag1";
    char line[sizeof(kVersionLine) - 1] = {};
    stream_.read(line, sizeof(line));
    if (stream_.gcount() < static_cast<std::streamsize>(sizeof(line)) &&
        std::memcmp(line, kVersionLine, static_cast<std::size_t>(stream_.gcount())) == 0) {
      throw LogError(file.string() + ": the bag is cut off in its first line, after " +
                     std::to_string(stream_.gcount()) + " bytes; nothing can be read from it");
    }
    if (std::memcmp(line, kVersionLine, sizeof(line)) != 0) {
      throw LogError(file.string() +
                     ": is no ROS 1 bag of format 2.0 (its first line is not '#ROSBAG V2.0')");
    }
    size_ = fs::file_size(file);
    scan();
    summarize();
    break_ = file.string() + ": the bag breaks off after " + std::to_string(end_) + " of " +
             std::to_string(size_) +
             " bytes (no index: its recorder was killed, or the file is cut off)";
    if (chunks_.empty()) {
      throw LogError(file.string() + ": the bag is cut off in its header or its first chunk: of " +
                     std::to_string(size_) + " bytes, none belongs to a whole message");
    }
    summary_.faults.push_back(break_);
  }

  const LogSummary& summary() const override { return summary_; }

  void select(const std::vector<std::string>& topics) override {
    const std::set<std::string> wanted(topics.begin(), topics.end());
    std::erase_if(places_, [&](const Place& place) { return wanted.count(place.topic) == 0; });
    std::stable_sort(places_.begin(), places_.end(), [](const Place& a, const Place& b) {
      return a.receive_ns < b.receive_ns;
    });
  }

  std::optional<RawMessage> next() override {
    if (next_ == places_.size()) {
      throw LogError(break_ + "; what came before was read");
    }
    const Place& place = places_[next_++];
    if (place.chunk != loaded_) {
      content_ = content_of(chunks_[place.chunk]).value_or(std::vector<std::uint8_t>{});
      loaded_ = place.chunk;
    }
    RawMessage raw{place.receive_ns, place.topic, {}};
    if (place.offset + place.size <= content_.size()) {
      const auto begin = content_.begin() + static_cast<std::ptrdiff_t>(place.offset);
      raw.bytes.assign(begin, begin + static_cast<std::ptrdiff_t>(place.size));
    }
    return raw;
  }

 private:
  std::optional<std::vector<std::uint8_t>> read_at(std::uint64_t begin, std::uint64_t size) {
    if (begin + size > size_) {
      return std::nullopt;
    }
    std::vector<std::uint8_t> bytes(size);
    stream_.clear();
    stream_.seekg(static_cast<std::streamoff>(begin));
    stream_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
    return stream_ ? std::optional(std::move(bytes)) : std::nullopt;
  }

  /// The end of the record at `begin`, when the file holds all of it.
  std::optional<std::uint64_t> record_end(std::uint64_t begin) {
    const auto header = read_at(begin, 4);
    const auto header_length = header ? *number_at<std::uint32_t>(*header) : kLongestHeader + 1;
    if (header_length > kLongestHeader) {
      return std::nullopt;
    }
    const auto data = read_at(begin + 4 + header_length, 4);
    const auto end =
        data ? begin + 8 + header_length + *number_at<std::uint32_t>(*data) : size_ + 1;
    return end <= size_ ? std::optional(end) : std::nullopt;
  }

  std::optional<std::vector<std::uint8_t>> content_of(const Chunk& chunk) {
    const auto bytes = read_at(chunk.begin, chunk.size);
    if (!bytes) {
      return std::nullopt;
    }
    View rest(*bytes);
    const auto record = take_record(rest);
    return record ? unpacked(record->fields, record->data) : std::nullopt;
  }

  void scan() {
    end_ = sizeof(kVersionLine) - 1;
    while (const auto end = record_end(end_)) {
      const Chunk whole{end_, *end - end_};
      const auto bytes =
          *end - end_ <= kLargestData ? read_at(whole.begin, whole.size) : std::nullopt;
      View rest;
      if (bytes) {
        rest = *bytes;
      }
      const auto record = take_record(rest);
      if (!record || (record->op == BagOp::kChunk && !scan_chunk(whole, *record))) {
        return;
      }
      note_connection(*record);
      end_ = *end;
    }
  }

  bool scan_chunk(const Chunk& chunk, const Record& record) {
    const auto content = unpacked(record.fields, record.data);
    if (!content) {
      return false;
    }
    View rest(*content);
    while (const auto inner = take_record(rest)) {
      note_connection(*inner);
      if (inner->op == BagOp::kMessage) {
        note_message(*inner, static_cast<std::size_t>(inner->data.data() - content->data()));
      }
    }
    chunks_.push_back(chunk);
    return true;
  }

  void note_connection(const Record& record) {
    const auto id = number_in<std::uint32_t>(record.fields, "conn");
    if (record.op == BagOp::kConnection && id) {
      const std::string topic = text_in(record.fields, "topic");
      connections_[*id] = topic;
      types_[topic] = ros2_type_name(text_in(parse_fields(record.data), "type"));
    }
  }

  void note_message(const Record& record, std::size_t offset) {
    const auto id = number_in<std::uint32_t>(record.fields, "conn");
    const auto time = number_in<std::uint64_t>(record.fields, "time");  // sec, then nsec
    if (id && time && connections_.count(*id) > 0) {
      const Nanoseconds receive_ns =
          static_cast<Nanoseconds>(*time & 0xFFFFFFFFU) * kNanosecondsPerSecond +
          static_cast<Nanoseconds>(*time >> 32U);
      places_.push_back(
          {receive_ns, connections_[*id], chunks_.size(), offset, record.data.size()});
    }
  }

  void summarize() {
    std::map<std::string, std::uint64_t> counts;
    for (const Place& place : places_) {
      ++counts[place.topic];
      summary_.first_ns =
          summary_.first_ns == 0 ? place.receive_ns : std::min(summary_.first_ns, place.receive_ns);
      summary_.last_ns = std::max(summary_.last_ns, place.receive_ns);
    }
    for (const auto& [topic, type] : types_) {
      summary_.topics.push_back({topic, type, counts[topic]});
    }
  }

  std::ifstream stream_;
  std::uint64_t size_{0};
  std::uint64_t end_{0};
  std::string break_;
  LogSummary summary_;
  std::vector<Chunk> chunks_;
  std::map<std::uint32_t, std::string> connections_;
  std::map<std::string, std::string> types_;
  std::vector<Place> places_;
  std::size_t next_{0};
  std::size_t loaded_{static_cast<std::size_t>(-1)};
  std::vector<std::uint8_t> content_;
};

}  // namespace

std::unique_ptr<BagSource> salvage_rosbag1(const fs::path& file) {
  return std::make_unique<SalvagedBag>(file);
}

}  // namespace trigpoint::recording
