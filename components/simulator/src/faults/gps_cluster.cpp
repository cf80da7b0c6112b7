// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_cluster.hpp"

namespace trigpoint::simulator {

void GpsCluster::describe(ConfigFields& fields) {
  fields.number("blackout_s", blackout_s_, "without any message, first", kNotNegative);
  fields.number("cluster_s", cluster_s_, "far away, after it; then it is over", kNotNegative);
  fields.number("lowest_m", lowest_m_, "horizontal distance of the cluster, least", kNotNegative);
  fields.number("highest_m", highest_m_, "horizontal distance of the cluster, most", kNotNegative);
  fields.number("scatter_m", scatter_m_, "white noise within it, one sigma an axis", kNotNegative);
}

void GpsCluster::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  if (moment.since_start_s < blackout_s_) {
    epoch.lost = true;
  } else if (moment.since_start_s < blackout_s_ + cluster_s_) {
    epoch.extra_error_m +=
        moment.whole.level_vector(lowest_m_, highest_m_) + scatter_m_ * moment.each.normal3();
  }
}

}  // namespace trigpoint::simulator
