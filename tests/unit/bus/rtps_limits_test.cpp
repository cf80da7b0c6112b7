// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "rtps_limits.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace trigpoint::bus {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::int64_t kMost = 1'000'000;

Bytes header() {
  Bytes bytes{'R', 'T', 'P', 'S', 2, 3, 1, 15};
  bytes.resize(20);
  return bytes;
}

/// A DATA_FRAG of a sample of 0x00989680 = 10 million bytes, or of 0x00000F42 = 3906.
Bytes fragment(bool little_endian, bool large) {
  Bytes bytes{0x16, static_cast<std::uint8_t>(little_endian ? 1 : 0), 0, 0};
  bytes[little_endian ? 2 : 3] = 40;  // length: 32 and a payload of 8
  bytes.resize(32);
  Bytes size = large ? Bytes{0x00, 0x98, 0x96, 0x80} : Bytes{0x00, 0x00, 0x0F, 0x42};
  if (little_endian) {
    size = {size.rbegin(), size.rend()};
  }
  bytes.insert(bytes.end(), size.begin(), size.end());
  bytes.resize(44);
  return bytes;
}

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

const Bytes kTimestamp{0x09, 1, 8, 0, 1, 2, 3, 4, 5, 6, 7, 8};

TEST(AnnouncedSize, is_read_in_both_byte_orders) {
  for (const bool little_endian : {true, false}) {
    EXPECT_TRUE(announces_more_than(header() + fragment(little_endian, true), kMost));
    EXPECT_FALSE(announces_more_than(header() + fragment(little_endian, false), kMost));
  }
}

TEST(AnnouncedSize, is_found_behind_other_submessages) {
  EXPECT_TRUE(announces_more_than(
      header() + kTimestamp + fragment(true, false) + fragment(false, true), kMost));
  EXPECT_FALSE(announces_more_than(header() + kTimestamp + fragment(true, false), kMost));
}

TEST(AnnouncedSize, is_found_in_a_last_submessage_whose_length_is_left_open) {
  Bytes open = fragment(true, true);
  open[2] = 0;
  EXPECT_TRUE(announces_more_than(header() + open, kMost));
}

TEST(AnnouncedSize, is_none_where_there_is_no_rtps) {
  EXPECT_FALSE(announces_more_than({}, kMost));
  Bytes other = header() + fragment(true, true);
  other[0] = 'X';
  EXPECT_FALSE(announces_more_than(other, kMost));
}

TEST(AnnouncedSize, is_looked_for_within_the_datagram_only) {
  const Bytes whole = header() + kTimestamp + fragment(true, false) + fragment(false, true);
  std::mt19937 random(5);
  for (int round = 0; round < 20'000; ++round) {  // under the sanitizers above all
    Bytes bytes(whole.begin(),
                whole.begin() + static_cast<std::ptrdiff_t>(random() % whole.size()));
    for (std::size_t i = 20; i < bytes.size(); i += 1 + random() % 16) {
      bytes[i] = static_cast<std::uint8_t>(random());
    }
    announces_more_than(bytes, kMost);
  }
}

}  // namespace
}  // namespace trigpoint::bus
