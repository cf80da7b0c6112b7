// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <string>

namespace trigpoint {
class ConfigFields;
}

namespace trigpoint::gps_odometry {

/// What eskf18 needs besides the common rules: an inertial navigation system with error states.
struct Eskf18Config {
  // IMU: densities, vibration included; saturation; turn-on biases.
  double gyro_noise_radps_sqrthz{0.0015};
  double accel_noise_mps2_sqrthz{0.03};
  double gyro_bias_walk_radps_sqrts{1e-5};
  double accel_bias_walk_mps2_sqrts{2e-4};
  double gyro_bias_sigma_radps{0.005};
  double accel_bias_sigma_mps2{0.08};
  double gyro_limit_radps{8.7};
  double accel_limit_mps2{78.0};

  // Fixes: shares of the (scaled) variance, correlation time by class.
  double fix_slow_share{0.7};
  double fix_white_share{0.5};
  double fix_tau_fixed_s{80.0};
  double fix_tau_float_s{40.0};
  double fix_tau_code_s{50.0};

  // Fixes that contradict the filter.
  std::int64_t absorb_fixes{3};
  double absorb_limit_s{60.0};
  double suspect_outage_s{3.0};
  double doubt_hold_s{30.0};
  double doubt_decay_s{5.0};
  double better_class_decay_s{20.0};

  // Rest, wheels.
  bool use_rest{true};
  double rest_velocity_sigma_mps{0.02};
  double rest_gyro_sigma_radps{3e-4};
  double rest_highest_speed_mps{0.3};
  bool no_side_slip{true};
  double no_side_slip_sigma_mps{0.1};
  double no_side_slip_share{0.1};
  double no_side_slip_interval_s{0.1};
  double no_side_slip_speed_mps{0.4};
  double no_side_slip_yaw_sigma_rad{0.35};
  Eigen::Vector3d no_side_slip_point_base_m{0.0, 0.0, 0.0};
};

/// The only defaults of gps_odometry; every field is described (unit, rule) in src/config.cpp.
struct Config {
  std::string filter{"eskf18"};

  // What is published, and when.
  double publish_rate_hz{50.0};
  double dead_reckoning_after_s{1.0};
  double stale_after_s{30.0};

  // Datum.
  bool use_configured_datum{false};
  double datum_latitude_deg{0.0};
  double datum_longitude_deg{0.0};
  double datum_height_m{0.0};
  double datum_wait_s{2.0};
  std::int64_t datum_fixes{10};
  std::string projection{"enu"};
  double warn_distance_m{10e3};
  double highest_distance_m{50e3};

  // Fix checks.
  double future_limit_s{0.1};
  double rewind_s{2.5};
  double highest_speed_mps{60.0};
  double recovery_s{5.0};
  double gate_probability{0.999};
  std::int64_t frozen_fixes{3};

  // A clock of the fixes that is not the IMU's.
  double clock_same_s{1.0};
  double clock_latest_s{5.0};
  double clock_latency_s{0.1};
  double clock_latency_sigma_s{0.05};

  // What a fix is worth: sigma of a class that sends no covariance, scale of reported sigma, share
  // of its variance that is correlated in time and never averages out, floors of what is published.
  double default_sigma_code_m{3.0};
  double default_sigma_sbas_m{1.5};
  double default_sigma_float_m{0.5};
  double default_sigma_fixed_m{0.05};
  double fix_sigma_scale{2.0};
  double fix_correlated_share{0.7};
  double correlated_decay_s{5.0};
  double floor_sigma_fixed_m{0.02};
  double floor_sigma_other_m{0.05};

  // IMU and motion model.
  double gyro_sigma_radps{0.005};
  double accel_sigma_mps2{0.2};
  double gyro_bias_sigma_radps{0.005};
  double gyro_bias_rest_sigma_radps{0.0003};
  double gyro_bias_horizon_s{5.0};
  double accel_bias_sigma_mps2{0.05};
  double accel_bias_horizon_s{3.0};
  double attitude_noise_rad_sqrts{0.0005};
  double rate_noise_radps_sqrts{0.7};
  double acceleration_sigma_mps2{1.5};
  double acceleration_tau_s{2.0};
  double longest_step_s{0.02};

  // Heading from motion.
  double heading_sigma_rad{0.15};
  double heading_baseline_m{1.5};
  double heading_speed_mps{0.4};
  double heading_converged_rad{0.17};
  double heading_lost_rad{0.8};

  // Optional inputs: velocity and heading.
  double twist_interval_s{0.1};
  double twist_default_sigma_mps{0.2};
  double twist_floor_sigma_mps{0.05};
  double twist_share{0.03};
  Eigen::Vector3d twist_point_base_m{0.0, 0.0, 0.0};
  double yaw_interval_s{0.5};

  Eskf18Config eskf18;
};

void describe(Config& config, ConfigFields& fields);

}  // namespace trigpoint::gps_odometry
