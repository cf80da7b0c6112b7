// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/fix_queue.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace trigpoint::fusion_gate {
namespace {

constexpr double kWindow_s = 2.3;
constexpr double kInterval_s = 0.2;

Nanoseconds stamp_of(int fix) {
  return from_seconds(1000.0 + kInterval_s * fix);
}

ToldFix told(int fix) {
  ToldFix result;
  result.fix.stamp_ns = stamp_of(fix);
  return result;
}

/// Everything that is ready, by stamp.
std::vector<Nanoseconds> take_ready(FixQueue& queue, Nanoseconds now_ns) {
  std::vector<Nanoseconds> taken;
  while (queue.next(now_ns) != nullptr) {
    taken.push_back(queue.take().fix.stamp_ns);
  }
  return taken;
}

/// A queue that knows the receiver's interval.
FixQueue settled(int fixes) {
  FixQueue queue(kWindow_s);
  for (int k = 0; k < fixes; ++k) {
    queue.put(told(k));
  }
  take_ready(queue, stamp_of(fixes) + from_seconds(kWindow_s));
  return queue;
}

TEST(FixQueue, lets_fixes_that_come_in_order_pass_at_once) {
  FixQueue queue = settled(10);
  for (int k = 10; k < 20; ++k) {
    queue.put(told(k));
    EXPECT_EQ(take_ready(queue, stamp_of(k)), std::vector{stamp_of(k)});
  }
}

TEST(FixQueue, waits_for_one_that_is_missing_and_no_longer_than_the_window) {
  FixQueue queue = settled(10);
  queue.put(told(11));
  EXPECT_EQ(queue.next(stamp_of(12)), nullptr);
  EXPECT_EQ(queue.next(stamp_of(11) + from_seconds(kWindow_s) - 1), nullptr);
  EXPECT_NE(queue.next(stamp_of(11) + from_seconds(kWindow_s)), nullptr);
  queue.put(told(10));
  EXPECT_EQ(take_ready(queue, stamp_of(12)), (std::vector{stamp_of(10), stamp_of(11)}));
}

TEST(FixQueue, does_not_wait_for_a_message_that_came_and_that_no_filter_tells_of) {
  FixQueue queue = settled(10);
  queue.hear(stamp_of(10), stamp_of(10));
  queue.put(told(11));
  EXPECT_EQ(queue.next(stamp_of(10) + 1'000'000), nullptr);  // the filter may be about to tell
  EXPECT_NE(queue.next(stamp_of(11)), nullptr);
}

/// One fix is missing after fixes that all came `lateness_s` late.
Nanoseconds wait_after(double lateness_s, int heard) {
  FixQueue queue = settled(10);
  for (int k = 10; k < 10 + heard; ++k) {
    queue.hear(stamp_of(k), stamp_of(k) + from_seconds(lateness_s));
    queue.put(told(k));
  }
  take_ready(queue, stamp_of(100));
  queue.put(told(102));
  Nanoseconds wait_ns = 0;
  while (queue.next(stamp_of(102) + wait_ns) == nullptr) {
    wait_ns += from_seconds(0.01);
  }
  return wait_ns;
}

TEST(FixQueue, waits_no_longer_than_a_second_beyond_what_fixes_need_to_come) {
  EXPECT_NEAR(to_seconds(wait_after(0.1, 40)), 1.1, 0.015);
  EXPECT_NEAR(to_seconds(wait_after(0.5, 40)), 1.5, 0.015);
  EXPECT_NEAR(to_seconds(wait_after(10.0, 40)), kWindow_s, 0.015);
  EXPECT_NEAR(to_seconds(wait_after(0.1, 4)), kWindow_s, 0.015) << "too few to tell";
}

TEST(FixQueue, gives_fixes_in_the_order_of_their_stamps_however_they_come) {
  constexpr int kFixes = 400;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> delay_s(0.05, kWindow_s - 0.05);
    std::vector<std::pair<Nanoseconds, int>> arrivals;
    for (int k = 0; k < kFixes; ++k) {
      // Three in ten late, a tenth lost.
      const bool lost = k % 10 == 7;
      const bool late = k % 10 < 3;
      if (!lost) {
        arrivals.emplace_back(stamp_of(k) + from_seconds(late ? delay_s(random) : 0.05), k);
      }
    }
    std::sort(arrivals.begin(), arrivals.end());
    FixQueue queue(kWindow_s);
    std::vector<Nanoseconds> taken;
    for (const auto& [now_ns, k] : arrivals) {
      EXPECT_FALSE(queue.is_overtaken(stamp_of(k))) << seed << ' ' << k;
      queue.put(told(k));
      const auto ready = take_ready(queue, now_ns);
      taken.insert(taken.end(), ready.begin(), ready.end());
    }
    EXPECT_TRUE(std::is_sorted(taken.begin(), taken.end()));
    EXPECT_GE(taken.size(), arrivals.size() - std::size_t{12});  // the last window still waits
  }
}

TEST(FixQueue, does_not_hear_stamps_from_the_far_future) {
  FixQueue queue = settled(10);
  for (int k = 0; k < 40; ++k) {
    queue.hear(stamp_of(1'000'000 + k), stamp_of(10));
  }
  queue.put(told(10));
  EXPECT_EQ(take_ready(queue, stamp_of(10)), std::vector{stamp_of(10)});
}

TEST(FixQueue, forgets_stamps_from_the_future_that_it_heard_before_there_was_a_data_time) {
  FixQueue queue(kWindow_s);
  for (int k = 0; k < 40; ++k) {
    queue.hear(stamp_of(1'000'000 + k), 0);
  }
  for (int k = 0; k < 20; ++k) {
    queue.hear(stamp_of(k), stamp_of(k));
    queue.put(told(k));
    take_ready(queue, stamp_of(k));
  }
  EXPECT_TRUE(queue.waiting().empty());
}

TEST(FixQueue, keeps_what_was_told_last_of_a_fix_that_waits) {
  FixQueue queue = settled(10);
  queue.put(told(11));
  ToldFix changed = told(11);
  changed.refused_by_filter = Refusal{"gate", "refused after all"};
  queue.put(changed);
  EXPECT_EQ(queue.waiting().size(), 1U);
  EXPECT_EQ(queue.find(stamp_of(11))->refusal()->code, "gate");
}

}  // namespace
}  // namespace trigpoint::fusion_gate
