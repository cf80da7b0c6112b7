// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_outage.hpp"

namespace trigpoint::simulator {

void GpsOutage::describe(ConfigFields& fields) {
  fields.flag("silent", silent_, "true: no message; false: messages with status no fix");
}

void GpsOutage::on_gnss(GnssEpoch& epoch, const FaultMoment&) const {
  epoch.lost = epoch.lost || silent_;
  epoch.gnss_class = "none";
}

}  // namespace trigpoint::simulator
