// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A receiver between houses (research/gps C7): RTK fixed, float, code and nothing take turns;
// errors are correlated in time, a re-fix is sometimes wrong, code positions are sometimes
// reflections.
#pragma once

#include "drive.hpp"

#include <vector>

namespace trigpoint::gps_odometry {

struct UrbanReceiver {
  double wrong_fix_share{0.15};   ///< of re-fixes, for the whole fixed interval
  double reflection_share{0.4};   ///< of code intervals
  double open_sky_until_s{30.0};  ///< fixed and right until then
  double longest_outage_s{30.0};
};

/// The IMU of `sensors`, with the fixes of this receiver, in the order of their availability.
std::vector<Input> sense_urban(const std::vector<Truth>& truth,
                               const Sensors& sensors,
                               const UrbanReceiver& receiver,
                               unsigned seed);

}  // namespace trigpoint::gps_odometry
