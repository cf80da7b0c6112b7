// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_multipath.hpp"

#include "random_process.hpp"

#include <algorithm>

namespace trigpoint::simulator {

void GpsMultipath::describe(ConfigFields& fields) {
  fields.number("ramp_mps", ramp_mps_, "growth of the error; 0 = no ramp", kNotNegative);
  fields.number("ramp_limit_m", ramp_limit_m_, "size at which it stays", kNotNegative);
  fields.vector3("direction_enu", direction_enu_, "of the ramp; zero = level, drawn once");
  fields.vector3("wander_sigma_enu_m",
                 wander_sigma_enu_m_,
                 "of a Gauss-Markov error besides; zero = none",
                 kNotNegative);
  fields.number("wander_tau_s", wander_tau_s_, "its correlation time", {1.0, 1e5});
}

void GpsMultipath::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  const Eigen::Vector3d drawn = moment.whole.level_direction();
  const Eigen::Vector3d direction = direction_enu_.isZero() ? drawn : direction_enu_.normalized();
  epoch.extra_error_m += std::min(ramp_limit_m_, ramp_mps_ * moment.since_start_s) * direction;
  if (wander_sigma_enu_m_.isZero()) {
    return;
  }
  for (int axis = 0; axis < 3; ++axis) {
    epoch.extra_error_m[axis] +=
        wander_sigma_enu_m_[axis] *
        gauss_markov_at(moment.since_start_s,
                        wander_tau_s_,
                        derive_seed(moment.seed, static_cast<std::uint64_t>(axis)));
  }
}

}  // namespace trigpoint::simulator
