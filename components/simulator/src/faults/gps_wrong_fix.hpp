// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Integer ambiguities fixed to wrong values: a constant error at the class and covariance of a
/// right fixed solution; all the time, or now and then.
class GpsWrongFix final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  void add_now_and_then(GnssEpoch& epoch, const FaultMoment& moment) const;

  double lowest_m_{0.4};
  double highest_m_{1.6};
  Eigen::Vector3d offset_enu_m_{Eigen::Vector3d::Zero()};
  double every_s_{0.0};
  double shortest_s_{10.0};
  double longest_s_{40.0};
};

}  // namespace trigpoint::simulator
