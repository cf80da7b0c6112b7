// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace trigpoint {

/// A rigid transform T_target_source: p_target = q * p_source + p.
struct Pose {
  Eigen::Quaterniond q{Eigen::Quaterniond::Identity()};  ///< R_target_source, unit norm
  Eigen::Vector3d p{Eigen::Vector3d::Zero()};            ///< origin of source in target, m

  Pose() = default;

  Pose(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation_m)
      : q(rotation), p(translation_m) {}

  Pose inverse() const { return {q.conjugate(), q.conjugate() * (-p)}; }

  Eigen::Vector3d operator*(const Eigen::Vector3d& point_m) const { return q * point_m + p; }

  Pose operator*(const Pose& other) const { return {(q * other.q).normalized(), q * other.p + p}; }

  bool is_finite() const { return q.coeffs().allFinite() && p.allFinite(); }
};

/// Interpolates at `fraction` in [0, 1]: positions linearly, rotations along the shorter arc.
Pose interpolate(const Pose& from, const Pose& to, double fraction);

/// A transform into a level frame from one that was meant to be level, as T_map_odom is:
/// R = Rz(yaw) exp((tilt x, tilt y, 0)).
struct YawPose {
  double yaw_rad{0.0};
  Eigen::Vector3d p{Eigen::Vector3d::Zero()};         ///< m
  Eigen::Vector2d tilt_rad{Eigen::Vector2d::Zero()};  ///< turns the source's axes level

  Pose pose() const;
};

/// Covariance of a pose, order x y z (m), roll pitch yaw (rad, fixed axes of the parent frame) as
/// in ROS; blocks that are not known are kUnknownVariance on their diagonal, never 0.
using PoseCovariance = Eigen::Matrix<double, 6, 6>;

inline constexpr double kUnknownVariance = 1e6;

}  // namespace trigpoint
