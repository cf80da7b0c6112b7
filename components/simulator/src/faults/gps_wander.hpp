// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// A smooth walk of the fix: out to a place drawn anew, back to the truth, out again, each way
/// taking a time of its own.
class GpsWander final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double size_m_{5.0};
  double shortest_s_{20.0};
  double longest_s_{60.0};
};

}  // namespace trigpoint::simulator
