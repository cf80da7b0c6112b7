// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/imu_saturation.hpp"

namespace trigpoint::simulator {

void ImuSaturation::describe(ConfigFields& fields) {
  fields.number("gyro_limit_radps", gyro_limit_radps_, "range of each axis", kPositive);
  fields.number("accel_limit_mps2", accel_limit_mps2_, "range of each axis", kPositive);
}

void ImuSaturation::on_imu(ImuEpoch& epoch, const FaultMoment&) const {
  ImuSample& sample = epoch.sample;
  sample.gyro_radps = sample.gyro_radps.cwiseMin(gyro_limit_radps_).cwiseMax(-gyro_limit_radps_);
  sample.accel_mps2 = sample.accel_mps2.cwiseMin(accel_limit_mps2_).cwiseMax(-accel_limit_mps2_);
}

}  // namespace trigpoint::simulator
