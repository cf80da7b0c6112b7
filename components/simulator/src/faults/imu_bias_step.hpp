// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Biases that step, by a shock or heat.
class ImuBiasStep final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_imu(ImuEpoch& epoch, const FaultMoment& moment) const override;

 private:
  Eigen::Vector3d gyro_radps_{0.0, 0.0, 0.01};
  Eigen::Vector3d accel_mps2_{0.1, 0.0, 0.0};
};

}  // namespace trigpoint::simulator
