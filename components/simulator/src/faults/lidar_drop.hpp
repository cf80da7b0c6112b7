// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Sweeps that do not come, come empty, or come thin.
class LidarDrop final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_sweep(SweepEpoch& epoch, const FaultMoment& moment) const override;

 private:
  std::string mode_{"drop"};
  double share_{1.0};
};

}  // namespace trigpoint::simulator
