// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "rtps_submessages.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace trigpoint::bus {

namespace {

constexpr std::size_t kMessageHeader_bytes = 20;
constexpr std::size_t kSubmessageHeader_bytes = 4;
constexpr std::uint8_t kPad = 0x01;
constexpr std::uint8_t kInfoTimestamp = 0x09;
// In a submessage with its header.
constexpr std::size_t kWriterOfDataAt = 12;
constexpr std::size_t kNumberOfDataAt = 16;
constexpr std::size_t kWriterOfHeartbeatAt = 8;
constexpr std::size_t kFirstOfHeartbeatAt = 12;
constexpr std::size_t kLastOfHeartbeatAt = 20;
constexpr std::size_t kCountOfHeartbeatAt = 28;

template <class Number>
std::optional<Number> number_at(const Submessage& part, std::size_t place) {
  if (part.rest.size() < place + sizeof(Number)) {
    return std::nullopt;
  }
  Number number = 0;
  for (std::size_t i = 0; i < sizeof(Number); ++i) {
    const std::size_t at = place + (part.little_endian ? sizeof(Number) - 1 - i : i);
    number = static_cast<Number>((number << 8) | part.rest[at]);
  }
  return number;
}

/// A sequence number: its upper word before its lower.
std::optional<std::uint64_t> sequence_number_at(const Submessage& part, std::size_t place) {
  const auto high = part.word_at(place);
  const auto low = part.word_at(place + 4);
  if (!high || !low) {
    return std::nullopt;
  }
  return (std::uint64_t{*high} << 32) | *low;
}

std::optional<EntityNumber> entity_at(const Submessage& part, std::size_t place) {
  return Submessage{part.kind, false, part.rest}.word_at(place);
}

void put_word(std::uint8_t* place, std::uint32_t word, bool little_endian) {
  for (unsigned i = 0; i < 4; ++i) {
    place[i] = static_cast<std::uint8_t>(word >> (little_endian ? 8 * i : 24 - 8 * i));
  }
}

/// What the heartbeat should say was the last, where it tells of more.
std::optional<std::uint64_t> corrected_last(
    const Submessage& heartbeat,
    const std::function<std::optional<std::uint64_t>(EntityNumber)>& last_of) {
  const auto writer = entity_at(heartbeat, kWriterOfHeartbeatAt);
  const auto first = sequence_number_at(heartbeat, kFirstOfHeartbeatAt);
  const auto last = sequence_number_at(heartbeat, kLastOfHeartbeatAt);
  if (!writer || !first || !last || *first == 0) {
    return std::nullopt;
  }
  const auto right = last_of(*writer);
  if (!right || *right >= *last) {
    return std::nullopt;
  }
  return std::max(*right, *first - 1);
}

}  // namespace

std::optional<std::uint32_t> Submessage::word_at(std::size_t place) const {
  return number_at<std::uint32_t>(*this, place);
}

std::optional<std::uint16_t> Submessage::half_word_at(std::size_t place) const {
  return number_at<std::uint16_t>(*this, place);
}

std::size_t Submessage::size() const {
  const std::size_t length = half_word_at(2).value_or(0);
  const bool is_last = length == 0 && kind != kPad && kind != kInfoTimestamp;
  return is_last ? rest.size() : std::min(rest.size(), kSubmessageHeader_bytes + length);
}

void visit_submessages(std::span<const std::uint8_t> datagram,
                       const std::function<bool(const Submessage&)>& visit) {
  if (datagram.size() < kMessageHeader_bytes || std::memcmp(datagram.data(), "RTPS", 4) != 0) {
    return;
  }
  auto rest = datagram.subspan(kMessageHeader_bytes);
  while (rest.size() >= kSubmessageHeader_bytes) {
    const Submessage part{rest[0], (rest[1] & 1) != 0, rest};
    if (!visit(part)) {
      return;
    }
    rest = rest.subspan(part.size());
  }
}

std::optional<CarriedSample> carried_by(const Submessage& data) {
  const auto writer = entity_at(data, kWriterOfDataAt);
  const auto number = sequence_number_at(data, kNumberOfDataAt);
  if (!writer || !number) {
    return std::nullopt;
  }
  return CarriedSample{*writer, *number};
}

std::optional<HeartbeatOf> heartbeat_of(const Submessage& heartbeat) {
  const auto writer = entity_at(heartbeat, kWriterOfHeartbeatAt);
  const auto first = sequence_number_at(heartbeat, kFirstOfHeartbeatAt);
  const auto count = heartbeat.word_at(kCountOfHeartbeatAt);
  if (!writer || !first || !count) {
    return std::nullopt;
  }
  return HeartbeatOf{*writer, *first, *count};
}

std::optional<CarriedSample> carried_sample(std::span<const std::uint8_t> datagram) {
  std::optional<CarriedSample> found;
  visit_submessages(datagram, [&found](const Submessage& part) {
    if (part.kind != Submessage::kData && part.kind != Submessage::kDataFragment) {
      return true;
    }
    found = carried_by(part);
    return false;
  });
  return found;
}

std::optional<std::vector<std::uint8_t>> with_heartbeats_until(
    std::span<const std::uint8_t> datagram,
    const std::function<std::optional<std::uint64_t>(EntityNumber writer)>& last_of) {
  std::optional<std::vector<std::uint8_t>> corrected;
  visit_submessages(datagram, [&](const Submessage& part) {
    if (part.kind != Submessage::kHeartbeat) {
      return true;
    }
    if (const auto last = corrected_last(part, last_of)) {
      if (!corrected) {
        corrected.emplace(datagram.begin(), datagram.end());
      }
      const auto at = static_cast<std::size_t>(part.rest.data() - datagram.data());
      std::uint8_t* place = corrected->data() + at + kLastOfHeartbeatAt;
      put_word(place, static_cast<std::uint32_t>(*last >> 32), part.little_endian);
      put_word(place + 4, static_cast<std::uint32_t>(*last), part.little_endian);
    }
    return true;
  });
  return corrected;
}

}  // namespace trigpoint::bus
