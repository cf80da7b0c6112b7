// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fault.hpp"

namespace trigpoint::simulator {

/// IMU samples that do not come: all, a share, or gaps of random length now and then.
class ImuGap final : public Fault {
 public:
  void describe(ConfigFields& fields) override;
  void on_imu(ImuEpoch& epoch, const FaultMoment& moment) const override;

 private:
  bool is_between_gaps(const FaultMoment& moment) const;

  double share_{1.0};
  double every_s_{0.0};
  double shortest_s_{0.05};
  double longest_s_{5.0};
};

}  // namespace trigpoint::simulator
