// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "workers.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <thread>
#include <vector>

namespace trigpoint::lio_mapper {
namespace {

TEST(Workers, do_every_block_once) {
  for (const std::size_t threads : {1U, 2U, 5U}) {
    Workers workers(threads);
    for (const std::size_t blocks : {0U, 1U, 2U, 100U}) {
      std::vector<std::atomic<int>> done(blocks);
      workers.run(blocks, [&](std::size_t i) { ++done[i]; });
      for (const auto& count : done) {
        EXPECT_EQ(count, 1);
      }
    }
  }
}

TEST(Workers, are_more_than_one_thread_when_asked_for) {
  Workers workers(2);
  std::atomic<int> inside{0};
  // Each of the two blocks waits for the other: one thread alone would never end.
  workers.run(2, [&](std::size_t) {
    ++inside;
    while (inside < 2) {
      std::this_thread::yield();
    }
  });
  EXPECT_EQ(inside, 2);
}

}  // namespace
}  // namespace trigpoint::lio_mapper
