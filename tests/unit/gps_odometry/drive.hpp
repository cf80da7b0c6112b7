// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A vehicle whose motion is known in closed form, its IMU and its GPS, for tests of the filter.
#pragma once

#include "trigpoint/base/robot.hpp"
#include "trigpoint/gps_odometry/gps_odometry.hpp"

#include <Eigen/Core>

#include <functional>
#include <random>
#include <string>
#include <vector>

namespace trigpoint::gps_odometry {

/// Speed (m/s) and yaw rate (rad/s) over time (s); their derivatives are taken numerically at 1e-4
/// s.
struct Profile {
  std::function<double(double)> speed_mps;
  std::function<double(double)> yaw_rate_radps;
  double yaw_start_rad{0.0};
};

/// At rest for `rest_s`, then up to `speed` at 1 m/s^2, then circling.
Profile circle(double speed_mps, double yaw_rate_radps, double rest_s);

/// At rest, then straights of 12 s joined by turns of 90 degrees to either side.
Profile town(double speed_mps, double rest_s);

/// As town, but with a stop of 4 s after every 36 s, and a gentle slalom on the straights.
Profile errands(double speed_mps, double rest_s);

/// Backwards out of a parking lot: at rest, 3 s of -0.8 m/s, a stop, then as town.
Profile reverse_start(double speed_mps, double rest_s);

struct Truth {
  double time_s{0.0};
  Eigen::Vector3d position_map_m{Eigen::Vector3d::Zero()};
  double yaw_rad{0.0};
  double speed_mps{0.0};
  double yaw_rate_radps{0.0};
  double forward_accel_mps2{0.0};

  Pose T_map_base() const;
};

/// Truth at 1 kHz.
std::vector<Truth> drive(const Profile& profile, double duration_s);

struct Sensors {
  double imu_hz{100.0};
  double gyro_noise_radps{0.002};
  double accel_noise_mps2{0.02};
  Eigen::Vector3d gyro_bias_radps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d accel_bias_mps2{Eigen::Vector3d::Zero()};
  double gyro_vibration_radps{0.0};  ///< more noise while moving
  double accel_vibration_mps2{0.0};
  double fix_hz{5.0};
  double latency_s{0.12};
  double white_sigma_m{0.010};   ///< horizontal; vertical 1.8 times that
  double wander_sigma_m{0.008};  ///< Gauss-Markov part
  double wander_tau_s{100.0};
  double reported_sigma_m{0.014};
  FixStatus status{FixStatus::kGbas};
  double outage_from_s{1e9};
  double outage_to_s{1e9};
  RobotConfig robot;
};

/// One input with the time when it became available.
struct Input {
  double available_s{0.0};
  bool is_fix{false};
  ImuSample imu;
  GnssFix fix;
};

inline constexpr Nanoseconds kEpoch_ns = 1'700'000'000LL * kNanosecondsPerSecond;

Datum test_datum();

Nanoseconds stamp_of(double time_s);

/// All inputs in the order of their availability.
std::vector<Input> sense(const std::vector<Truth>& truth, const Sensors& sensors, unsigned seed);

GnssFix fix_at(const Eigen::Vector3d& antenna_map_m, double time_s, double sigma_m);
ImuSample imu_at(double time_s);

/// One published position against the truth.
struct Sample {
  double time_s{0.0};
  Eigen::Vector3d error_m;
  Eigen::Vector3d sigma_m;
  double yaw_error_rad{0.0};
  double yaw_sigma_rad{0.0};
  double speed_mps{0.0};
};

struct Recorded {
  std::vector<Sample> samples;
  std::vector<GpsStatus> statuses;
  std::vector<Odometry> odometry;
  Events events;
};

/// Feeds everything to one filter.
Recorded run(GpsOdometry& filter,
             const std::vector<Input>& inputs,
             const std::vector<Truth>& truth);

/// Root of the mean squared 3-D error from `from_s` on.
double rms_m(const std::vector<Sample>& samples, double from_s, double to_s = 1e9);

/// How often a reason was counted.
std::uint64_t count_of(const GpsStatus& status, const std::string& reason);

/// Defaults with the test's datum.
Config config_with_datum(const std::string& filter = "ekf15");

}  // namespace trigpoint::gps_odometry
