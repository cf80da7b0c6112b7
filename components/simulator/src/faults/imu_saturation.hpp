// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// A smaller measuring range: what is beyond it reads as its end.
class ImuSaturation final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_imu(ImuEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double gyro_limit_radps_{0.5};
  double accel_limit_mps2_{12.0};
};

}  // namespace trigpoint::simulator
