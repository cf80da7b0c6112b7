// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// IMU samples that do not come.
class ImuGap final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_imu(ImuEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double share_{1.0};
};

}  // namespace trigpoint::simulator
