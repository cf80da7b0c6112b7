// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/pose.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace trigpoint {

class ConfigFields;

/// Where the sensors sit on the robot, and what their topics and frames are called. The only
/// defaults; `robot:` in the configuration.
struct RobotConfig {
  Eigen::Vector3d lidar_position_base_m{0.0, 0.0, 0.0};
  Eigen::Vector3d lidar_roll_pitch_yaw_base_rad{0.0, 0.0, 0.0};
  Eigen::Vector3d antenna_position_base_m{0.0, 0.0, 0.0};
  /// Rotation from the IMU's axes to base_link's (x forward, y left, z up); base_link is at the
  /// IMU.
  Eigen::Vector3d imu_roll_pitch_yaw_base_rad{0.0, 0.0, 0.0};
  std::string points_topic{"points"};
  std::string imu_topic{"imu/data"};
  std::string fix_topic{"gps/fix"};
  // Optional inputs; empty: none.
  std::string twist_topic;
  std::string twist_message{"TwistWithCovarianceStamped"};
  std::string yaw_topic;
  double yaw_offset_rad{0.0};
  double yaw_default_sigma_rad{0.35};
  double yaw_floor_sigma_rad{0.035};
  // Frames that a message may be in; none listed: any.
  std::vector<std::string> imu_frame_ids;
  std::vector<std::string> fix_frame_ids;
  std::vector<std::string> twist_frame_ids;
  /// Added to the altitude of fixes: 0 for heights above the ellipsoid.
  double geoid_undulation_m{0.0};

  Pose T_base_lidar() const;
  Eigen::Quaterniond q_base_imu() const;
};

void describe(RobotConfig& config, ConfigFields& fields);

}  // namespace trigpoint
