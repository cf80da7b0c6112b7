// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// A scanner whose clock is off, or runs fast; points and arrivals stay right.
class LidarClock final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_sweep(SweepEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double shift_s_{0.01};
  double drift_ppm_{0.0};
};

}  // namespace trigpoint::simulator
