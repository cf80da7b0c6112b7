// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The error-state inertial filter itself: no sensors' faults, no time, no decisions. Equations in
// README.md.
// References: [1] J. Sola, "Quaternion kinematics for the error-state Kalman filter",
// arXiv:1711.02508, chapters 5 and 6 (local angular error). [2] P. Groves, "Principles of GNSS,
// inertial, and multisensor integrated navigation systems", 2nd ed., 2013, 3.2.4 (closed-loop
// correction), 14.2 (INS/GNSS error states, lever arm), 15.3 and 15.4 (ZUPT, ZARU, non-holonomic
// constraints). [3] Y. Bar-Shalom, X. Li, T. Kirubarajan, "Estimation with applications to tracking
// and navigation", 2001, 5.2.3-18 (Joseph form), 8.2.3 (Gauss-Markov noise).
#pragma once

#include "covariance_watch.hpp"
#include <Eigen/Core>
#include <Eigen/Geometry>

namespace trigpoint::gps_odometry {

using Vector18d = Eigen::Matrix<double, 18, 1>;
using Matrix18d = Eigen::Matrix<double, 18, 18>;

/// Order of the errors, three each: position (m) and velocity (m/s) in map, rotation (rad, about
/// base_link's axes: R = R_estimate Exp(error)), biases of gyro (rad/s) and accelerometer (m/s^2)
/// in base_link, slow error of the fixes (m) in map.
namespace ins {
inline constexpr int kPosition = 0;
inline constexpr int kVelocity = 3;
inline constexpr int kRotation = 6;
inline constexpr int kGyroBias = 9;
inline constexpr int kAccelBias = 12;
inline constexpr int kFixError = 15;
}  // namespace ins

struct Eskf18 {
  Eigen::Vector3d p_map_m{Eigen::Vector3d::Zero()};
  Eigen::Vector3d v_map_mps{Eigen::Vector3d::Zero()};
  Eigen::Quaterniond q_map_base{Eigen::Quaterniond::Identity()};
  Eigen::Vector3d gyro_bias_radps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d accel_bias_mps2{Eigen::Vector3d::Zero()};
  Eigen::Vector3d fix_error_map_m{Eigen::Vector3d::Zero()};
  Matrix18d P{Matrix18d::Identity()};

  Eigen::Matrix3d R_map_base() const { return q_map_base.toRotationMatrix(); }

  /// Numbers, and no negative variance.
  bool is_finite() const;

  bool is_positive() const { return is_positive_covariance(P); }

  void bound() { bound_position(P); }
};

/// Mean of gyro and accelerometer over an interval, base_link's axes, biases included.
struct ImuMean {
  Eigen::Vector3d gyro_radps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d accel_mps2{Eigen::Vector3d::Zero()};
};

/// Densities of what drives the errors: white noise per square root of Hz, random walks per square
/// root of s, and the Gauss-Markov error of the fixes.
struct InsNoise {
  double gyro_radps_sqrthz{0.0};
  double accel_mps2_sqrthz{0.0};
  double gyro_bias_radps_sqrts{0.0};
  double accel_bias_mps2_sqrts{0.0};
  Eigen::Vector3d fix_error_sigma_m{Eigen::Vector3d::Zero()};
  double fix_error_tau_s{50.0};
};

/// The state with an error applied: what the error states mean.
Eskf18 with_error(const Eskf18& filter, const Vector18d& error);

/// Strapdown over one step: rotation and specific force constant in it, taken at its middle.
Eskf18 propagate(const Eskf18& filter, const ImuMean& imu, double dt_s, double fix_error_tau_s);

/// Errors after the step by errors before it.
Matrix18d transition(const Eskf18& filter, const ImuMean& imu, double dt_s, double fix_error_tau_s);

/// Predicts over `duration_s` in steps of at most `longest_step_s`; the result does not depend on
/// how a duration is cut (to second order of the step).
void predict(Eskf18& filter,
             const ImuMean& imu,
             double duration_s,
             double longest_step_s,
             const InsNoise& noise);

/// What sensors should see, each with its Jacobian by the errors.
using Jacobian3 = Eigen::Matrix<double, 3, 18>;
using Jacobian1 = Eigen::Matrix<double, 1, 18>;

/// The antenna itself: p + R l, without the error of fixes.
Eigen::Vector3d antenna(const Eskf18& filter, const Eigen::Vector3d& lever_base_m);
Jacobian3 antenna_jacobian(const Eskf18& filter, const Eigen::Vector3d& lever_base_m);

/// A fix: the antenna and the slow error.
Eigen::Vector3d expected_fix(const Eskf18& filter, const Eigen::Vector3d& lever_base_m);
Jacobian3 fix_jacobian(const Eskf18& filter, const Eigen::Vector3d& lever_base_m);

/// Velocity, in base_link's axes, of a point of the vehicle; `gyro_radps` as measured.
Eigen::Vector3d body_velocity(const Eskf18& filter,
                              const Eigen::Vector3d& point_base_m,
                              const Eigen::Vector3d& gyro_radps);
Jacobian3 body_velocity_jacobian(const Eskf18& filter, const Eigen::Vector3d& point_base_m);

/// Specific force while at rest.
Eigen::Vector3d force_at_rest(const Eskf18& filter);
Jacobian3 force_at_rest_jacobian(const Eskf18& filter);

double yaw(const Eskf18& filter);
Jacobian1 yaw_jacobian(const Eskf18& filter);

// Updates: Kalman's with the covariance in Joseph's form [3], error injected and reset ([1] 6.3).

void update_fix(Eskf18& filter,
                const Eigen::Vector3d& antenna_map_m,
                const Eigen::Matrix3d& white_covariance_m2,
                const Eigen::Vector3d& lever_base_m);

/// A twist's linear part (wheels), or with wide sigmas along free axes a constraint.
void update_body_velocity(Eskf18& filter,
                          const Eigen::Vector3d& velocity_base_mps,
                          const Eigen::Matrix3d& covariance_m2ps2,
                          const Eigen::Vector3d& point_base_m,
                          const Eigen::Vector3d& gyro_radps);

/// Wheels roll and do not slide: no lateral and no vertical velocity at the point ([2] 15.4.1).
void update_no_side_slip(Eskf18& filter,
                         double sigma_mps,
                         const Eigen::Vector3d& point_base_m,
                         const Eigen::Vector3d& gyro_radps);

/// At rest: no velocity and no rotation ([2] 15.3); the gyro's mean is its bias.
void update_at_rest(Eskf18& filter,
                    double velocity_sigma_mps,
                    const Eigen::Vector3d& mean_gyro_radps,
                    double gyro_sigma_radps);

/// The mean specific force is gravity's, more or less: levels while nothing else does.
void update_level(Eskf18& filter, const Eigen::Vector3d& accel_mps2, double sigma_mps2);

/// Heading in map, counter-clockwise from east (magnetometer, two antennas).
void update_yaw(Eskf18& filter, double yaw_rad, double sigma_rad);

/// Forgets what three errors from `first` were, and sets their covariance.
void reset_block(Eskf18& filter, int first, const Eigen::Matrix3d& covariance);

/// Forgets one error's correlations and sets its variance.
void reset_axis(Eskf18& filter, int index, double variance);

/// Turns the vehicle about the vertical and sets the heading's sigma; tilt keeps its covariance.
void set_heading(Eskf18& filter, double turn_rad, double sigma_rad);

/// Makes the tilt and heading less certain by these sigmas about the axes of map.
void doubt_rotation(Eskf18& filter, const Eigen::Vector3d& sigma_map_rad);

/// The same state in another map frame: p' = R p + t.
void change_frame(Eskf18& filter,
                  const Eigen::Matrix3d& R_new_old,
                  const Eigen::Vector3d& t_new_old);

}  // namespace trigpoint::gps_odometry
