// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// A street between houses: fixed, float, code and no solution follow each other by chance. Begins
/// with a right fixed one.
class GpsUrban final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  bool silent_{true};
  double wrong_fix_share_{0.15};
  double nlos_share_{0.4};
};

}  // namespace trigpoint::simulator
