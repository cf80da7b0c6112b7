// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_outage.hpp"

namespace trigpoint::simulator {

void GpsOutage::describe(ConfigFields& fields) {
  fields.flag("silent", silent_, "true: no message; false: messages with status no fix");
  fields.number("share", share_, "of the fixes that are lost", {0.0, 1.0});
}

void GpsOutage::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  if (!moment.each.chance(share_)) {
    return;
  }
  epoch.lost = epoch.lost || silent_;
  epoch.gnss_class = "none";
}

}  // namespace trigpoint::simulator
