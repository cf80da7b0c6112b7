// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// A constant error that the reported covariance does not admit, whatever its cause.
class GpsBias final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  Eigen::Vector3d offset_enu_m_{Eigen::Vector3d::Zero()};
  double random_horizontal_m_{0.0};
  double ramp_s_{0.0};
};

}  // namespace trigpoint::simulator
