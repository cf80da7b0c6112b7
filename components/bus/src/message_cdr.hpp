// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A generated message as bytes and back, by Fast CDR: XCDR1 behind the 4-byte encapsulation header.
#pragma once

#include "sensor_msgs.h"
#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <cstdint>
#include <exception>
#include <span>

namespace trigpoint::bus {

inline constexpr std::size_t kEncapsulationBytes = 4;

template <class Message>
std::size_t cdr_size_bound(const Message& message) {
  return Message::getCdrSerializedSize(message) + kEncapsulationBytes;
}

/// Bytes written, or 0 when `bytes` is too small.
template <class Message>
std::size_t write_cdr(const Message& message, std::span<std::uint8_t> bytes) {
  using eprosima::fastcdr::Cdr;
  try {
    eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(bytes.data()), bytes.size());
    Cdr cdr(buffer, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
    cdr.serialize_encapsulation();
    message.serialize(cdr);
    return cdr.getSerializedDataLength();
  } catch (const std::exception&) {
    return 0;
  }
}

/// Plain CDR of either byte order; parameter lists and XCDR2 have other identifiers.
inline bool is_plain_cdr(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= kEncapsulationBytes && bytes[0] == 0 && bytes[1] <= 1;
}

/// Whether what a message announces is worth decoding, beside what Fast CDR checks by itself.
template <class Message>
bool is_plausible(eprosima::fastcdr::Cdr&, const Message&) {
  return true;
}

/// A cloud may be large, and if it were all fields, each 16 bytes there, they would take 48 bytes
/// each in memory, twice that while their vector grows. So it takes little more than its size.
inline bool is_plausible(eprosima::fastcdr::Cdr& cdr, const sensor_msgs::msg::PointCloud2&) {
  constexpr std::uint32_t kMostFields = 1024;
  std_msgs::msg::Header header;
  std::uint32_t height = 0;
  std::uint32_t width = 0;
  std::uint32_t fields = 0;
  auto begin = cdr.getState();
  header.deserialize(cdr);
  cdr.deserialize(height);
  cdr.deserialize(width);
  cdr.deserialize(fields);
  cdr.setState(begin);
  return fields <= kMostFields;
}

/// Fast CDR compares every length with the bytes that are left before it allocates, and throws.
template <class Message>
bool read_cdr(std::span<const std::uint8_t> bytes, Message& message) {
  using eprosima::fastcdr::Cdr;
  if (!is_plain_cdr(bytes)) {
    return false;
  }
  try {
    // FastBuffer has no const form; reading leaves the bytes alone.
    char* data = const_cast<char*>(reinterpret_cast<const char*>(bytes.data()));
    eprosima::fastcdr::FastBuffer buffer(data, bytes.size());
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    cdr.read_encapsulation();
    if (!is_plausible(cdr, message)) {
      return false;
    }
    message.deserialize(cdr);
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

}  // namespace trigpoint::bus
