// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/lidar_nan.hpp"

namespace trigpoint::simulator {

void LidarNan::describe(ConfigFields& fields) {
  fields.number("share", share_, "of the returns", {0.0, 1.0});
}

void LidarNan::on_sweep(SweepEpoch& epoch, const FaultMoment&) const {
  epoch.nan_share = 1.0 - (1.0 - epoch.nan_share) * (1.0 - share_);
}

}  // namespace trigpoint::simulator
