// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_reorder.hpp"

namespace trigpoint::simulator {

void GpsReorder::describe(ConfigFields& fields) {
  fields.number("share", share_, "of the fixes that are overtaken", {0.0, 1.0});
  fields.integer("behind", behind_, "how many newer ones overtake it", {1.0, 100.0});
}

void GpsReorder::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  if (moment.each.chance(share_)) {
    // Half a period more, so that varying latency does not restore the order.
    epoch.latency_s += (static_cast<double>(behind_) + 0.5) * epoch.period_s;
  }
}

}  // namespace trigpoint::simulator
