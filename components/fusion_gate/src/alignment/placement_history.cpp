// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "alignment/placement_history.hpp"

#include "trigpoint/base/so3.hpp"

#include "fusion/fused_odometry.hpp"

#include <algorithm>

namespace trigpoint::fusion_gate {

namespace {

constexpr Nanoseconds kPlacementMemory_ns = 60 * kNanosecondsPerSecond;

/// Where T_map_odom puts a point, with its covariance.
Odometry place(const Eigen::Vector3d& p_odom_m, const YawPose& T, const Matrix6d& covariance) {
  Odometry point;
  point.T_frame_child.p = p_odom_m;
  point.pose_covariance.setZero();
  return fuse(point, T, covariance);
}

}  // namespace

void PlacementHistory::add(const LioStatus& lio, double distance_m) {
  placements_.push_back({lio.stamp_ns, lio.T_map_odom, lio.T_map_odom_covariance, distance_m});
  while (placements_.front().stamp_ns < lio.stamp_ns - kPlacementMemory_ns) {
    placements_.pop_front();
  }
}

std::optional<Alignment> PlacementHistory::as_of(Nanoseconds stamp_ns,
                                                 const LioStatus& now,
                                                 const Eigen::Vector3d& here_odom_m,
                                                 double distance_m,
                                                 bool height_only) const {
  const auto later = std::find_if(placements_.begin(), placements_.end(), [&](const Placement& p) {
    return p.stamp_ns > stamp_ns;
  });
  if (later == placements_.begin()) {
    return std::nullopt;
  }
  const Placement& then = *std::prev(later);
  const double since_m = std::max(0.0, distance_m - then.distance_m);
  const double walk = config_.smooth.lio_drift_m_per_sqrt_m;
  const double yaw_walk = config_.smooth.lio_yaw_drift_rad_per_sqrt_m;
  const Odometry old = place(here_odom_m, then.T_map_odom, then.covariance);
  Eigen::Vector3d here_map_m = old.T_frame_child.p;
  Eigen::Matrix3d covariance_m2 = old.pose_covariance.topLeftCorner<3, 3>();
  covariance_m2.diagonal().array() += walk * walk * since_m;
  double yaw_rad = then.T_map_odom.yaw_rad;
  double yaw_m2 = then.covariance(0, 0) + yaw_walk * yaw_walk * since_m;
  if (height_only) {
    const Odometry present = place(here_odom_m, now.T_map_odom, now.T_map_odom_covariance);
    const double height_m2 = covariance_m2(2, 2);
    here_map_m.head<2>() = present.T_frame_child.p.head<2>();
    covariance_m2 = Eigen::Matrix3d::Zero();
    covariance_m2.topLeftCorner<2, 2>() = present.pose_covariance.topLeftCorner<2, 2>();
    covariance_m2(2, 2) = height_m2;
    yaw_rad = now.T_map_odom.yaw_rad;
    yaw_m2 = now.T_map_odom_covariance(0, 0);
  }
  return alignment_at(now.odom_epoch, yaw_rad, yaw_m2, here_odom_m, here_map_m, covariance_m2);
}

Alignment alignment_at(std::uint32_t odom_epoch,
                       double yaw_rad,
                       double yaw_variance_rad2,
                       const Eigen::Vector3d& here_odom_m,
                       const Eigen::Vector3d& here_map_m,
                       const Eigen::Matrix3d& here_covariance_m2) {
  const Eigen::Vector3d turned_m = from_yaw(yaw_rad) * here_odom_m;
  Alignment alignment;
  alignment.odom_epoch = odom_epoch;
  alignment.replaces = true;
  alignment.T_map_odom = {yaw_rad, here_map_m - turned_m};
  // e_p = e_here - (e_z x R here) e_yaw
  const Eigen::Vector3d by_yaw = Eigen::Vector3d::UnitZ().cross(turned_m);
  alignment.covariance(0, 0) = yaw_variance_rad2;
  alignment.covariance.block<3, 1>(1, 0) = -by_yaw * yaw_variance_rad2;
  alignment.covariance.block<1, 3>(0, 1) = -by_yaw.transpose() * yaw_variance_rad2;
  alignment.covariance.bottomRightCorner<3, 3>() =
      here_covariance_m2 + yaw_variance_rad2 * by_yaw * by_yaw.transpose();
  return alignment;
}

Alignment moved_aside(const LioStatus& now,
                      const Eigen::Vector3d& here_odom_m,
                      const Eigen::Vector2d& aside_map_m,
                      const Eigen::Matrix2d& covariance_m2) {
  const Odometry present = place(here_odom_m, now.T_map_odom, now.T_map_odom_covariance);
  Eigen::Vector3d here_map_m = present.T_frame_child.p;
  here_map_m.head<2>() += aside_map_m;
  Eigen::Matrix3d here_covariance_m2 = Eigen::Matrix3d::Zero();
  here_covariance_m2.topLeftCorner<2, 2>() = covariance_m2;
  here_covariance_m2(2, 2) = present.pose_covariance(2, 2);
  return alignment_at(now.odom_epoch,
                      now.T_map_odom.yaw_rad,
                      now.T_map_odom_covariance(0, 0),
                      here_odom_m,
                      here_map_m,
                      here_covariance_m2);
}

}  // namespace trigpoint::fusion_gate
