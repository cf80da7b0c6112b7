// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "../../../components/bus/process/clock_offsets.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <string>

namespace trigpoint::bus {
namespace {

constexpr Nanoseconds kMillisecond{1'000'000};

/// Our clock says `asked_ns` when we ask, the other one is ahead by `offset_ns`.
ClockExchange exchange(Nanoseconds asked_ns,
                       Nanoseconds offset_ns,
                       Nanoseconds there_ns,
                       Nanoseconds thought_ns,
                       Nanoseconds back_ns) {
  const Nanoseconds heard_there_ns = asked_ns + there_ns + offset_ns;
  return {asked_ns,
          heard_there_ns,
          heard_there_ns + thought_ns,
          asked_ns + there_ns + thought_ns + back_ns};
}

TEST(ClockOffset, is_exact_when_both_ways_take_equally_long) {
  for (const Nanoseconds offset_ns : {30'000 * kMillisecond, -7 * kMillisecond, Nanoseconds{0}}) {
    const ClockOffset found = offset_of(
        exchange(1'000, offset_ns, 50 * kMillisecond, 3 * kMillisecond, 50 * kMillisecond));
    EXPECT_EQ(found.offset_ns, offset_ns);
    EXPECT_EQ(found.round_trip_ns, 100 * kMillisecond);
  }
}

TEST(ClockOffset, errs_by_half_the_round_trip_at_most) {
  std::mt19937 random(3);
  std::uniform_int_distribution<Nanoseconds> way_ns(0, 200 * kMillisecond);
  for (int i = 0; i < 1000; ++i) {
    const Nanoseconds offset_ns = way_ns(random) - way_ns(random);
    const ClockOffset found = offset_of(
        exchange(way_ns(random), offset_ns, way_ns(random), way_ns(random), way_ns(random)));
    EXPECT_LE(std::abs(found.offset_ns - offset_ns), found.round_trip_ns / 2 + 1);
  }
}

TEST(ClockOffsets, take_the_exchange_that_waited_least) {
  ClockOffsets clocks;
  const Nanoseconds offset_ns = 5 * kMillisecond;
  clocks.add("base", exchange(0, offset_ns, 90 * kMillisecond, 0, kMillisecond));
  clocks.add("base", exchange(0, offset_ns, kMillisecond, 0, kMillisecond));
  clocks.add("base", exchange(0, offset_ns, kMillisecond, 0, 90 * kMillisecond));
  ASSERT_TRUE(clocks.best("base").has_value());
  EXPECT_EQ(clocks.best("base")->offset_ns, offset_ns);
  EXPECT_FALSE(clocks.best("robot").has_value());
}

TEST(ClockOffsets, forget_what_a_clock_was_before_it_was_set) {
  ClockOffsets clocks;
  clocks.add("base", exchange(0, 5 * kMillisecond, 0, 0, 0));
  for (std::size_t i = 0; i < ClockOffsets::kRemembered; ++i) {
    clocks.add("base", exchange(0, -9 * kMillisecond, kMillisecond, 0, kMillisecond));
  }
  EXPECT_EQ(clocks.best("base")->offset_ns, -9 * kMillisecond);
}

TEST(ClockOffsets, refuse_names_that_are_empty_long_or_unsafe_and_say_so) {
  ClockOffsets clocks;
  const ClockExchange good = exchange(0, 0, kMillisecond, 0, kMillisecond);
  for (const std::string& name : {std::string(),
                                  std::string(65, 'a'),
                                  std::string("a,1\n"),
                                  std::string("../a"),
                                  std::string("\x1b[2J"),
                                  std::string(1'000'000, 'x')}) {
    const auto refused = clocks.add(name, good);
    ASSERT_TRUE(refused.has_value());
    EXPECT_NE(refused->find("1 to 64"), std::string::npos) << *refused;
    EXPECT_LT(refused->size(), 200U);
  }
  EXPECT_EQ(clocks.size(), 0U);
  EXPECT_FALSE(clocks.add(std::string(64, 'a'), good));
  EXPECT_FALSE(clocks.add("robot-1.local_2", good));
}

TEST(ClockOffsets, refuse_stamps_whose_differences_would_overflow) {
  constexpr Nanoseconds kLeast = std::numeric_limits<Nanoseconds>::min();
  constexpr Nanoseconds kMost = std::numeric_limits<Nanoseconds>::max();
  constexpr Nanoseconds kNow = 1'790'000'000 * kNanosecondsPerSecond;
  ClockOffsets clocks;
  for (const Nanoseconds wrong : {kLeast, kLeast + kNow, -kNow, kMost - kNow, kMost}) {
    for (const ClockExchange& e : {ClockExchange{wrong, kNow, kNow, kNow},
                                   ClockExchange{kNow, wrong, kNow, kNow},
                                   ClockExchange{kNow, kNow, wrong, kNow},
                                   ClockExchange{kNow, wrong, wrong, kNow},
                                   ClockExchange{kNow, kLeast, kMost, kNow}}) {
      EXPECT_TRUE(clocks.add("liar", e)) << wrong;
    }
  }
  EXPECT_EQ(clocks.size(), 0U);
}

TEST(ClockOffsets, measure_a_computer_that_has_no_clock_and_begins_in_1970) {
  constexpr Nanoseconds kNow = 1'790'000'000 * kNanosecondsPerSecond;
  ClockOffsets clocks;
  EXPECT_FALSE(clocks.add("base", exchange(kNow, -kNow, kMillisecond, 0, kMillisecond)));
  EXPECT_EQ(clocks.best("base")->offset_ns, -kNow);
}

TEST(ClockOffsets, keep_at_most_64_computers_of_those_that_answer) {
  ClockOffsets clocks;
  const auto at = [](Nanoseconds now_ns) {
    return exchange(now_ns, 0, kMillisecond, 0, kMillisecond);
  };
  for (std::size_t i = 0; i < ClockOffsets::kMostComputers; ++i) {
    EXPECT_FALSE(clocks.add("c" + std::to_string(i), at(0)));
  }
  EXPECT_TRUE(clocks.add("one-more", at(0)));
  EXPECT_EQ(clocks.size(), ClockOffsets::kMostComputers);
  const Nanoseconds later_ns = ClockOffsets::kForgotten_ns + kNanosecondsPerSecond;
  EXPECT_FALSE(clocks.add("c0", at(later_ns)));
  EXPECT_FALSE(clocks.add("one-more", at(later_ns))) << "the others are silent";
  EXPECT_TRUE(clocks.best("c0"));
  EXPECT_FALSE(clocks.best("c1"));
}

TEST(ClockOffsets, leave_out_an_exchange_in_which_our_clock_was_set_back) {
  ClockOffsets clocks;
  clocks.add("base", {100 * kMillisecond, 0, 0, 0});
  EXPECT_FALSE(clocks.best("base").has_value());
}

}  // namespace
}  // namespace trigpoint::bus
