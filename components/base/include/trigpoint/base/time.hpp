// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <cmath>
#include <cstdint>

namespace trigpoint {

/// A moment or a duration in integer nanoseconds: the sensor's stamp, never arrival time unless
/// named so.
using Nanoseconds = std::int64_t;

inline constexpr Nanoseconds kNanosecondsPerSecond = 1'000'000'000;

/// For formulas only; differences of stamps first, then seconds, so that no digits are lost.
constexpr double to_seconds(Nanoseconds duration_ns) {
  return static_cast<double>(duration_ns) * 1e-9;
}

inline Nanoseconds from_seconds(double duration_s) {
  return static_cast<Nanoseconds>(std::llround(duration_s * 1e9));
}

/// Differences of usable stamps fit into 64 bits.
constexpr bool is_usable_stamp(Nanoseconds stamp_ns) {
  return stamp_ns >= 0 && stamp_ns < 8'000'000'000 * kNanosecondsPerSecond;
}

}  // namespace trigpoint
