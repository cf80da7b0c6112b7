// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/lidar_clock.hpp"

namespace trigpoint::simulator {

void LidarClock::describe(ConfigFields& fields) {
  fields.number("shift_s", shift_s_, "added to the stamps; negative: back in time", {-1e6, 1e6});
  fields.number("drift_ppm", drift_ppm_, "us that it gains in every second on top", {-1e5, 1e5});
}

void LidarClock::on_sweep(SweepEpoch& epoch, const FaultMoment& moment) const {
  epoch.stamp_shift_ns += from_seconds(shift_s_ + 1e-6 * drift_ppm_ * moment.since_start_s);
}

}  // namespace trigpoint::simulator
