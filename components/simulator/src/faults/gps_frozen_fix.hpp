// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// The driver repeats its last fix, position, status and covariance, under new stamps.
class GpsFrozenFix final : public Fault {
 public:
  void describe(ConfigFields&) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;
};

}  // namespace trigpoint::simulator
