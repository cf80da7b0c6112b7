// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Reads a log through and says what is odd in it, before anyone blames the filters.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/recording/log.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint::recording {

/// One of the three inputs as it came.
struct InputStatistics {
  std::string input;  ///< "points", "imu" or "fix"
  std::uint64_t messages{0};
  std::string frame_id;       ///< of the first message
  double rate_hz{0.0};        ///< from the stamps; 0 with fewer than two messages
  double longest_gap_s{0.0};  ///< between stamps
  std::uint64_t backward_stamps{0};
  double latency_s{0.0};  ///< mean of arrival minus stamp
};

struct Inspection {
  std::vector<InputStatistics> inputs;  ///< those that have messages
  Events events;                        ///< kError: mapping can't work; kWarning: look at it
};

/// Reads `log` to its end, or for `at_most_s` seconds of it (0 = all). A log that breaks off is an
/// event, not an exception. Codes: log_breaks_off, imu_in_g, imu_without_gravity, imu_gravity_odd,
/// imu_gyro_in_degrees, imu_not_finite, imu_slow, points_without_time, points_empty,
/// fix_none_valid, fix_some_invalid, fix_covariance_unknown, fix_at_zero, stamps_backward,
/// stamps_gap, clocks_differ.
Inspection inspect_log(LogReader& log, double at_most_s = 0.0);

/// The events alone.
Events inspect(LogReader& log);

}  // namespace trigpoint::recording
