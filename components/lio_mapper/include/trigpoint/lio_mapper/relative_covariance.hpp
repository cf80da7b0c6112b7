// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/base/pose.hpp"

#include <array>

namespace trigpoint::lio_mapper {

/// What lio/odometry and lio/status of one scan say.
struct StatedPose {
  Pose T_odom_base;
  Matrix6d covariance{Matrix6d::Zero()};  ///< of lio/odometry: local map and drift, ROS order
  std::array<double, 6> sigma{};          ///< of lio/status: relative to the local map alone
};

/// Covariance of the change of pose from one scan to a later one, odom's axes, ROS order: the drift
/// between the two, and both poses' uncertainty relative to the local map. With J the transport of
/// a displacement of odom from one place to the other (a turn there moves the later place), L the
/// part relative to the local map and P the whole, P_to - J P_from J^T + L' where L' = 2 J L_from
/// J^T puts back what was taken from it once and counts the first pose's own.
Matrix6d relative_pose_covariance(const StatedPose& from, const StatedPose& to);

}  // namespace trigpoint::lio_mapper
