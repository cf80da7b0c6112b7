// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_nlos.hpp"

#include "stretches.hpp"

namespace trigpoint::simulator {

void GpsNlos::describe(ConfigFields& fields) {
  fields.number("lowest_m", lowest_m_, "size of the horizontal error, least", kNotNegative);
  fields.number("highest_m", highest_m_, "size of the horizontal error, most", kNotNegative);
  fields.number("vertical_ratio",
                vertical_ratio_,
                "sigma of the error upwards over the horizontal size",
                kNotNegative);
  fields.number("shortest_s", shortest_s_, "for which one error stays, least", {0.1, 1e5});
  fields.number("longest_s", longest_s_, "for which one error stays, most", {0.1, 1e5});
  fields.number("share", share_, "of these stretches that are wrong", {0.0, 1.0});
}

void GpsNlos::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  Stretch stretch = stretch_at(moment.since_start_s, moment.seed, [this](Random& random) {
    return random.uniform(shortest_s_, longest_s_);
  });
  if (stretch.random.chance(share_)) {
    epoch.extra_error_m += nlos_error(lowest_m_, highest_m_, vertical_ratio_, stretch.random);
  }
}

Eigen::Vector3d nlos_error(double lowest_m,
                           double highest_m,
                           double vertical_ratio,
                           Random& random) {
  Eigen::Vector3d error_m = random.level_vector(lowest_m, highest_m);
  error_m.z() = vertical_ratio * error_m.norm() * random.normal();
  return error_m;
}

}  // namespace trigpoint::simulator
