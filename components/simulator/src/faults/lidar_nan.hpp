// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Returns that the driver writes as not a number instead of leaving them out.
class LidarNan final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_sweep(SweepEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double share_{0.1};
};

}  // namespace trigpoint::simulator
