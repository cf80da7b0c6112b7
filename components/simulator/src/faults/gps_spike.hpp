// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Single fixes far off, each in its own direction.
class GpsSpike final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double share_{0.02};
  double lowest_m_{5.0};
  double highest_m_{700.0};
};

}  // namespace trigpoint::simulator
