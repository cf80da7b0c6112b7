// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// The reported covariance stays what it was (a latched GST message) whatever the errors do.
class GpsFrozenCovariance final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const override;

 private:
  Eigen::Vector3d sigma_enu_m_{0.014, 0.014, 0.024};
};

}  // namespace trigpoint::simulator
