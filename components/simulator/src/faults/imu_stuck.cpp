// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/imu_stuck.hpp"

namespace trigpoint::simulator {

void ImuStuck::describe(ConfigFields&) {}

void ImuStuck::on_imu(ImuEpoch& epoch, const FaultMoment&) const {
  epoch.frozen = true;
}

}  // namespace trigpoint::simulator
