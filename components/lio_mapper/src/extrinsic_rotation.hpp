// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How the LiDAR is turned on the robot.
// Scans hold the LiDAR to the map that it made itself, so that they are right about its motion
// whatever is taken for the extrinsic. Turned back into base with an extrinsic that lacks the turn
// exp(e) (base axes), the attitude found is R_scan = C R_true exp(e), C unknown and constant,
// while the gyro sees R_true: the hand-eye equation [Y. Shiu, S. Ahmad, "Calibration of
// wrist-mounted robotic sensors by solving homogeneous transform equations of the form AX = XB",
// IEEE TRA 1989; as continuous motion against a gyro: F. Zhu et al., "Robust real-time
// LiDAR-inertial initialization", IROS 2022]. To first order log(R_scan R_gyro^T) = a + R_scan e:
// what lies across the axis of a turn goes round with it and shows, what lies along it hides in a.
// On a robot that drives on the ground turns teach roll and pitch, and only what it rolls and
// pitches teaches yaw.
#pragma once

#include "attitude_window.hpp"
#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>

namespace trigpoint::lio_mapper {

class ExtrinsicRotationEstimator {
 public:
  /// `sigma_rad`: of the configured rotation, each axis.
  explicit ExtrinsicRotationEstimator(double sigma_rad);

  /// Windows in order of time; an empty one is none. `taken_base_rad`: what the window's attitudes
  /// already took of the turn.
  void add(const AttitudeWindow& window, const Eigen::Vector3d& taken_base_rad);

  /// e: T_base_lidar is turned by exp(e) from what is configured, in base axes.
  const Eigen::Vector3d& turn_base_rad() const { return turn_rad_; }

  /// Of it what is much better known than what was configured, which a few windows only exchange
  /// for their noise.
  Eigen::Vector3d certain_turn_base_rad() const;

  /// Of turn_base_rad(), rad^2 about base's axes.
  const Eigen::Matrix3d& covariance() const { return covariance_rad2_; }

  /// Of who takes certain_turn_base_rad(): about the other axes the configuration's.
  Eigen::Matrix3d certain_covariance() const;

 private:
  double most_when_certain_rad2_;  ///< variance about an axis
  Eigen::Vector3d turn_rad_{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d covariance_rad2_;
  std::size_t windows_{0};
  std::size_t turns_{0};     ///< windows that told something
  double noise2_rad2_{0.0};  ///< of one attitude, mean over windows
  double excess_;            ///< squared innovations of windows over what they should be
};

}  // namespace trigpoint::lio_mapper
