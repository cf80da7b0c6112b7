// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_clock.hpp"

namespace trigpoint::simulator {

void GpsClock::describe(ConfigFields& fields) {
  fields.number("shift_s", shift_s_, "added to the stamps; an hour is 3600", {-1e6, 1e6});
  fields.flag("stopped", stopped_, "the stamps stay at the fault's start (and shift_s)");
}

void GpsClock::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  epoch.stamp_shift_ns += from_seconds(stopped_ ? shift_s_ - moment.since_start_s : shift_s_);
}

}  // namespace trigpoint::simulator
