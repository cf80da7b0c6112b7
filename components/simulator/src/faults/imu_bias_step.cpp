// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/imu_bias_step.hpp"

namespace trigpoint::simulator {

void ImuBiasStep::describe(ConfigFields& fields) {
  fields.vector3("gyro_radps", gyro_radps_, "added, axes of base_link");
  fields.vector3("accel_mps2", accel_mps2_, "added, axes of base_link");
}

void ImuBiasStep::on_imu(ImuEpoch& epoch, const FaultMoment&) const {
  epoch.sample.gyro_radps += gyro_radps_;
  epoch.sample.accel_mps2 += accel_mps2_;
}

}  // namespace trigpoint::simulator
