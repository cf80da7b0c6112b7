// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_inflate.hpp"

#include "gnss_model.hpp"

#include <cmath>

namespace trigpoint::simulator {

void GpsInflate::describe(ConfigFields& fields) {
  fields.number("share", share_, "of the added error, on top of the class's sigma", {0.0, 10.0});
}

void GpsInflate::on_gnss(GnssEpoch& epoch, const FaultMoment&) const {
  if (epoch.gnss_class == "none") {
    return;
  }
  const Eigen::Vector3d& added_m = epoch.extra_error_m;
  const double level_m = added_m.head<2>().norm() / std::sqrt(2.0);
  const Eigen::Vector3d admitted_m = share_ * Eigen::Vector3d(level_m, level_m, added_m.z());
  epoch.report.variance_enu_m2 =
      gnss_class_model(epoch.gnss_class).reported_m.cwiseAbs2() + admitted_m.cwiseAbs2();
}

}  // namespace trigpoint::simulator
