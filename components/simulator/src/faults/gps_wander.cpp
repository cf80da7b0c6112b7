// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_wander.hpp"

#include "stretches.hpp"

#include <algorithm>

namespace trigpoint::simulator {

namespace {

/// From 0 to 1 without a jump of the rate at either end.
double smooth_step(double u) {
  return u * u * (3.0 - 2.0 * u);
}

}  // namespace

void GpsWander::describe(ConfigFields& fields) {
  fields.number("size_m", size_m_, "level, at the far end", kNotNegative);
  fields.number("shortest_s", shortest_s_, "one way", {0.1, 1e5});
  fields.number("longest_s", longest_s_, "one way", {0.1, 1e5});
}

void GpsWander::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  double out_s = 0.0;
  double back_s = 0.0;
  Stretch stretch = stretch_at(moment.since_start_s, moment.seed, [&](Random& random) {
    out_s = random.uniform(shortest_s_, std::max(shortest_s_, longest_s_));
    back_s = random.uniform(shortest_s_, std::max(shortest_s_, longest_s_));
    return out_s + back_s;
  });
  const double share = stretch.since_s < out_s
                           ? smooth_step(stretch.since_s / out_s)
                           : 1.0 - smooth_step((stretch.since_s - out_s) / back_s);
  epoch.extra_error_m += share * size_m_ * stretch.random.level_direction();
}

}  // namespace trigpoint::simulator
