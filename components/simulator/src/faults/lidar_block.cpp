// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/lidar_block.hpp"

namespace trigpoint::simulator {

void LidarBlock::describe(ConfigFields& fields) {
  fields.number("range_m", range_m_, "to the cover", {0.01, 100.0});
}

void LidarBlock::on_sweep(SweepEpoch& epoch, const FaultMoment&) const {
  epoch.cover_m = range_m_;
}

}  // namespace trigpoint::simulator
