// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Something covers the window: every ray ends on it, nearer than any true return.
class LidarBlock final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_sweep(SweepEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double range_m_{0.3};
};

}  // namespace trigpoint::simulator
