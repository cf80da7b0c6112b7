// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_spike.hpp"

namespace trigpoint::simulator {

void GpsSpike::describe(ConfigFields& fields) {
  fields.number("share", share_, "of the fixes that are off", {0.0, 1.0});
  fields.number("lowest_m", lowest_m_, "horizontally off, least", kNotNegative);
  fields.number("highest_m", highest_m_, "horizontally off, most", kNotNegative);
}

void GpsSpike::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  if (moment.each.chance(share_)) {
    epoch.extra_error_m += moment.each.level_vector(lowest_m_, highest_m_);
  }
}

}  // namespace trigpoint::simulator
