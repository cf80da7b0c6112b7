// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_no_covariance.hpp"

namespace trigpoint::simulator {

void GpsNoCovariance::describe(ConfigFields&) {}

void GpsNoCovariance::on_gnss(GnssEpoch& epoch, const FaultMoment&) const {
  epoch.report.covariance_unknown = true;
}

}  // namespace trigpoint::simulator
