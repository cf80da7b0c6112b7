// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Where odom begins: levelled by gravity, position and heading zero, also when the robot moves.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/pose.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include "imu_buffer.hpp"
#include "scan_filter.hpp"
#include "sweep.hpp"

#include <deque>
#include <optional>
#include <string>

namespace trigpoint::lio_mapper {

inline constexpr double kStandardGravity_mps2 = 9.80665;

/// What the IMU said over a window, in base axes.
struct ImuSummary {
  Eigen::Vector3d mean_gyro_radps{Eigen::Vector3d::Zero()};
  Eigen::Vector3d mean_force_mps2{Eigen::Vector3d::Zero()};  ///< axes of base at the window's end
  double force_change_mps2{0.0};  ///< between the means of the two halves
  double gyro_spread_radps{0.0};  ///< standard deviation
  std::size_t count{0};
};

/// Mean specific force with the turning in between taken out by the gyro.
ImuSummary summarize(const ImuBuffer& imu, Nanoseconds from_ns, Nanoseconds to_ns);

/// Says what is wrong when the mean specific force cannot come from a healthy IMU with z up.
std::optional<Event> check_specific_force(const Eigen::Vector3d& mean_force_mps2,
                                          Nanoseconds stamp_ns);

/// True when nothing in the IMU contradicts standing still. A steady ride looks the same, and so
/// does driving off evenly on another slope.
bool looks_at_rest(const ImuSummary& summary);

/// Uncertainty of a levelled start besides the accelerometer's bias.
struct StartSigmas {
  double tilt_rad{1e-3};
  double velocity_mps{0.05};
  double gyro_bias_radps{1e-3};
};

/// The state with `force_base_mps2` straight up. odom is defined by the first attitude, which is
/// therefore certain; what is not known is the direction of gravity in odom, and it is tied to the
/// accelerometer's bias: -R^T g + b = force.
InitialState level(const Eigen::Vector3d& force_base_mps2,
                   Nanoseconds stamp_ns,
                   const ImuConfig& imu,
                   const StartSigmas& sigmas);

/// A LiDAR that is mounted with another roll and pitch than configured, by `sigma_rad` each, makes
/// a map that leans against the accelerometer by as much. It seems the accelerometer's bias, and
/// the start cannot tell them apart.
void add_unknown_mounting(double sigma_rad, InitialState& initial);

struct StartResult {
  InitialState initial;
  bool at_rest{false};
  double speed_mps{0.0};
  std::optional<Event> trouble;  ///< no start is possible with such an IMU
};

/// True when IMU and sweeps suffice for start().
bool can_start(const StartConfig& config, const ImuBuffer& imu, const std::deque<Sweep>& sweeps);

/// Levels, finds the first velocity by trying forward speeds on the first two sweeps, and in motion
/// levels again with the gravity that a trial run over the waiting sweeps found. At rest is only
/// who does not move in such a trial either.
StartResult start(const Config& configured,
                  const Pose& T_base_lidar,
                  const ImuBuffer& imu,
                  const std::deque<Sweep>& sweeps);

}  // namespace trigpoint::lio_mapper
