// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_bias.hpp"

#include <algorithm>

namespace trigpoint::simulator {

void GpsBias::describe(ConfigFields& fields) {
  fields.vector3("offset_enu_m", offset_enu_m_, "added to the fix");
  fields.number(
      "random_horizontal_m", random_horizontal_m_, "added in a direction drawn once", kNotNegative);
  fields.number(
      "ramp_s", ramp_s_, "time over which the error grows to its size; 0 = at once", kNotNegative);
}

void GpsBias::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  const Eigen::Vector3d drawn = moment.whole.level_direction();
  const double grown = ramp_s_ > 0.0 ? std::min(1.0, moment.since_start_s / ramp_s_) : 1.0;
  epoch.extra_error_m += grown * (offset_enu_m_ + random_horizontal_m_ * drawn);
}

}  // namespace trigpoint::simulator
