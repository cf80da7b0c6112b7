// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_late.hpp"

namespace trigpoint::simulator {

void GpsLate::describe(ConfigFields& fields) {
  fields.number("share", share_, "of the fixes", {0.0, 1.0});
  fields.number("delay_s", delay_s_, "added to the latency", kNotNegative);
}

void GpsLate::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  if (moment.each.chance(share_)) {
    epoch.latency_s += delay_s_;
  }
}

}  // namespace trigpoint::simulator
