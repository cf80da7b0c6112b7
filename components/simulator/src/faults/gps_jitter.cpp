// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_jitter.hpp"

#include <algorithm>

namespace trigpoint::simulator {

void GpsJitter::describe(ConfigFields& fields) {
  fields.number("stamp_s", stamp_s_, "half width of the stamps' error, uniform", {0.0, 10.0});
  fields.number("latency_s", latency_s_, "half width of what the latency varies by", {0.0, 10.0});
}

void GpsJitter::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  epoch.stamp_shift_ns += from_seconds(moment.each.uniform(-stamp_s_, stamp_s_));
  epoch.latency_s = std::max(0.0, epoch.latency_s + moment.each.uniform(-latency_s_, latency_s_));
}

}  // namespace trigpoint::simulator
