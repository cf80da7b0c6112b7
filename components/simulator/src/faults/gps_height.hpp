// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// A height that steps, drifts or walks away while east and north stay good.
class GpsHeight final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double step_m_{0.0};
  double rate_mps_{0.0};
  double walk_m_per_sqrt_s_{1.0};
};

}  // namespace trigpoint::simulator
