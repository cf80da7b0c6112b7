// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// No fixes at all, or fixes that say they are none.
class GpsOutage final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  bool silent_{true};
  double share_{1.0};
};

}  // namespace trigpoint::simulator
