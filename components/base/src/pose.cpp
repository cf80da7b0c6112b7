// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/pose.hpp"

#include "trigpoint/base/so3.hpp"

namespace trigpoint {

Pose interpolate(const Pose& from, const Pose& to, double fraction) {
  return {from.q.slerp(fraction, to.q), from.p + fraction * (to.p - from.p)};
}

Pose YawPose::pose() const {
  return {(from_yaw(yaw_rad) * so3_exp({tilt_rad.x(), tilt_rad.y(), 0.0})).normalized(), p};
}

}  // namespace trigpoint
