// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A world of walls and ground as a list of points, seen without noise or occlusion, and drives
// through it whose odometry errs in a known way.
#pragma once

#include "trigpoint/base/so3.hpp"
#include "trigpoint/lio_mapper/pose_graph.hpp"

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace trigpoint::lio_mapper::test {

inline Pose moved_by(const Eigen::Vector3d& p) {
  return {Eigen::Quaterniond::Identity(), p};
}

/// Walls of 4 m by 3 m at random places and headings, and the ground, within `half_side_m`.
inline std::vector<Eigen::Vector3d> walled_world(double half_side_m, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-half_side_m, half_side_m);
  std::uniform_real_distribution<double> heading(0.0, std::numbers::pi);
  std::uniform_real_distribution<double> jitter(-0.1, 0.1);
  std::vector<Eigen::Vector3d> points;
  const int walls = static_cast<int>(half_side_m * half_side_m / 30.0);
  for (int wall = 0; wall < walls; ++wall) {
    const Eigen::Vector3d centre(place(random), place(random), 0.0);
    const Eigen::Vector3d along = from_yaw(heading(random)) * Eigen::Vector3d::UnitX();
    for (double s = -2.0; s < 2.0; s += 0.2) {
      for (double z = 0.2; z < 3.0; z += 0.2) {
        points.push_back(centre + (s + jitter(random)) * along +
                         (z + jitter(random)) * Eigen::Vector3d::UnitZ());
      }
    }
  }
  for (double x = -half_side_m; x < half_side_m; x += 0.5) {
    for (double y = -half_side_m; y < half_side_m; y += 0.5) {
      points.emplace_back(x + jitter(random), y + jitter(random), 0.0);
    }
  }
  return points;
}

inline PointCloud seen_from(const std::vector<Eigen::Vector3d>& world, const Pose& T_world_base) {
  constexpr double kRange_m = 20.0;
  PointCloud cloud;
  const Pose T_base_world = T_world_base.inverse();
  for (const Eigen::Vector3d& point : world) {
    if ((point - T_world_base.p).norm() < kRange_m) {
      const Eigen::Vector3f p = (T_base_world * point).cast<float>();
      cloud.push_back({p.x(), p.y(), p.z(), 1.0F});
    }
  }
  return cloud;
}

/// Poses a metre apart on a circle about the origin, one a second, 1 m above the ground.
inline std::vector<Pose> circle(double radius_m, double length_m) {
  std::vector<Pose> poses;
  for (double s = 0.0; s < length_m; s += 1.0) {
    const double angle = s / radius_m;
    poses.emplace_back(
        from_yaw(angle + 0.5 * std::numbers::pi),
        Eigen::Vector3d(radius_m * std::cos(angle), radius_m * std::sin(angle), 1.0));
  }
  return poses;
}

/// What a LIO makes of `truth` when every step turns by `yaw_rad` and goes by `shift_m` too much;
/// odom is the first true pose's parent frame moved by `T_odom_map`.
inline GraphInput driven_with_drift(const std::vector<Pose>& truth,
                                    double yaw_rad,
                                    const Eigen::Vector3d& shift_m,
                                    const Pose& T_odom_map = {}) {
  GraphInput input;
  Pose T_odom_base = T_odom_map * truth.front();
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (i > 0) {
      T_odom_base =
          T_odom_base * (truth[i - 1].inverse() * truth[i]) * Pose(from_yaw(yaw_rad), shift_m);
    }
    const auto stamp_ns = static_cast<Nanoseconds>(i) * kNanosecondsPerSecond;
    input.keyframes.push_back({stamp_ns, 0, T_odom_base, false, {}});
    if (i == 0) {
      input.trajectory.push_back({0, 0, T_odom_base});
    }
    for (int part = 0; part < 4 && i > 0; ++part) {  // four samples a second, the last at the pose
      const double fraction = 0.25 * (part + 1);
      input.trajectory.push_back(
          {stamp_ns - kNanosecondsPerSecond + from_seconds(fraction),
           0,
           interpolate(input.keyframes[i - 1].T_odom_base, T_odom_base, fraction)});
    }
  }
  return input;
}

inline StoredRow row_at(Nanoseconds stamp_ns, const Eigen::Vector3d& position_m, double sigma_m) {
  StoredRow row;
  row.applied = true;
  row.update.fix_stamp_ns = stamp_ns;
  row.update.decision.fill(AxisDecision::kFused);
  row.update.position_map_m = position_m;
  row.update.covariance_map_m2 = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
  return row;
}

}  // namespace trigpoint::lio_mapper::test
