// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Fixes that say nothing of their accuracy: covariance zero, type unknown.
class GpsNoCovariance final : public Fault {
 public:
  void describe(ConfigFields&) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;
};

}  // namespace trigpoint::simulator
