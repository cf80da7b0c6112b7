// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "incoming_samples.hpp"

#include "rtps_limits.hpp"
#include <gtest/gtest.h>

#include <random>

namespace trigpoint::bus {
namespace {

using namespace std::chrono_literals;
using Bytes = std::vector<std::uint8_t>;

constexpr std::uint32_t kCloud_bytes = 3'000'000;
constexpr std::uint16_t kFragment_bytes = 1024;

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

Bytes number(std::uint64_t value, std::size_t size, bool little_endian) {
  Bytes bytes;
  for (std::size_t i = 0; i < size; ++i) {
    bytes.push_back(static_cast<std::uint8_t>(value >> (8 * (little_endian ? i : size - 1 - i))));
  }
  return bytes;
}

/// A writer of the user's; `who` tells its participant.
Guid writer_of(std::uint8_t who) {
  return {who, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 3, 0x03};
}

Bytes prefix_of(const Guid& writer) {
  return {writer.begin(), writer.begin() + 12};
}

Bytes entity_of(const Guid& writer) {
  return {writer.begin() + 12, writer.end()};
}

Bytes header(const Guid& writer) {
  return Bytes{'R', 'T', 'P', 'S', 2, 3, 1, 15} + prefix_of(writer);
}

Bytes info_source(const Guid& writer) {
  return Bytes{0x0C, 1, 20, 0, 0, 0, 0, 0, 2, 3, 1, 15} + prefix_of(writer);
}

struct Fragment {
  Guid writer{writer_of(1)};
  std::uint64_t sample{1};
  std::uint32_t first{1};
  std::uint16_t count{1};
  std::uint16_t size{kFragment_bytes};
  std::uint32_t sample_bytes{kCloud_bytes};
  bool little_endian{true};
  std::size_t payload_bytes{kFragment_bytes};

  Bytes submessage() const {
    const auto put = [this](std::uint64_t value, std::size_t bytes) {
      return number(value, bytes, little_endian);
    };
    Bytes bytes = Bytes{0x16, static_cast<std::uint8_t>(little_endian)} +
                  put(32 + payload_bytes, 2) + put(0, 2) + put(28, 2) + put(0, 4) +
                  entity_of(writer) + put(sample >> 32, 4) + put(sample, 4) + put(first, 4) +
                  put(count, 2) + put(size, 2) + put(sample_bytes, 4);
    bytes.resize(bytes.size() + payload_bytes);
    return bytes;
  }

  Bytes datagram() const { return header(writer) + submessage(); }
};

Bytes heartbeat(const Guid& writer, std::uint64_t first, std::uint32_t count) {
  return header(writer) + Bytes{0x07, 1, 28, 0, 0, 0, 0, 0} + entity_of(writer) +
         number(first >> 32, 4, true) + number(first, 4, true) + number(first >> 32, 4, true) +
         number(first + 10, 4, true) + number(count, 4, true);
}

class IncomingFragments : public ::testing::Test {
 protected:
  IncomingFragments() {
    samples_.add_reader("rt/points", kBulkQos);
    samples_.add_reader("rt/imu/data", kSmallQos);
    samples_.add_writer(kClouds, "rt/points", Reliability::kReliable);
    samples_.add_writer(kImu, "rt/imu/data", Reliability::kReliable);
  }

  IncomingSamples::Verdict judge(const Bytes& datagram) { return samples_.judge(datagram, now_); }

  bool pass(const Fragment& fragment) { return judge(fragment.datagram()).passes(); }

  /// How many samples of that size may begin, one after the other.
  int begun(Fragment fragment, int most) {
    for (int i = 0; i < most; ++i, ++fragment.sample) {
      if (!pass(fragment)) {
        return i;
      }
    }
    return most;
  }

  static constexpr Qos kSmallQos = qos::kDefault;
  static constexpr Qos kBulkQos = qos::kDefault.as_bulk();
  const Guid kClouds = writer_of(1);
  const Guid kImu = writer_of(2);
  const Guid kStranger = writer_of(3);
  IncomingSamples samples_;
  IncomingSamples::Time now_{};
};

TEST_F(IncomingFragments, are_of_samples_as_large_as_their_topic_may_have) {
  for (const bool little_endian : {true, false}) {
    const auto pass_with = [&](const Guid& writer, std::uint32_t bytes) {
      return pass({.writer = writer,
                   .sample = bytes,
                   .sample_bytes = bytes,
                   .little_endian = little_endian});
    };
    EXPECT_TRUE(pass_with(kClouds, 255'000'000));
    EXPECT_FALSE(pass_with(kClouds, 257'000'000));
    EXPECT_TRUE(pass_with(kImu, 999'000));
    EXPECT_FALSE(pass_with(kImu, 1'001'000));
    EXPECT_FALSE(pass_with(kStranger, 1'001'000));
    samples_.remove_writer(kClouds);
    samples_.add_writer(kClouds, "rt/points", Reliability::kReliable);
  }
}

TEST_F(IncomingFragments, are_found_behind_other_submessages_and_under_the_writer_that_they_name) {
  const Bytes timestamp{0x09, 1, 8, 0, 1, 2, 3, 4, 5, 6, 7, 8};
  const Fragment large{.writer = kImu, .sample_bytes = 2'000'000};
  EXPECT_TRUE(judge(header(kImu) + timestamp).passes());
  EXPECT_FALSE(judge(header(kImu) + timestamp + large.submessage()).passes());
  EXPECT_FALSE(judge(header(kClouds) + info_source(kImu) + large.submessage()).passes());
  EXPECT_TRUE(judge(header(kImu) + info_source(kClouds) + large.submessage()).passes());
}

TEST_F(IncomingFragments, are_measured_by_what_the_whole_sample_takes) {
  EXPECT_EQ(begun({.writer = kClouds, .sample_bytes = 255'000'000}, 40), 2);
  EXPECT_EQ(begun({.writer = kImu, .sample_bytes = 1'000'000}, 1000), 64);
  EXPECT_LE(samples_.open_bytes(), kIncompleteBulk_bytes + kIncompleteOther_bytes);
  EXPECT_EQ(begun({.writer = kImu, .sample = 5000, .sample_bytes = 2000}, 10), 0);
}

TEST_F(IncomingFragments, small_as_they_are_count_with_what_the_middleware_needs) {
  EXPECT_LE(begun({.writer = kImu, .size = 1, .sample_bytes = 2, .payload_bytes = 4}, 100'000),
            kIncompleteOther_bytes / 1000);
}

TEST_F(IncomingFragments, of_writers_that_nobody_reads_take_nothing) {
  const auto large = judge(Fragment{.writer = kStranger, .sample_bytes = 2'000'000}.datagram());
  EXPECT_TRUE(large.is_ignored);
  EXPECT_FALSE(large.is_refused);  // clouds come before their writer is known, which is no fault
  EXPECT_EQ(begun({.writer = kStranger, .sample_bytes = 900'000}, 1000), 1000);
  EXPECT_EQ(samples_.open_bytes(), 0);
}

TEST_F(IncomingFragments, free_the_room_when_the_sample_is_whole_and_repairs_take_none_again) {
  Fragment fragment{.writer = kClouds, .count = 40, .payload_bytes = 40 * kFragment_bytes};
  const auto send_all = [&] {
    for (fragment.first = 1; fragment.first <= 2930; fragment.first += 40) {
      const std::uint32_t left = 2931 - fragment.first;
      fragment.count = static_cast<std::uint16_t>(std::min(40U, left));
      EXPECT_TRUE(pass(fragment));
    }
  };
  send_all();
  EXPECT_EQ(samples_.open_bytes(), 0);
  send_all();
  EXPECT_EQ(samples_.open_bytes(), 0);
  fragment.first = 1;
  fragment.sample_bytes = 255'000'000;  // under a number that is known
  EXPECT_FALSE(pass(fragment));
}

TEST_F(IncomingFragments, of_four_writers_with_forty_unfinished_clouds_have_room) {
  for (std::uint8_t who = 10; who < 14; ++who) {
    samples_.add_writer(writer_of(who), "rt/points", Reliability::kReliable);
    EXPECT_EQ(begun({.writer = writer_of(who)}, 40), 40);
  }
}

TEST_F(IncomingFragments, that_contradict_themselves_are_refused) {
  EXPECT_TRUE(pass({}));
  EXPECT_FALSE(pass({.first = 0}));
  EXPECT_FALSE(pass({.count = 0}));
  EXPECT_FALSE(pass({.size = 0}));
  EXPECT_FALSE(pass({.sample_bytes = 0}));
  EXPECT_FALSE(pass({.first = 2931}));                               // of 2930
  EXPECT_FALSE(pass({.first = 2930, .count = 2}));                   //
  EXPECT_FALSE(pass({.sample = 2, .size = 1, .payload_bytes = 4}));  // in 3 million pieces
  EXPECT_FALSE(pass({.count = 2000}));                               // and the bytes of one
  EXPECT_FALSE(pass({.sample_bytes = kCloud_bytes + 1}));            // not what the first one said
}

TEST_F(IncomingFragments, of_what_the_writer_has_no_more_free_their_room_as_the_middleware_does) {
  begun({.writer = kClouds, .sample = 5}, 10);
  judge(heartbeat(kClouds, 8, 3));
  EXPECT_EQ(samples_.open_bytes(), 7 * kCloud_bytes);
  judge(heartbeat(kClouds, 100, 3));  // one that it has heard already
  EXPECT_EQ(samples_.open_bytes(), 7 * kCloud_bytes);
  judge(heartbeat(kClouds, 100, 4));
  EXPECT_EQ(samples_.open_bytes(), 0);
}

TEST_F(IncomingFragments, of_long_ago_make_room_only_where_they_are_of_discovery) {
  ASSERT_EQ(begun({.writer = kClouds, .sample_bytes = 255'000'000}, 3), 2);
  Guid discovery = kStranger;
  discovery[15] = 0xC2;
  ASSERT_LT(begun({.writer = discovery, .sample_bytes = 900'000}, 1000), 1000);
  now_ += 29s;
  EXPECT_FALSE(pass({.writer = kImu, .sample_bytes = 900'000}));
  now_ += 2s;
  EXPECT_TRUE(pass({.writer = kImu, .sample_bytes = 900'000}));
  EXPECT_FALSE(pass({.sample = 9, .sample_bytes = 9'000'000}));
}

TEST_F(IncomingFragments, of_best_effort_take_the_place_of_the_sample_before) {
  samples_.add_writer(kClouds, "rt/points", Reliability::kBestEffort);
  EXPECT_EQ(begun({.writer = kClouds, .sample_bytes = 255'000'000}, 40), 40);
  EXPECT_EQ(samples_.open_bytes(), 255'000'000);
  const auto late = judge(Fragment{.sample = 3}.datagram());
  EXPECT_TRUE(late.is_ignored);
  EXPECT_FALSE(late.is_refused);
  judge(heartbeat(kClouds, 100, 1));  // no best-effort reader hears it
  EXPECT_EQ(samples_.open_bytes(), 255'000'000);
}

TEST_F(IncomingFragments, free_their_room_with_the_writer_or_its_participant) {
  begun({.writer = kClouds}, 10);
  begun({.writer = kImu, .sample_bytes = 5000}, 10);
  samples_.remove_writer(kClouds);
  EXPECT_EQ(samples_.open_bytes(), 50'000);
  samples_.remove_participant(prefix_of(kImu));
  EXPECT_EQ(samples_.open_bytes(), 0);
}

TEST_F(IncomingFragments, are_looked_for_within_the_datagram_only) {
  EXPECT_TRUE(judge({}).passes());
  const Bytes whole =
      Fragment{.payload_bytes = 8}.datagram() + Fragment{.little_endian = false}.submessage();
  EXPECT_TRUE(judge(Bytes{'X'} + whole).passes());
  std::mt19937 random(5);
  for (int round = 0; round < 20'000; ++round) {  // under the sanitizers above all
    Bytes bytes(whole.begin(),
                whole.begin() + static_cast<std::ptrdiff_t>(random() % whole.size()));
    for (std::size_t i = 20; i < bytes.size(); i += 1 + random() % 16) {
      bytes[i] = static_cast<std::uint8_t>(random());
    }
    judge(bytes);
  }
  EXPECT_LE(samples_.open_bytes(), kIncompleteBulk_bytes + kIncompleteOther_bytes);
}

}  // namespace
}  // namespace trigpoint::bus
