// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/imu_gap.hpp"

namespace trigpoint::simulator {

void ImuGap::describe(ConfigFields& fields) {
  fields.number("share", share_, "of the samples lost", {0.0, 1.0});
}

void ImuGap::on_imu(ImuEpoch& epoch, const FaultMoment& moment) const {
  epoch.lost = epoch.lost || moment.each.chance(share_);
}

}  // namespace trigpoint::simulator
