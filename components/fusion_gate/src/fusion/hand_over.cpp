// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fusion/hand_over.hpp"

#include "trigpoint/base/so3.hpp"

#include <algorithm>

namespace trigpoint::fusion_gate {

Odometry HandOver::follow(const Odometry& raw, const Pose& unchanged, Offset offset) {
  if (last_ns_) {
    offset_map_m_ += unchanged.p - raw.T_frame_child.p;
    turn_ = (turn_ * unchanged.q * raw.T_frame_child.q.conjugate()).normalized();
    if (offset == Offset::kShrinks) {
      shrink(to_seconds(raw.stamp_ns - *last_ns_));
    }
  }
  last_ns_ = raw.stamp_ns;
  Odometry published = raw;
  published.T_frame_child = {(turn_ * raw.T_frame_child.q).normalized(),
                             raw.T_frame_child.p + offset_map_m_};
  const Eigen::Vector3d turn_rad = so3_log(turn_);
  published.pose_covariance.topLeftCorner<3, 3>() += offset_map_m_ * offset_map_m_.transpose();
  published.pose_covariance.bottomRightCorner<3, 3>() += turn_rad * turn_rad.transpose();
  return published;
}

void HandOver::shrink(double dt_s) {
  const double length_m = offset_map_m_.norm();
  const double step_m = rate_mps_ * std::max(0.0, dt_s);
  offset_map_m_ *= length_m > step_m ? 1.0 - step_m / length_m : 0.0;
  const Eigen::Vector3d turn_rad = so3_log(turn_);
  const double step_rad = rate_radps_ * std::max(0.0, dt_s);
  const double angle_rad = turn_rad.norm();
  turn_ = angle_rad > step_rad ? so3_exp(turn_rad * (1.0 - step_rad / angle_rad))
                               : Eigen::Quaterniond::Identity();
}

}  // namespace trigpoint::fusion_gate
