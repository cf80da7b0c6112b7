// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_wrong_fix.hpp"

namespace trigpoint::simulator {

void GpsWrongFix::describe(ConfigFields& fields) {
  fields.number("lowest_m", lowest_m_, "size of the horizontal error, least", kNotNegative);
  fields.number("highest_m", highest_m_, "size of the horizontal error, most", kNotNegative);
  fields.vector3("offset_enu_m", offset_enu_m_, "instead of a drawn one; zero = drawn");
}

void GpsWrongFix::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  epoch.gnss_class = "fixed";
  const Eigen::Vector3d drawn = moment.whole.level_vector(lowest_m_, highest_m_);
  epoch.extra_error_m += offset_enu_m_.isZero() ? drawn : offset_enu_m_;
}

}  // namespace trigpoint::simulator
