// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The submessages of a datagram of RTPS. RTPS 2.3: 8.3.3, 9.4.5 (their layouts).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace trigpoint::bus {

/// One of a datagram. What it claims is not checked: `rest` may end before it does.
struct Submessage {
  static constexpr std::uint8_t kHeartbeat = 0x07;
  static constexpr std::uint8_t kInfoSource = 0x0C;
  static constexpr std::uint8_t kData = 0x15;
  static constexpr std::uint8_t kDataFragment = 0x16;

  std::uint8_t kind{0};
  bool little_endian{true};
  std::span<const std::uint8_t> rest;  ///< from its header to the end of the datagram

  /// The four or two bytes at that place after the header's first; nothing beyond the datagram.
  std::optional<std::uint32_t> word_at(std::size_t place) const;
  std::optional<std::uint16_t> half_word_at(std::size_t place) const;
  /// With its header; never more than the datagram has.
  std::size_t size() const;
};

/// Calls `visit` for one after the other until it returns false. What is not RTPS has none.
void visit_submessages(std::span<const std::uint8_t> datagram,
                       const std::function<bool(const Submessage&)>& visit);

/// Of a writer within its participant, the bytes read as a big-endian number.
using EntityNumber = std::uint32_t;

/// Whose sample, or piece of one, a datagram carries; of several the first.
struct CarriedSample {
  EntityNumber writer{0};
  std::uint64_t number{0};
};

/// By a DATA or a DATA_FRAG; nothing where it is cut off.
std::optional<CarriedSample> carried_by(const Submessage& data);

struct HeartbeatOf {
  EntityNumber writer{0};
  std::uint64_t first{0};  ///< of the samples that it still has
  std::uint32_t count{0};
};

std::optional<HeartbeatOf> heartbeat_of(const Submessage& heartbeat);

std::optional<CarriedSample> carried_sample(std::span<const std::uint8_t> datagram);

/// The same datagram, in which no heartbeat of a writer tells of samples after
/// `last_of(writer)`; nothing where none does. A heartbeat that would be left with less than no
/// sample tells of none.
std::optional<std::vector<std::uint8_t>> with_heartbeats_until(
    std::span<const std::uint8_t> datagram,
    const std::function<std::optional<std::uint64_t>(EntityNumber writer)>& last_of);

}  // namespace trigpoint::bus
