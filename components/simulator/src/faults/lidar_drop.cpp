// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/lidar_drop.hpp"

namespace trigpoint::simulator {

namespace {

constexpr std::uint16_t kRing = 5;  ///< looks at the ground or at a wall in every model

}  // namespace

void LidarDrop::describe(ConfigFields& fields) {
  fields.choice("mode",
                mode_,
                "no message, a message without points, fewer points, or one ring",
                {"drop", "blank", "thin", "one_ring"});
  fields.number("share", share_, "of the sweeps, or of the points (thin)", {0.0, 1.0});
}

void LidarDrop::on_sweep(SweepEpoch& epoch, const FaultMoment& moment) const {
  if (mode_ == "thin") {
    epoch.dropout = 1.0 - (1.0 - epoch.dropout) * (1.0 - share_);
    return;
  }
  const bool hit = moment.each.chance(share_);
  epoch.lost = epoch.lost || (hit && mode_ == "drop");
  if (hit && mode_ == "one_ring") {
    epoch.only_ring = kRing;
  }
  epoch.blank = epoch.blank || (hit && mode_ == "blank");
}

}  // namespace trigpoint::simulator
