// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// An IMU whose clock is off; samples and arrivals stay right.
class ImuClock final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_imu(ImuEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double shift_s_{1.0};
};

}  // namespace trigpoint::simulator
