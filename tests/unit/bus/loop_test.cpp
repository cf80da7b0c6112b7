// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/bus/loop.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <future>
#include <stdexcept>
#include <vector>

namespace trigpoint::bus {
namespace {

using namespace std::chrono_literals;
using ::testing::ElementsAre;

// Far above anything a loaded machine needs; only a broken loop waits so long.
constexpr auto kForever = 20s;

TEST(Loop, runs_tasks_in_order_on_the_thread_that_called_run) {
  Loop loop;
  std::vector<int> order;
  std::thread::id ran_on;
  std::thread poster([&] {
    loop.post([&] { order.push_back(1); });
    loop.post([&] { order.push_back(2); });
    loop.post([&] {
      ran_on = std::this_thread::get_id();
      loop.stop();
    });
  });
  EXPECT_EQ(loop.run(), 0);
  poster.join();
  EXPECT_THAT(order, ElementsAre(1, 2));
  EXPECT_EQ(ran_on, std::this_thread::get_id());
}

TEST(Loop, drops_and_counts_the_oldest_droppable_task_when_full) {
  Loop loop(2);
  std::vector<int> order;
  EXPECT_TRUE(loop.post([&] { order.push_back(1); }));
  EXPECT_TRUE(loop.post([&] { order.push_back(2); }, WhenFull::kDropOldest));
  EXPECT_TRUE(loop.post([&] { order.push_back(3); }, WhenFull::kDropOldest));
  EXPECT_EQ(loop.dropped(), 1U);
  EXPECT_EQ(loop.queued(), 2U);
  loop.every(1ms, [&] {
    if (order.size() == 2) {
      loop.stop();
    }
  });
  loop.run();
  EXPECT_THAT(order, ElementsAre(1, 3));
}

TEST(Loop, drops_the_new_task_when_no_waiting_one_may_be_dropped) {
  Loop loop(1);
  EXPECT_TRUE(loop.post([] {}));
  EXPECT_FALSE(loop.post([] {}, WhenFull::kDropOldest));
  EXPECT_EQ(loop.dropped(), 1U);
  EXPECT_EQ(loop.queued(), 1U);
}

TEST(Loop, holds_a_blocking_poster_back_until_there_is_room) {
  Loop loop(1);
  loop.post([] {});
  auto posted = std::async(std::launch::async, [&] { return loop.post([&] { loop.stop(); }); });
  EXPECT_EQ(posted.wait_for(50ms), std::future_status::timeout);
  loop.run();
  ASSERT_EQ(posted.wait_for(kForever), std::future_status::ready);
  EXPECT_TRUE(posted.get());
}

TEST(Loop, releases_a_blocked_poster_when_it_stops) {
  Loop loop(1);
  loop.post([] {});
  auto posted = std::async(std::launch::async, [&] { return loop.post([] {}); });
  loop.stop();
  ASSERT_EQ(posted.wait_for(kForever), std::future_status::ready);
  EXPECT_FALSE(posted.get());
}

TEST(Loop, does_not_block_its_own_thread) {
  Loop loop(1);
  loop.post([&] {
    loop.post([] {});
    loop.post([&] { loop.stop(); });
  });
  EXPECT_EQ(loop.run(), 0);
}

TEST(Loop, waits_between_tasks_and_only_then) {
  Loop loop;
  EXPECT_FALSE(loop.is_waiting());  // it does not run yet
  bool waits_in_a_task = true;
  std::thread poster([&] {
    const auto until_it_waits = [&] {
      while (!loop.is_waiting()) {
        std::this_thread::yield();
      }
    };
    until_it_waits();
    loop.post([&] { waits_in_a_task = loop.is_waiting(); });
    until_it_waits();
    loop.stop();
  });
  loop.run();
  poster.join();
  EXPECT_FALSE(waits_in_a_task);
  EXPECT_FALSE(loop.is_waiting());
}

TEST(Loop, fires_a_timer_again_and_again_and_not_early) {
  Loop loop;
  int fired = 0;
  const auto start = std::chrono::steady_clock::now();
  loop.every(20ms, [&] {
    if (++fired == 3) {
      loop.stop();
    }
  });
  loop.run();
  EXPECT_GE(std::chrono::steady_clock::now() - start, 60ms);
}

TEST(Loop, does_not_let_a_full_queue_starve_a_timer) {
  Loop loop;
  std::function<void()> again = [&] { loop.post(again); };
  loop.post(again);
  loop.every(5ms, [&] { loop.stop(); });
  EXPECT_EQ(loop.run(), 0);
}

TEST(Loop, skips_the_periods_that_a_slow_task_missed) {
  Loop loop;
  int fired = 0;
  loop.post([] { std::this_thread::sleep_for(100ms); });
  loop.every(10ms, [&] { ++fired; });
  loop.every(135ms, [&] { loop.stop(); });
  loop.run();
  EXPECT_LE(fired, 6);  // 13 if the missed ones were made up for
}

TEST(Loop, does_not_fire_a_cancelled_timer) {
  Loop loop;
  bool fired = false;
  const auto timer = loop.every(1ms, [&] { fired = true; });
  loop.cancel(timer);
  loop.every(30ms, [&] { loop.stop(); });
  loop.run();
  EXPECT_FALSE(fired);
}

TEST(Loop, lets_an_exception_out_of_run_and_takes_nothing_more) {
  Loop loop;
  loop.post([] { throw std::runtime_error("disk full"); });
  EXPECT_THROW(loop.run(), std::runtime_error);
  EXPECT_FALSE(loop.post([] {}));
}

TEST(Loop, refuses_a_timer_without_a_period) {
  Loop loop;
  EXPECT_THROW(loop.every(0ms, [] {}), std::invalid_argument);
}

class EndingSignal : public ::testing::TestWithParam<int> {};

TEST_P(EndingSignal, ends_the_loop_and_is_told) {
  Loop loop;
  loop.post([] { kill(getpid(), GetParam()); });
  EXPECT_EQ(loop.run(), GetParam());
  EXPECT_TRUE(loop.stopped());
}

INSTANTIATE_TEST_SUITE_P(Loop, EndingSignal, ::testing::Values(SIGINT, SIGTERM));

TEST(Loop, does_not_run_when_it_was_stopped_before) {
  Loop loop;
  loop.post([] { FAIL(); });
  loop.stop();
  EXPECT_EQ(loop.run(), 0);
}

}  // namespace
}  // namespace trigpoint::bus
