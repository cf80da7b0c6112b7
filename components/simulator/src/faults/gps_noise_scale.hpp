// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Errors larger than the receiver says.
class GpsNoiseScale final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double factor_{5.0};
};

}  // namespace trigpoint::simulator
