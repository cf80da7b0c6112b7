// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// A receiver whose clock is off, or stands still; positions and arrivals stay right.
class GpsClock final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double shift_s_{1.0};
  bool stopped_{false};
};

}  // namespace trigpoint::simulator
