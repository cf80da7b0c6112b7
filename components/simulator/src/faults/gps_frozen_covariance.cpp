// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_frozen_covariance.hpp"

namespace trigpoint::simulator {

void GpsFrozenCovariance::describe(ConfigFields& fields) {
  fields.vector3("sigma_enu_m", sigma_enu_m_, "that is reported all the while", kNotNegative);
}

void GpsFrozenCovariance::on_gnss(GnssEpoch& epoch, const FaultMoment&) const {
  epoch.report.variance_enu_m2 = sigma_enu_m_.cwiseAbs2();
}

}  // namespace trigpoint::simulator
