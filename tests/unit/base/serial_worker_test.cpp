// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/serial_worker.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <numeric>
#include <stdexcept>
#include <vector>

namespace trigpoint {
namespace {

TEST(BoundedQueue, gives_back_in_order_and_ends_after_it_was_closed) {
  BoundedQueue<int> queue(3);
  EXPECT_TRUE(queue.push(1));
  EXPECT_TRUE(queue.push(2));
  queue.close();
  EXPECT_FALSE(queue.push(3));
  EXPECT_EQ(queue.pop(), 1);
  EXPECT_EQ(queue.pop(), 2);
  EXPECT_EQ(queue.pop(), std::nullopt);
}

TEST(BoundedQueue, holds_back_who_puts_into_it_while_it_is_full) {
  constexpr std::size_t kCapacity = 4;
  constexpr int kItems = 1000;
  BoundedQueue<int> queue(kCapacity);
  std::atomic<int> pushed{0};
  std::thread source([&] {
    for (int i = 0; i < kItems; ++i) {
      queue.push(i);
      ++pushed;
    }
    queue.close();
  });
  int taken = 0;
  while (const auto item = queue.pop()) {
    EXPECT_EQ(*item, taken);
    ++taken;
    // Those taken, those that fit, and the one whose push has not returned yet counts later.
    EXPECT_LE(pushed.load(), taken + static_cast<int>(kCapacity));
  }
  source.join();
  EXPECT_EQ(taken, kItems);
}

TEST(BoundedQueue, wakes_who_waits_for_room_when_it_is_closed) {
  BoundedQueue<int> queue(1);
  queue.push(1);
  auto waiting = std::async(std::launch::async, [&] { return queue.push(2); });
  queue.close();
  EXPECT_FALSE(waiting.get());
}

TEST(SerialWorker, does_everything_in_order_before_finish_returns) {
  std::vector<int> done;
  SerialWorker worker(8);
  for (int i = 0; i < 500; ++i) {
    worker.give([&done, i] { done.push_back(i); });
  }
  worker.finish();
  std::vector<int> expected(500);
  std::iota(expected.begin(), expected.end(), 0);
  EXPECT_EQ(done, expected);
}

TEST(SerialWorker, does_what_waits_when_it_is_destroyed) {
  int done = 0;
  {
    SerialWorker worker(8);
    for (int i = 0; i < 5; ++i) {
      worker.give([&done] { ++done; });
    }
  }
  EXPECT_EQ(done, 5);
}

TEST(SerialWorker, does_not_hold_its_giver_back_while_a_job_takes_long) {
  std::promise<void> release;
  int done = 0;
  SerialWorker worker(10);
  worker.give([&, held = release.get_future().share()] {
    held.wait();
    ++done;
  });
  for (int i = 0; i < 9; ++i) {
    worker.give([&done] { ++done; });  // would never return if it waited for the first
  }
  release.set_value();
  worker.finish();
  EXPECT_EQ(done, 10);
}

TEST(SerialWorker, tells_its_giver_what_a_job_threw_and_does_no_later_one) {
  int done = 0;
  SerialWorker worker(4);
  worker.give([] { throw std::runtime_error("no space left"); });
  try {
    for (int i = 0; i < 1000; ++i) {
      worker.give([&done] { ++done; });  // never blocks for good, though nothing is done any more
    }
    worker.finish();
    FAIL() << "the failure was kept secret";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "no space left");
  }
  EXPECT_THROW(worker.finish(), std::runtime_error);
  EXPECT_EQ(done, 0);
}

}  // namespace
}  // namespace trigpoint
