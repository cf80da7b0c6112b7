// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Rotations: exponential, logarithm and Jacobians of SO(3).
// References: [1] J. Sola, J. Deray, D. Atchuthan, "A micro Lie theory for state estimation in
// robotics", arXiv:1812.01537, eq. 132-147.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace trigpoint {

/// Cross-product matrix: hat(a) * b = a x b.
Eigen::Matrix3d hat(const Eigen::Vector3d& a);

/// Rotation vector (rad) to unit quaternion, [1] eq. 132.
Eigen::Quaterniond so3_exp(const Eigen::Vector3d& rotation_rad);

/// Unit quaternion to rotation vector (rad) with angle in [0, pi], [1] eq. 133.
Eigen::Vector3d so3_log(const Eigen::Quaterniond& q);

/// Right Jacobian: exp(a + d) = exp(a) exp(J_r(a) d) to first order, [1] eq. 143.
Eigen::Matrix3d so3_right_jacobian(const Eigen::Vector3d& rotation_rad);

/// Inverse of the right Jacobian, [1] eq. 144.
Eigen::Matrix3d so3_right_jacobian_inverse(const Eigen::Vector3d& rotation_rad);

/// Heading (rad, 0 along +x, counter-clockwise about +z) of the x axis of the rotated frame.
double yaw_of(const Eigen::Quaterniond& q_world_body);

/// Rotation by `yaw_rad` about +z.
Eigen::Quaterniond from_yaw(double yaw_rad);

/// Roll, pitch, yaw (rad) of R = Rz(yaw) Ry(pitch) Rx(roll); pitch in [-pi/2, pi/2].
Eigen::Vector3d roll_pitch_yaw_of(const Eigen::Quaterniond& q_world_body);

/// Inverse of roll_pitch_yaw_of.
Eigen::Quaterniond from_roll_pitch_yaw(const Eigen::Vector3d& roll_pitch_yaw_rad);

/// The equivalent angle in (-pi, pi].
double wrap_angle(double angle_rad);

/// The smallest rotation that turns the direction of `from` to the direction of `to`.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace trigpoint
