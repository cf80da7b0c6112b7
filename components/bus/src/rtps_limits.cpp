// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// RTPS 2.3: 8.3.3 (message and submessage headers), 9.4.5.4 (DATA_FRAG).
#include "rtps_limits.hpp"

#include <cstddef>
#include <cstring>

namespace trigpoint::bus {

namespace {

constexpr std::size_t kMessageHeader_bytes = 20;
constexpr std::size_t kSubmessageHeader_bytes = 4;
constexpr std::uint8_t kPad = 0x01;
constexpr std::uint8_t kInfoTimestamp = 0x09;
constexpr std::uint8_t kDataFragment = 0x16;
constexpr std::size_t kSampleSizeAt = 32;  // in a DATA_FRAG submessage with its header

template <class Number>
Number number_at(std::span<const std::uint8_t> bytes, bool little_endian) {
  Number number = 0;
  for (std::size_t i = 0; i < sizeof(Number); ++i) {
    const std::size_t at = little_endian ? sizeof(Number) - 1 - i : i;
    number = static_cast<Number>((number << 8) | bytes[at]);
  }
  return number;
}

}  // namespace

bool announces_more_than(std::span<const std::uint8_t> datagram, std::int64_t most_bytes) {
  if (datagram.size() < kMessageHeader_bytes || std::memcmp(datagram.data(), "RTPS", 4) != 0) {
    return false;
  }
  auto rest = datagram.subspan(kMessageHeader_bytes);
  while (rest.size() >= kSubmessageHeader_bytes) {
    const std::uint8_t kind = rest[0];
    const bool little_endian = (rest[1] & 1) != 0;
    const auto length = number_at<std::uint16_t>(rest.subspan(2), little_endian);
    if (kind == kDataFragment && rest.size() >= kSampleSizeAt + 4 &&
        number_at<std::uint32_t>(rest.subspan(kSampleSizeAt), little_endian) > most_bytes) {
      return true;
    }
    const bool is_last = length == 0 && kind != kPad && kind != kInfoTimestamp;
    if (is_last || rest.size() < kSubmessageHeader_bytes + length) {
      return false;
    }
    rest = rest.subspan(kSubmessageHeader_bytes + length);
  }
  return false;
}

}  // namespace trigpoint::bus
