// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <chrono>
#include <cstdint>
#include <thread>

namespace trigpoint::bus::cyclonedds {

/// Holds the thread that made it back so that it sends at most a portion a period. Cyclone itself
/// asks for a message's bytes one datagram after another, which is where before_sending() is
/// called; its other threads, which repair, pass unhindered (their bursts are limited by Cyclone).
class Pacer {
 public:
  Pacer(std::int64_t portion_bytes, std::chrono::milliseconds period);

  void before_sending(std::size_t bytes);

 private:
  const std::int64_t portion_bytes_;
  const std::chrono::milliseconds period_;
  const std::thread::id paced_thread_;
  std::int64_t sent_bytes_{0};
  std::chrono::steady_clock::time_point period_end_{};
};

}  // namespace trigpoint::bus::cyclonedds
