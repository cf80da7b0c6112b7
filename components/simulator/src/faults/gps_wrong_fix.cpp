// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_wrong_fix.hpp"

#include "stretches.hpp"

#include <algorithm>

namespace trigpoint::simulator {

void GpsWrongFix::describe(ConfigFields& fields) {
  fields.number("lowest_m", lowest_m_, "size of the horizontal error, least", kNotNegative);
  fields.number("highest_m", highest_m_, "size of the horizontal error, most", kNotNegative);
  fields.vector3("offset_enu_m", offset_enu_m_, "instead of a drawn one; zero = drawn");
  fields.number("every_s",
                every_s_,
                "mean time of right fixes between wrong ones, half to one and a half of it; 0 = "
                "wrong all the time",
                {0.0, 1e5});
  fields.number("shortest_s", shortest_s_, "of these wrong ones", {0.1, 1e4});
  fields.number("longest_s", longest_s_, "of these wrong ones", {0.1, 1e4});
}

void GpsWrongFix::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  if (every_s_ > 0.0) {
    return add_now_and_then(epoch, moment);
  }
  epoch.gnss_class = "fixed";
  const Eigen::Vector3d drawn = moment.whole.level_vector(lowest_m_, highest_m_);
  epoch.extra_error_m += offset_enu_m_.isZero() ? drawn : offset_enu_m_;
}

/// Right first, then wrong, each wrong one with an error of its own.
void GpsWrongFix::add_now_and_then(GnssEpoch& epoch, const FaultMoment& moment) const {
  double right_s = 0.0;
  Stretch stretch = stretch_at(moment.since_start_s, moment.seed, [&](Random& random) {
    right_s = random.uniform(0.5, 1.5) * every_s_;
    return right_s + random.uniform(shortest_s_, std::max(shortest_s_, longest_s_));
  });
  if (stretch.since_s < right_s) {
    return;
  }
  epoch.gnss_class = "fixed";
  const Eigen::Vector3d drawn = stretch.random.level_vector(lowest_m_, highest_m_);
  epoch.extra_error_m += offset_enu_m_.isZero() ? drawn : offset_enu_m_;
}

}  // namespace trigpoint::simulator
