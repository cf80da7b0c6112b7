// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// A receiver that knows a part of its errors: what the faults before this one in the list added is
/// admitted in the covariance by a share.
class GpsInflate final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double share_{0.4};
};

}  // namespace trigpoint::simulator
