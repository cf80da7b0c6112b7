// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// Signals that come by way of a facade only: an error that is constant for some seconds and that
/// the covariance does not admit.
class GpsNlos final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  double lowest_m_{3.0};
  double highest_m_{12.0};
  double vertical_ratio_{0.8};
  double shortest_s_{5.0};
  double longest_s_{15.0};
  double share_{1.0};
};

/// Horizontally `lowest_m` to `highest_m` in any direction, upwards that times `vertical_ratio`
/// times N(0, 1).
Eigen::Vector3d nlos_error(double lowest_m,
                           double highest_m,
                           double vertical_ratio,
                           Random& random);

}  // namespace trigpoint::simulator
