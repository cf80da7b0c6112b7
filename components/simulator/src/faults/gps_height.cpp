// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_height.hpp"

#include "random_process.hpp"

namespace trigpoint::simulator {

void GpsHeight::describe(ConfigFields& fields) {
  fields.number("step_m", step_m_, "added at once");
  fields.number("rate_mps", rate_mps_, "of a steady drift; 0 = none");
  fields.number("walk_m_per_sqrt_s",
                walk_m_per_sqrt_s_,
                "random walk, one sigma after 1 s; grows with the root of time; 0 = none",
                kNotNegative);
}

void GpsHeight::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  const double t_s = moment.since_start_s;
  epoch.extra_error_m.z() += step_m_ + rate_mps_ * t_s;
  if (walk_m_per_sqrt_s_ > 0.0) {
    epoch.extra_error_m.z() += walk_m_per_sqrt_s_ * random_walk_at(t_s, moment.seed);
  }
}

}  // namespace trigpoint::simulator
