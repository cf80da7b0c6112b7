// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// A blackout, after which the receiver comes back with some fixes that agree with each other and
/// are far away (NCLT 2012-08-20).
class GpsCluster final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double blackout_s_{211.0};
  double cluster_s_{24.0};
  double lowest_m_{700.0};
  double highest_m_{850.0};
  double scatter_m_{5.0};
};

}  // namespace trigpoint::simulator
