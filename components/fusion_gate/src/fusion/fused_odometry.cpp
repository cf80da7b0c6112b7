// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fusion/fused_odometry.hpp"

#include "trigpoint/base/so3.hpp"

namespace trigpoint::fusion_gate {

namespace {

// An orientation with a yaw variance above this says nothing about a lever arm of some metres.
constexpr double kUsableYawVariance_rad2 = 0.1;

}  // namespace

Odometry fuse(const Odometry& odometry, const YawPose& T_map_odom, const Matrix6d& T_covariance) {
  const Pose T = T_map_odom.pose();
  Odometry fused = odometry;
  fused.frame_id = "map";
  fused.child_frame_id = "base_link";
  fused.T_frame_child = T * odometry.T_frame_child;

  const Eigen::Matrix3d R_map_odom = T.q.toRotationMatrix();
  Matrix6d by_pose = Matrix6d::Zero();
  by_pose.topLeftCorner<3, 3>() = R_map_odom;
  by_pose.bottomRightCorner<3, 3>() = R_map_odom;

  const Eigen::Vector3d& p_odom_m = odometry.T_frame_child.p;
  const Eigen::Vector3d tilt{T_map_odom.tilt_rad.x(), T_map_odom.tilt_rad.y(), 0.0};
  const Eigen::Matrix3d J_tilt = so3_right_jacobian(tilt);
  Matrix6d by_transform = Matrix6d::Zero();
  by_transform.block<3, 1>(0, 0) = Eigen::Vector3d::UnitZ().cross(R_map_odom * p_odom_m);
  by_transform.block<3, 3>(0, 1) = Eigen::Matrix3d::Identity();
  by_transform.block<3, 2>(0, 4) = -(R_map_odom * hat(p_odom_m) * J_tilt).leftCols<2>();
  by_transform(5, 0) = 1.0;
  by_transform.block<3, 2>(3, 4) = (R_map_odom * J_tilt).leftCols<2>();

  fused.pose_covariance = by_pose * odometry.pose_covariance * by_pose.transpose() +
                          by_transform * T_covariance * by_transform.transpose();
  return fused;
}

Odometry fuse(const Odometry& odometry,
              const YawPose& T_map_odom,
              const Eigen::Matrix4d& T_covariance) {
  Matrix6d with_tilt = Matrix6d::Zero();
  with_tilt.topLeftCorner<4, 4>() = T_covariance;
  return fuse(odometry, T_map_odom, with_tilt);
}

bool knows_heading(const Odometry& odometry) {
  return odometry.pose_covariance(5, 5) < kUsableYawVariance_rad2;
}

Odometry move_to_base(const Odometry& gps, const Eigen::Vector3d& antenna_position_base_m) {
  Odometry base = gps;
  base.frame_id = "map";
  base.child_frame_id = "base_link";
  if (gps.child_frame_id != kAntennaFrame) {
    return base;
  }
  if (!knows_heading(gps)) {
    base.pose_covariance.topLeftCorner<3, 3>() +=
        antenna_position_base_m.squaredNorm() * Eigen::Matrix3d::Identity();
    return base;
  }
  const Eigen::Vector3d lever_map_m = gps.T_frame_child.q * antenna_position_base_m;
  base.T_frame_child.p -= lever_map_m;
  Matrix6d by_antenna = Matrix6d::Identity();  // d(p - R l) = dp + [R l]x dtheta
  by_antenna.topRightCorner<3, 3>() = hat(lever_map_m);
  base.pose_covariance = by_antenna * gps.pose_covariance * by_antenna.transpose();
  return base;
}

}  // namespace trigpoint::fusion_gate
