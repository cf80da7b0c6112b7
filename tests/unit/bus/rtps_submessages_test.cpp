// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "rtps_submessages.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace trigpoint::bus::submessages_test {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr EntityNumber kClouds = 0x00000103;
constexpr EntityNumber kOther = 0x00000203;

void put(Bytes& bytes, std::uint32_t word, bool little_endian) {
  for (int i = 0; i < 4; ++i) {
    bytes.push_back(static_cast<std::uint8_t>(word >> (little_endian ? 8 * i : 24 - 8 * i)));
  }
}

void put_number(Bytes& bytes, std::uint64_t number, bool little_endian) {
  put(bytes, static_cast<std::uint32_t>(number >> 32), little_endian);
  put(bytes, static_cast<std::uint32_t>(number), little_endian);
}

Bytes header() {
  Bytes bytes{'R', 'T', 'P', 'S', 2, 3, 1, 15};
  bytes.resize(20);
  return bytes;
}

Bytes submessage(std::uint8_t kind, const Bytes& body, bool little_endian) {
  const auto size = static_cast<std::uint8_t>(body.size());
  Bytes bytes{kind, static_cast<std::uint8_t>(little_endian ? 1 : 0), 0, 0};
  bytes[little_endian ? 2 : 3] = size;
  bytes.insert(bytes.end(), body.begin(), body.end());
  return bytes;
}

Bytes heartbeat(EntityNumber writer, std::uint64_t first, std::uint64_t last, bool little = true) {
  Bytes body;
  put(body, 0, false);  // to every reader
  put(body, writer, false);
  put_number(body, first, little);
  put_number(body, last, little);
  put(body, 77, little);
  return submessage(Submessage::kHeartbeat, body, little);
}

Bytes data(std::uint8_t kind, EntityNumber writer, std::uint64_t number, bool little = true) {
  Bytes body(4);  // flags and the offset of what follows
  put(body, 0, false);
  put(body, writer, false);
  put_number(body, number, little);
  body.resize(60);
  return submessage(kind, body, little);
}

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

const Bytes kTimestamp = submessage(0x09, Bytes(8), true);

std::optional<Bytes> until(std::uint64_t last, const Bytes& datagram) {
  return with_heartbeats_until(datagram, [last](EntityNumber writer) {
    return writer == kClouds ? std::optional(last) : std::nullopt;
  });
}

TEST(CarriedSample, is_told_by_whole_samples_and_fragments_in_both_byte_orders) {
  constexpr std::uint64_t kNumber = 0x1'0000'0007;
  for (const std::uint8_t kind : {Submessage::kData, Submessage::kDataFragment}) {
    for (const bool little : {true, false}) {
      const auto sample =
          carried_sample(header() + kTimestamp + data(kind, kClouds, kNumber, little));
      ASSERT_TRUE(sample.has_value());
      EXPECT_EQ(sample->writer, kClouds);
      EXPECT_EQ(sample->number, kNumber);
    }
  }
}

TEST(CarriedSample, is_none_in_heartbeats_cut_datagrams_and_noise) {
  EXPECT_FALSE(carried_sample(header() + heartbeat(kClouds, 1, 2)));
  Bytes whole = header() + data(Submessage::kData, kClouds, 3);
  whole.resize(20 + 4 + 16);
  EXPECT_FALSE(carried_sample(whole));
  std::mt19937 random(5);
  for (int i = 0; i < 1000; ++i) {
    Bytes noise = header();
    noise.resize(20 + random() % 80);
    std::generate(noise.begin() + 20, noise.end(), random);
    carried_sample(noise);
    until(3, noise);
  }
}

TEST(Heartbeats, tell_of_no_sample_after_the_last_that_was_sent) {
  for (const bool little : {true, false}) {
    EXPECT_EQ(until(7, header() + kTimestamp + heartbeat(kClouds, 2, 9, little)),
              header() + kTimestamp + heartbeat(kClouds, 2, 7, little));
  }
}

TEST(Heartbeats, stay_as_they_are_when_all_was_sent_or_they_are_of_another_writer) {
  EXPECT_FALSE(until(9, header() + heartbeat(kClouds, 2, 9)));
  EXPECT_FALSE(until(7, header() + heartbeat(kOther, 2, 9)));
  EXPECT_EQ(until(7, header() + heartbeat(kOther, 2, 9) + heartbeat(kClouds, 2, 9)),
            header() + heartbeat(kOther, 2, 9) + heartbeat(kClouds, 2, 7));
}

TEST(Heartbeats, tell_of_none_when_the_first_was_not_sent_either) {
  EXPECT_EQ(until(3, header() + heartbeat(kClouds, 5, 9)), header() + heartbeat(kClouds, 5, 4));
}

}  // namespace
}  // namespace trigpoint::bus::submessages_test
