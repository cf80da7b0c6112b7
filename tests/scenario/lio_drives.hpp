// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The mapper alone (mode lio) on simulated drives, and what can be said about it against the truth.
#pragma once

#include "trigpoint/evaluation/trajectory_error.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include <Eigen/Core>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint {

/// One scan that came through.
struct LioSample {
  double time_s{0.0};  ///< since the scenario's start
  Odometry odometry;
  LioStatus status;
  Pose truth;  ///< of base_link, in map
  lio_mapper::Calibration calibration;
  bool keyframe{false};
};

struct LioDrive {
  std::vector<LioSample> samples;
  Events events;
  LioStatus status;  ///< at the end
  lio_mapper::Calibration calibration;
  double true_length_m{0.0};
  double end_s{0.0};  ///< of the drive

  bool said(const std::string& code) const;
};

struct LioDriveOptions {
  std::optional<double> duration_s;
  lio_mapper::Config config;
  /// Applied to the robot that the mapper is told, not to the simulated one.
  std::function<void(RobotConfig&)> change_robot;
};

LioDrive drive_lio(const simulator::Scenario& scenario,
                   std::uint64_t seed,
                   const LioDriveOptions& options = {});

/// `runs` drives, two at a time, in order.
std::vector<LioDrive> drive_lio_all(int runs, const std::function<LioDrive(int)>& drive);

/// After alignment of the whole drive in yaw and position.
evaluation::AbsoluteError aligned_error(const LioDrive& drive);

/// Error of the change of pose from one sample to another, in odom's axes at `from`, and the
/// covariance that the mapper gives it (relative_pose_covariance).
struct RelativeError {
  Eigen::Matrix<double, 6, 1> error{Eigen::Matrix<double, 6, 1>::Zero()};
  Matrix6d covariance{Matrix6d::Zero()};

  double nees_per_axis() const;
};

RelativeError relative_error(const LioSample& from, const LioSample& to);

/// Pairs `distance_m` of true way apart, beginning every `step_m`.
std::vector<RelativeError> relative_errors(const LioDrive& drive,
                                           double distance_m,
                                           double step_m = 5.0);

}  // namespace trigpoint
