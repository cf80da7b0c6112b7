// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "incoming_samples.hpp"

#include "rtps_limits.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>

namespace trigpoint::bus {

namespace {

constexpr std::size_t kPrefix_bytes = 12;  // of a GUID, the rest is the entity
constexpr std::size_t kPrefixOfMessageAt = 8;
// In a submessage with its header. RTPS 2.3: 8.3.7, 9.4.5.
constexpr std::size_t kPrefixOfSourceAt = 12;
constexpr std::size_t kToInlineQosAt = 6;
constexpr std::size_t kAfterToInlineQos = 8;
constexpr std::size_t kFirstFragmentAt = 24;
constexpr std::size_t kFragmentCountAt = 28;
constexpr std::size_t kFragmentSizeAt = 30;
constexpr std::size_t kSampleSizeAt = 32;

/// What the middleware itself needs for a sample, however small.
constexpr std::int64_t kLeast_bytes = 1024;
/// Of each writer; then the oldest are forgotten.
constexpr std::size_t kMostFinished = 1024;
constexpr std::chrono::seconds kForgotten{30};

/// Between two searches for such.
constexpr std::chrono::milliseconds kBetweenSearches{100};
/// Of a sample: 256 MB in pieces of 256 bytes.
constexpr std::uint64_t kMostFragments = 1'000'000;

constexpr std::array<std::int64_t, 2> kBudgets{kIncompleteBulk_bytes, kIncompleteOther_bytes};

std::int64_t cost_bytes(std::int64_t size_bytes) {
  return std::max(size_bytes, kLeast_bytes);
}

/// What discovery and security use.
bool is_builtin(const Guid& writer) {
  return (writer.back() & 0xC0U) == 0xC0U;
}

void set_prefix(Guid& source, std::span<const std::uint8_t> bytes, std::size_t place) {
  if (bytes.size() >= place + kPrefix_bytes) {
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(place), kPrefix_bytes, source.begin());
  }
}

void set_entity(Guid& source, EntityNumber entity) {
  for (unsigned i = 0; i < 4; ++i) {
    source[kPrefix_bytes + i] = static_cast<std::uint8_t>(entity >> (24 - 8 * i));
  }
}

}  // namespace

struct IncomingSamples::Fragments {
  Guid writer{};
  Time now;
  std::uint64_t number{0};
  std::int64_t size_bytes{0};
  std::uint32_t fragment_bytes{0};
  std::uint64_t first{0};  ///< counted from 0
  std::uint64_t count{0};
  std::uint64_t of{0};  ///< the sample's

  /// False when the submessage contradicts itself.
  bool read(const Submessage& part) {
    const auto carried = carried_by(part);
    const auto begin = part.word_at(kFirstFragmentAt).value_or(0);
    fragment_bytes = part.half_word_at(kFragmentSizeAt).value_or(0);
    size_bytes = part.word_at(kSampleSizeAt).value_or(0);
    count = part.half_word_at(kFragmentCountAt).value_or(0);
    if (!carried || begin == 0 || fragment_bytes == 0 || size_bytes == 0 || count == 0) {
      return false;
    }
    set_entity(writer, carried->writer);
    number = carried->number;
    first = begin - 1;
    of = (static_cast<std::uint64_t>(size_bytes) + fragment_bytes - 1) / fragment_bytes;
    return of <= kMostFragments && first + count <= of && payload_bytes(part) >= claimed_bytes();
  }

 private:
  std::uint64_t claimed_bytes() const {
    const std::uint64_t begin = first * fragment_bytes;
    return std::min<std::uint64_t>(count * fragment_bytes,
                                   static_cast<std::uint64_t>(size_bytes) - begin);
  }

  static std::uint64_t payload_bytes(const Submessage& part) {
    const std::size_t begin =
        kAfterToInlineQos + std::size_t{part.half_word_at(kToInlineQosAt).value_or(0)};
    const std::size_t end = part.size();
    return end > begin ? end - begin : 0;
  }
};

void IncomingSamples::add_reader(const std::string& dds_topic, const Qos& qos) {
  const std::lock_guard lock(mutex_);
  Readers& readers = topics_[dds_topic];
  ++(qos.bulk ? readers.bulk : readers.others);
  readers.reliable += qos.reliability == Reliability::kReliable ? 1 : 0;
}

void IncomingSamples::remove_reader(const std::string& dds_topic, const Qos& qos) {
  const std::lock_guard lock(mutex_);
  Readers& readers = topics_[dds_topic];
  --(qos.bulk ? readers.bulk : readers.others);
  readers.reliable -= qos.reliability == Reliability::kReliable ? 1 : 0;
}

void IncomingSamples::add_writer(const Guid& guid,
                                 const std::string& dds_topic,
                                 Reliability offered) {
  const std::lock_guard lock(mutex_);
  writers_.insert_or_assign(guid, Writer{dds_topic, offered});
}

void IncomingSamples::free_all_of(const Stream& stream) {
  for (const auto& [number, sample] : stream.open) {
    open_bytes_[stream.terms.share] -= cost_bytes(sample.size_bytes);
  }
}

void IncomingSamples::remove_writer(const Guid& guid) {
  const std::lock_guard lock(mutex_);
  writers_.erase(guid);
  if (const auto found = streams_.find(guid); found != streams_.end()) {
    free_all_of(found->second);
    streams_.erase(found);
  }
}

void IncomingSamples::remove_participant(std::span<const std::uint8_t> prefix) {
  const auto is_of_it = [prefix](const Guid& guid) {
    return std::equal(prefix.begin(), prefix.end(), guid.begin());
  };
  const std::lock_guard lock(mutex_);
  std::erase_if(writers_, [&](const auto& each) { return is_of_it(each.first); });
  std::erase_if(streams_, [&](const auto& each) {
    const bool goes = is_of_it(each.first);
    if (goes) {
      free_all_of(each.second);
    }
    return goes;
  });
}

IncomingSamples::Terms IncomingSamples::terms_of(const Guid& writer) const {
  Terms terms;
  if (is_builtin(writer)) {
    terms.is_read = true;
    terms.is_builtin = true;
    return terms;
  }
  const auto known = writers_.find(writer);
  const auto topic =
      known == writers_.end() ? topics_.end() : topics_.find(known->second.dds_topic);
  if (topic == topics_.end()) {
    return terms;
  }
  const Readers& readers = topic->second;
  terms.is_read = readers.bulk + readers.others > 0;
  terms.share = readers.bulk > 0 ? kBulk : kOther;
  terms.keeps_one = known->second.offered == Reliability::kBestEffort || readers.reliable == 0;
  return terms;
}

IncomingSamples::Verdict IncomingSamples::judge(std::span<const std::uint8_t> datagram, Time now) {
  Verdict verdict;
  Guid source{};
  set_prefix(source, datagram, kPrefixOfMessageAt);
  const std::lock_guard lock(mutex_);
  visit_submessages(datagram, [&](const Submessage& part) {
    if (part.kind == Submessage::kInfoSource) {
      set_prefix(source, part.rest, kPrefixOfSourceAt);
    } else if (part.kind == Submessage::kHeartbeat) {
      if (const auto told = heartbeat_of(part)) {
        set_entity(source, told->writer);
        forget_before(source, *told);
      }
    } else if (part.kind == Submessage::kDataFragment) {
      Fragments came{.writer = source, .now = now};
      verdict.is_refused = !came.read(part);
      if (!verdict.is_refused) {
        take(came, verdict);
      }
    }
    return verdict.passes();
  });
  return verdict;
}

std::int64_t IncomingSamples::open_bytes() const {
  const std::lock_guard lock(mutex_);
  return open_bytes_[kBulk] + open_bytes_[kOther];
}

void IncomingSamples::take(const Fragments& came, Verdict& verdict) {
  const Terms terms = terms_of(came.writer);
  const auto most = terms.share == kBulk ? kLargestMessage_bytes : kLargestSmallMessage_bytes;
  if (!terms.is_read) {
    verdict.is_ignored = came.size_bytes > most;
    return;  // the middleware takes no memory for these
  }
  if (came.size_bytes > most) {
    verdict.is_refused = true;
    return;
  }
  const auto found = streams_.find(came.writer);
  if (found == streams_.end()) {
    begin(came, terms, verdict);
    return;
  }
  Stream& stream = found->second;
  if (const auto done = stream.finished.find(came.number); done != stream.finished.end()) {
    verdict.is_refused = done->second != came.size_bytes;
  } else if (const auto open = stream.open.find(came.number); open == stream.open.end()) {
    begin(came, terms, verdict);
  } else if (open->second.size_bytes != came.size_bytes ||
             open->second.fragment_bytes != came.fragment_bytes) {
    verdict.is_refused = true;
  } else {
    note(came, stream, open->second);
  }
}

void IncomingSamples::begin(const Fragments& came, const Terms& terms, Verdict& verdict) {
  if (const auto known = streams_.find(came.writer); known != streams_.end() && terms.keeps_one) {
    Stream& stream = known->second;
    if (!stream.open.empty() && stream.open.rbegin()->first > came.number) {
      verdict.is_ignored = true;
      return;
    }
    free_all_of(stream);
    stream.open.clear();
  }
  const std::int64_t bytes = cost_bytes(came.size_bytes);
  if (!make_room(terms.share, bytes, came.now)) {
    verdict.is_refused = true;
    return;
  }
  Stream& stream = streams_[came.writer];
  set_terms(stream, terms);
  Sample& sample = stream.open[came.number];
  sample.size_bytes = came.size_bytes;
  sample.fragment_bytes = came.fragment_bytes;
  sample.seen.resize(came.of);
  sample.missing = came.of;
  open_bytes_[terms.share] += bytes;
  note(came, stream, sample);
}

/// They change when readers of another kind come or go.
void IncomingSamples::set_terms(Stream& stream, const Terms& terms) {
  if (stream.terms.share != terms.share) {
    free_all_of(stream);
    for (const auto& [number, sample] : stream.open) {
      open_bytes_[terms.share] += cost_bytes(sample.size_bytes);
    }
  }
  stream.terms = terms;
}

void IncomingSamples::note(const Fragments& came, Stream& stream, Sample& sample) {
  sample.touched = came.now;
  for (std::uint64_t i = came.first; i < came.first + came.count; ++i) {
    sample.missing -= sample.seen[i] ? 0 : 1;
    sample.seen[i] = true;
  }
  if (sample.missing > 0) {
    return;
  }
  open_bytes_[stream.terms.share] -= cost_bytes(sample.size_bytes);
  stream.finished.emplace(came.number, sample.size_bytes);
  stream.open.erase(came.number);
  if (stream.finished.size() > kMostFinished) {
    stream.finished.erase(stream.finished.begin());
  }
  if (stream.terms.is_builtin && stream.open.empty()) {
    streams_.erase(came.writer);  // anybody may claim to be somebody, so nothing is kept of them
  }
}

/// The writer does not have them any more, and the middleware drops them: at a heartbeat that is
/// newer than those before, as it counts them.
void IncomingSamples::forget_before(const Guid& writer, const HeartbeatOf& told) {
  const auto found = streams_.find(writer);
  if (found == streams_.end() || told.count <= found->second.last_heartbeat) {
    return;
  }
  Stream& stream = found->second;
  stream.last_heartbeat = told.count;
  if (stream.terms.keeps_one) {
    return;
  }
  const auto end = stream.open.lower_bound(told.first);
  for (auto each = stream.open.begin(); each != end; ++each) {
    open_bytes_[stream.terms.share] -= cost_bytes(each->second.size_bytes);
  }
  stream.open.erase(stream.open.begin(), end);
  stream.finished.erase(stream.finished.begin(), stream.finished.lower_bound(told.first));
}

/// Anybody may claim to be a participant, so of discovery what nothing came for long is forgotten
/// where there is no room else. What others have begun stays: nothing tells the middleware to give
/// it up.
bool IncomingSamples::make_room(Share share, std::int64_t bytes, Time now) {
  if (open_bytes_[share] + bytes <= kBudgets[share]) {
    return true;
  }
  if (share != kOther || now - searched_ < kBetweenSearches) {
    return false;
  }
  searched_ = now;
  for (auto& [writer, stream] : streams_) {
    if (stream.terms.is_builtin) {
      std::erase_if(stream.open, [&](const auto& each) {
        const bool goes = now - each.second.touched > kForgotten;
        open_bytes_[share] -= goes ? cost_bytes(each.second.size_bytes) : 0;
        return goes;
      });
    }
  }
  std::erase_if(streams_, [](const auto& each) {
    return each.second.terms.is_builtin && each.second.open.empty();
  });
  return open_bytes_[share] + bytes <= kBudgets[share];
}

}  // namespace trigpoint::bus
