// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The state of the mapper on its manifold, and its error.
// References: [1] C. Hertzberg et al., "Integrating generic sensor fusion algorithms with sound
// state representations through encapsulation of manifolds", Information Fusion 2013 (box-plus).
// [2] W. Xu et al., "FAST-LIO2: Fast direct LiDAR-inertial odometry", T-RO 2022, Table I.
#pragma once

#include "trigpoint/base/pose.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace trigpoint::lio_mapper {

/// Where each block of the error sits.
namespace error {
inline constexpr int kPosition = 0;           ///< odom, m
inline constexpr int kRotation = 3;           ///< R_true = R exp(e): body axes, rad
inline constexpr int kExtrinsicRotation = 6;  ///< R_base_lidar = R exp(e): LiDAR axes, rad
inline constexpr int kExtrinsicPosition = 9;  ///< of the LiDAR, base, m
inline constexpr int kVelocity = 12;          ///< odom, m/s
inline constexpr int kGyroBias = 15;          ///< rad/s
inline constexpr int kAccelBias = 18;         ///< m/s^2
inline constexpr int kGravity = 21;           ///< 2 angles on the sphere, rad
inline constexpr int kYawMapOdom = 23;        ///< rad
inline constexpr int kPositionMapOdom = 24;   ///< m
inline constexpr int kSize = 27;
inline constexpr int kPose = 6;  ///< position and rotation come first: what a scan sees
}  // namespace error

using ErrorVector = Eigen::Matrix<double, error::kSize, 1>;
using ErrorMatrix = Eigen::Matrix<double, error::kSize, error::kSize>;

struct State {
  Pose T_odom_base;
  Eigen::Vector3d v_odom_mps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d gyro_bias_radps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d accel_bias_mps2{Eigen::Vector3d::Zero()};
  /// Acceleration of free fall in odom; its magnitude is fixed, its direction estimated.
  Eigen::Vector3d gravity_odom_mps2{0.0, 0.0, -9.80665};
  YawPose T_map_odom;  ///< without tilt: that is in the gravity
  Pose T_base_lidar;

  bool is_finite() const;

  /// T_map_odom complete: its tilt turns gravity straight down.
  YawPose placement() const;
};

/// Columns: by how much the point p_map = placement() * p_odom moves with the two gravity errors.
Eigen::Matrix<double, 3, 2> placed_point_by_gravity(const State& state,
                                                    const Eigen::Vector3d& p_odom_m);

/// d tilt / d gravity error.
Eigen::Matrix2d tilt_by_gravity(const Eigen::Vector3d& gravity_odom_mps2);

/// Unit vectors that span the tangent plane of the sphere at the direction of `gravity`.
Eigen::Matrix<double, 3, 2> gravity_tangent(const Eigen::Vector3d& gravity);

/// state [+] e. Gravity turns by the rotation vector tangent * e.
State boxplus(const State& state, const ErrorVector& e);

/// The e with from [+] e = to.
ErrorVector boxminus(const State& to, const State& from);

/// J of prior [-]: (state [+] e) [-] prior = (state [-] prior) + J e to first order, given
/// `difference` = state [-] prior. Exact in rotation, to first order of the difference in gravity.
struct PriorJacobian {
  Eigen::Matrix3d rotation;
  Eigen::Matrix3d inverse_rotation;
  Eigen::Matrix3d inverse_extrinsic_rotation;
  Eigen::Matrix2d gravity;
  Eigen::Matrix2d inverse_gravity;
};

PriorJacobian prior_jacobian(const State& state, const State& prior, const ErrorVector& difference);

/// J^-1 e and J^-1 P J^-T.
ErrorVector to_tangent_of_state(const PriorJacobian& jacobian, const ErrorVector& e);
ErrorMatrix to_tangent_of_state(const PriorJacobian& jacobian, const ErrorMatrix& covariance);

/// J^-1 M: only the left side.
ErrorMatrix transition_to_tangent_of_state(const PriorJacobian& jacobian,
                                           const ErrorMatrix& transition);

/// Keeps rounding from making a covariance lopsided.
void make_symmetric(ErrorMatrix& covariance);

/// The state seen from an odom frame that is turned (about z) and shifted so that its pose has the
/// heading and position of `T_odom_base_wanted`; T_map_odom takes up the difference, so that
/// T_map_odom * position and heading in map, and all that is expressed in base, stay as they are.
State with_odom_moved(const State& state, const Pose& T_odom_base_wanted);

}  // namespace trigpoint::lio_mapper
