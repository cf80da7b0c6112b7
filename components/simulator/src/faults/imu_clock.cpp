// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/imu_clock.hpp"

namespace trigpoint::simulator {

void ImuClock::describe(ConfigFields& fields) {
  fields.number("shift_s", shift_s_, "added to the stamps; an hour is 3600", {-1e6, 1e6});
}

void ImuClock::on_imu(ImuEpoch& epoch, const FaultMoment&) const {
  epoch.stamp_shift_ns += from_seconds(shift_s_);
}

}  // namespace trigpoint::simulator
