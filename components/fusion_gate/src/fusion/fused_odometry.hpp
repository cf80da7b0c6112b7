// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"

#include <Eigen/Core>

namespace trigpoint::fusion_gate {

/// T_map_odom applied to an odometry in `odom`: base_link in `map`. The twist stays, it is in the
/// child frame. Covariance: that of the odometry turned into map, plus that of T_map_odom carried
/// to the robot (yaw moves it by e_z x R p, tilt likewise), taken as independent. `T_covariance` in
/// the order yaw, x, y, z, tilt x, tilt y.
Odometry fuse(const Odometry& odometry, const YawPose& T_map_odom, const Matrix6d& T_covariance);

/// The same for a transform between two level frames.
Odometry fuse(const Odometry& odometry,
              const YawPose& T_map_odom,
              const Eigen::Matrix4d& T_covariance);

/// A GPS odometry about the antenna, moved to base_link with its own orientation. Where that is not
/// known, the antenna's position is kept and the lever arm's length joins the covariance.
Odometry move_to_base(const Odometry& gps, const Eigen::Vector3d& antenna_position_base_m);

/// Whether its orientation tells where its child frame heads.
bool knows_heading(const Odometry& odometry);

inline constexpr const char* kAntennaFrame = "gnss_antenna";

}  // namespace trigpoint::fusion_gate
