// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Reflections: an error that drifts away smoothly, or wanders with a given correlation in time, or
/// both, under an unchanged covariance.
class GpsMultipath final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double ramp_mps_{0.2};
  double ramp_limit_m_{8.0};
  Eigen::Vector3d direction_enu_{Eigen::Vector3d::Zero()};
  Eigen::Vector3d wander_sigma_enu_m_{Eigen::Vector3d::Zero()};
  double wander_tau_s_{100.0};
};

}  // namespace trigpoint::simulator
