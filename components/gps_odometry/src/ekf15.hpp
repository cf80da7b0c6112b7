// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The 15-state filter itself: no sensors' faults, no time, no decisions. Equations in README.md.
// References: [1] T. Moore, D. Stouch, "A generalized extended Kalman filter implementation for the
// Robot Operating System", IAS-13, 2014. [2] Y. Bar-Shalom, X. Li, T. Kirubarajan, "Estimation with
// applications to tracking and navigation", 2001, eq. 5.2.3-18 (Joseph form), 8.2 (manoeuvre
// models).
#pragma once

#include "covariance_watch.hpp"
#include "gravity.hpp"
#include <Eigen/Core>

namespace trigpoint::gps_odometry {

using Vector15d = Eigen::Matrix<double, 15, 1>;
using Matrix15d = Eigen::Matrix<double, 15, 15>;

/// Order of the states: position of base_link in map (m), roll pitch yaw (rad, R_map_base =
/// Rz(yaw) Ry(pitch) Rx(roll)), velocity (m/s), rates (rad/s) and acceleration (m/s^2) in
/// base_link.
enum StateIndex : int {
  kPosition = 0,
  kAttitude = 3,
  kVelocity = 6,
  kRate = 9,
  kAcceleration = 12
};

/// Noise of the motion model, per square root of a second where it is a random walk.
struct MotionNoise {
  double attitude_rad_sqrts{0.0};
  double velocity_mps_sqrts{0.0};
  double velocity_up_mps_sqrts{0.0};  ///< along z of base_link, which is nearly up
  double rate_radps_sqrts{0.0};
  double acceleration_sigma_mps2{1.0};
  double acceleration_tau_s{2.0};
  double tilt_rad_sqrts{0.0};  ///< of roll and pitch, beyond the attitude's
};

struct Ekf15 {
  Vector15d x{Vector15d::Zero()};
  Matrix15d P{Matrix15d::Identity()};

  Eigen::Matrix3d R_map_base() const;

  bool is_finite() const { return x.allFinite() && P.allFinite(); }

  bool is_positive() const { return is_positive_covariance(P); }

  void bound() { bound_position(P); }
};

/// Body rates = W(rpy) d(rpy)/dt; a small rotation about body axes = W d(rpy).
Eigen::Matrix3d body_from_euler_rates(const Eigen::Vector3d& roll_pitch_yaw_rad);

/// d(rpy)/dt = E(rpy) body rates. 1 / cos(pitch) is limited so that pitch 90 degrees stays finite.
Eigen::Matrix3d euler_from_body_rates(const Eigen::Vector3d& roll_pitch_yaw_rad);

/// The motion model over one step and its Jacobian.
Vector15d propagate(const Vector15d& x, double dt_s, double acceleration_tau_s);
Matrix15d propagation_jacobian(const Vector15d& x, double dt_s, double acceleration_tau_s);

/// Predicts over `duration_s` in steps of at most `longest_step_s`; the result does not depend on
/// how a duration is cut (to second order of the step).
void predict(Ekf15& filter, double duration_s, double longest_step_s, const MotionNoise& noise);

/// What accelerometer and antenna should see, and the Jacobians.
Eigen::Vector3d expected_specific_force(const Vector15d& x);
Eigen::Matrix<double, 3, 15> specific_force_jacobian(const Vector15d& x);
Eigen::Vector3d expected_antenna(const Vector15d& x, const Eigen::Vector3d& lever_base_m);
Eigen::Matrix<double, 3, 15> antenna_jacobian(const Vector15d& x,
                                              const Eigen::Vector3d& lever_base_m);

/// Gyro and accelerometer in base_link's axes, noise sigma of one sample.
void update_imu(Ekf15& filter,
                const Eigen::Vector3d& gyro_radps,
                const Eigen::Vector3d& accel_mps2,
                double gyro_sigma_radps,
                double accel_sigma_mps2);

/// A position of the antenna in map.
void update_antenna(Ekf15& filter,
                    const Eigen::Vector3d& position_map_m,
                    const Eigen::Matrix3d& covariance_m2,
                    const Eigen::Vector3d& lever_base_m);

/// A velocity in base_link, each axis with its own sigma.
void update_velocity(Ekf15& filter,
                     const Eigen::Vector3d& velocity_base_mps,
                     const Eigen::Vector3d& sigma_mps);

/// Velocity, in base_link's axes, of a point of the vehicle.
Eigen::Vector3d point_velocity(const Vector15d& x, const Eigen::Vector3d& point_base_m);
Eigen::Matrix<double, 3, 15> point_velocity_jacobian(const Eigen::Vector3d& point_base_m);

/// A twist's linear part (wheels).
void update_point_velocity(Ekf15& filter,
                           const Eigen::Vector3d& velocity_base_mps,
                           const Eigen::Matrix3d& covariance_m2ps2,
                           const Eigen::Vector3d& point_base_m);

/// Heading in map, counter-clockwise from east (magnetometer, two antennas).
void update_yaw(Ekf15& filter, double yaw_rad, double sigma_rad);

/// Forgets what `size` states from `first` were, and sets their covariance.
void reset_block(Ekf15& filter, int first, const Eigen::Matrix3d& covariance);

/// The same state in another map frame: p' = R p + t.
void change_frame(Ekf15& filter,
                  const Eigen::Matrix3d& R_new_old,
                  const Eigen::Vector3d& t_new_old);

}  // namespace trigpoint::gps_odometry
