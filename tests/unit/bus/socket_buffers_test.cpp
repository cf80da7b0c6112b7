// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "socket_buffers.hpp"

#include <gtest/gtest.h>

namespace trigpoint::bus {
namespace {

constexpr SocketBuffers kLarge{8'000'000, 8'000'000};
constexpr SocketBuffers kStock{212'992, 212'992};

double bytes_per_second(const Pacing& pacing) {
  return static_cast<double>(pacing.portion_bytes) /
         std::chrono::duration<double>(pacing.period).count();
}

TEST(Pacing, is_off_with_large_buffers_and_no_limit) {
  EXPECT_FALSE(pacing_of(Config{}, kLarge).has_value());
}

TEST(Pacing, keeps_the_wanted_rate_with_every_size_of_datagram) {
  for (const std::int64_t datagram_bytes : {1472, 65'500}) {
    for (const std::int64_t rate : {100'000, 1'000'000, 11'500'000, 100'000'000}) {
      Config config;
      config.datagram_bytes = datagram_bytes;
      config.bulk_bytes_per_s = rate;
      const auto pacing = pacing_of(config, kLarge);
      ASSERT_TRUE(pacing.has_value());
      EXPECT_GE(pacing->portion_bytes, datagram_bytes);
      EXPECT_NEAR(
          bytes_per_second(*pacing), static_cast<double>(rate), 0.01 * static_cast<double>(rate));
    }
  }
}

TEST(Pacing, takes_the_slower_of_buffers_and_limit) {
  Config fast;
  fast.bulk_bytes_per_s = 1'000'000'000;
  const auto by_buffers = pacing_of(Config{}, kStock);
  ASSERT_TRUE(by_buffers.has_value());
  EXPECT_EQ(bytes_per_second(*pacing_of(fast, kStock)), bytes_per_second(*by_buffers));
  Config slow;
  slow.bulk_bytes_per_s = 1'000'000;
  EXPECT_LT(bytes_per_second(*pacing_of(slow, kStock)), 1.01e6);
}

}  // namespace
}  // namespace trigpoint::bus
